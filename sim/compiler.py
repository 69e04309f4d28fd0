"""How numba compiles the functions that a kernel calls: each is optimised once, and is machine code once at most.

numba by itself takes each function for an end: it links in all that the function calls, down to the last, optimises the whole
anew, makes machine code of it and wraps that for Python to call. Here a function that vanishes into its callers is left as it
is for them to optimise; one that stays apart is machine code of its own, which its callers find by its name.
"""

import gc
from contextlib import contextmanager
from types import SimpleNamespace

from llvmlite import ir
from numba.core import cgutils, typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import PassManager
from numba.core.datamodel import models
from numba.core.extending import NativeValue, intrinsic, register_model, unbox
from numba.core.imputils import lower_builtin
from numba.np import arrayobj

#: Of numba's passes those that our kernels have a use for: they have no closures, no `with`, and no expressions of arrays.
PASSES = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.RewriteSemanticConstants,
    untyped_passes.DeadBranchPrune,
    untyped_passes.GenericRewrites,
    untyped_passes.ReconstructSSA,
    typed_passes.NopythonTypeInference,
    typed_passes.PreLowerStripPhis,
    typed_passes.IRLegalization,
    typed_passes.NativeLowering,
    typed_passes.NoPythonBackend,
)
READ, KEEP, DATA = 0, 3, 1  # what llvm.prefetch is told: to read it, to keep it in all caches, and that it is no code


class MeltedCode(JITCodeLibrary):
    """Code that is nothing by itself, only something to link."""

    codegen = SimpleNamespace(set_env=lambda *_: None)  # which numba would do in the machine code

    def _optimize_functions(self, module):
        module.data_layout = self._codegen._data_layout
        for function in module.functions:
            if not function.is_declaration:  # for each of which numba would set up all passes
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    def _optimize_final_module(self):
        pass

    def _finalize_final_module(self):
        self._finalized = True


class CodeApart(JITCodeLibrary):
    """Machine code, of which there is nothing to link."""

    def _optimize_functions(self, module):
        module.data_layout = self._codegen._data_layout  # it is optimised with what it calls

    def finalize(self):
        super().finalize()
        self._shared_module = JITCodeLibrary(self._codegen, self.name)._final_module  # empty


class Plain(Compiler):
    """Compiles a function in which an index below zero is none: numba would look at each whether it counts from the end."""

    def define_pipelines(self):
        passes = PassManager("kernel")
        for each in PASSES:
            passes.add_pass(each, each.__name__)
        passes.finalize()
        return [passes]

    def _compile_bytecode(self):
        fix, arrayobj.fix_integer_index = arrayobj.fix_integer_index, as_it_is
        try:
            with swift():
                return super()._compile_bytecode()
        finally:
            arrayobj.fix_integer_index = fix


@contextmanager
def swift():
    """What numba found out once it need not find out again: whether, say, floats can be added, it would ask all that it can add.
    And what it builds up for a kernel the collector need not look through time and again."""
    find, collects, known = types.BaseFunction.get_call_type, gc.isenabled(), {}

    def remembered(function, context, arguments, keywords):
        if keywords:
            return find(function, context, arguments, keywords)
        key = function, arguments
        if key not in known:
            known[key] = find(function, context, arguments, keywords)
        return known[key]

    if not collects:  # around all that the kernel calls
        yield
        return
    gc.disable()
    types.BaseFunction.get_call_type = remembered
    try:
        yield
    finally:
        types.BaseFunction.get_call_type = find
        gc.enable()


def as_it_is(context, builder, kind, index, size):
    return context.cast(builder, index, kind, types.intp)


class Melt(Plain):
    """Compiles a function that vanishes into its callers."""

    code = MeltedCode

    def _compile_bytecode(self):
        function, codegen = self.state.func_id, self.state.targetctx.codegen()
        function.unique_id = 0  # numba counts functions, and would name one differently in each process
        self.state.library = self.code(codegen, function.func_qualname)
        self.state.library.enable_object_caching()
        return super()._compile_bytecode()


class SetApart(Melt):
    """Compiles a function that stays one of its own."""

    code = CodeApart


@intrinsic
def prefetch(typing, array, row):
    """`sim.prefetch.prefetch` as the processor's instruction."""

    def lower(context, builder, signature, arguments):
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        array = arrayobj.make_array(signature.args[0])(context, builder, arguments[0])
        offset = builder.mul(arguments[1], builder.extract_value(array.strides, 0))
        place = builder.gep(builder.bitcast(array.data, byte), [offset])
        fetch = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(ir.VoidType(), [byte, number, number, number]), "llvm.prefetch.p0i8"
        )
        builder.call(fetch, [place, number(READ), number(KEEP), number(DATA)])
        return context.get_dummy_value()

    return types.void(array, types.intp), lower


class Entry:
    """A compiled function as kernels are handed it, and call it: by its address, whatever function it is. From Python it is the
    function itself."""

    def __init__(self, function, compiled):
        self.function, self._numba_type_ = function, EntryType(compiled.signature)
        engine = compiled.library.codegen._engine  # which knows code from disk, too
        self.address = engine.get_function_address(compiled.fndesc.llvm_func_name)

    def __call__(self, *arguments):
        return self.function(*arguments)


class EntryType(types.Callable):
    """All functions of one signature."""

    def __init__(self, signature):
        self.signature = signature
        super().__init__(f"Entry({signature})")

    def get_call_type(self, context, args, kws):
        return self.signature.replace(recvr=self)

    def get_call_signatures(self):
        return [self.signature], False

    def get_impl_key(self, signature):
        return EntryType


@register_model(EntryType)
class _EntryModel(models.OpaqueModel):
    """An address."""


@unbox(EntryType)
def _unbox(type_, entry, c):
    address = c.pyapi.object_getattr_string(entry, "address")
    value = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(value)


@lower_builtin(EntryType, types.VarArg(types.Any))
def _call(context, builder, signature, arguments):
    own = signature.args[0].signature
    pointer = builder.bitcast(arguments[0], context.call_conv.get_function_type(own.return_type, own.args).as_pointer())
    _, result = context.call_conv.call_function(builder, pointer, own.return_type, own.args, arguments[1:])
    return result
