"""How numba compiles the functions that a kernel calls: each is optimised once, and is machine code once at most.

numba by itself takes each function for an end: it links in all that the function calls, down to the last, optimises the whole
anew, makes machine code of it and wraps that for Python to call. Here a function that vanishes into its callers is left as it
is for them to optimise; one that stays apart is machine code of its own, which its callers find by its name. Both are kept on disk,
where workers that compile side by side find what another has done.
"""

import gc
from contextlib import contextmanager
from types import SimpleNamespace

from llvmlite import binding as llvm
from llvmlite import ir
from numba.core import cgutils, event, postproc, transforms, typed_passes, types, untyped_passes
from numba.core import ir as numba_ir
from numba.core.codegen import Codegen, JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import PassManager
from numba.core.datamodel import models
from numba.core.extending import NativeValue, intrinsic, register_model, unbox
from numba.core.imputils import lower_builtin
from numba.np import arrayobj
from numba.np.numpy_support import as_dtype

from sim.tree import WIDE

#: Of numba's passes those that our kernels have a use for: they have no closures, no `with`, no expressions of arrays, and nothing to
#: count the references of.
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
    typed_passes.NativeLowering,
    typed_passes.NoPythonBackend,
)
READ, KEEP, DATA = 0, 3, 1  # what llvm.prefetch is told: to read it, to keep it in all caches, and that it is no code
MELTED = "melted"  # the kind of such code on disk, beside numba's kinds


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

    def serialize_using_object_code(self):  # which there is none of: what numba asks for to keep on disk
        return self.name, MELTED, self._final_module.as_bitcode()

    @classmethod
    def unserialize(cls, codegen, name, bitcode):
        code = cls(codegen, name)
        code._final_module, code._finalized = llvm.parse_bitcode(bitcode), True
        return code


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
        with swift():
            return super()._compile_bytecode()


@contextmanager
def swift():
    """Around a kernel and all that it calls, numba does without what kernels have no use for, and the collector does not look time and
    again through what it builds up."""
    if not gc.isenabled():  # by a `swift` around this one
        yield
        return
    theirs = {(owner, name): getattr(owner, name) for owner, name, _ in OURS + AROUND}
    ours = {(owner, name): each for owner, name, each in OURS}
    ours |= {(owner, name): wrap(theirs[owner, name]) for owner, name, wrap in AROUND}
    gc.disable()
    for place, each in ours.items():
        setattr(*place, each)
    try:
        yield
    finally:
        for place, each in theirs.items():
            setattr(*place, each)
        gc.enable()


def remembering(find):
    """What numba found out once it need not find out again: whether, say, floats can be added, it would ask all that it can add."""
    known = {}

    def remembered(function, context, arguments, keywords):
        if keywords:
            return find(function, context, arguments, keywords)
        key = function, arguments
        if key not in known:
            known[key] = find(function, context, arguments, keywords)
        return known[key]

    return remembered


def unserializing(unserialize):
    """Code that vanishes into its callers comes from disk as such."""

    def unserialized(codegen, state):
        name, kind, data = state
        return MeltedCode.unserialize(codegen, name, data) if kind == MELTED else unserialize(codegen, state)

    return unserialized


def as_it_is(context, builder, kind, index, size):
    """An index, which never counts from the end."""
    return context.cast(builder, index, kind, types.intp)


def tidy(processor, emit_dels=False, extend_lifetimes=False):
    """What is left to do after a pass where nobody asks how long variables live."""
    processor.func_ir.blocks = transforms.canonicalize_cfg(processor.func_ir.blocks)
    processor.func_ir.generator_info = None


def variables(statement, value):
    """The variables in a value, as numba finds them; most values are none."""
    if type(value) in NO_VARIABLES:
        return ()
    if isinstance(value, numba_ir.Var):
        return [value]
    if isinstance(value, numba_ir.Inst):
        return value.list_vars()
    if isinstance(value, dict):
        value = value.values()
    elif not isinstance(value, (list, tuple)):
        return ()
    return [variable for each in value for variable in variables(statement, each)]


def argument_type(model):
    """An array as an argument: where its numbers are and its shape, which tells the rest where they lie side by side. numba would hand
    on twice as much; and arrays are most of what kernels hand each other, by the dozen."""
    return tuple(part.get_argument_type() for part in parts(model).values())


def as_argument(model, builder, array):
    return tuple(part.as_argument(builder, model.get(builder, array, name)) for name, part in parts(model).items())


def from_argument(model, builder, values):
    known = {name: part.from_argument(builder, value) for (name, part), value in zip(parts(model).items(), values)}
    size, count = (ir.Constant(ir.IntType(64), n) for n in (as_dtype(model.fe_type.dtype).itemsize, 1))
    strides = []
    for length in reversed(cgutils.unpack_tuple(builder, known["shape"])):
        strides.insert(0, builder.mul(count, size))
        count = builder.mul(count, length)
    known = {"nitems": count, "itemsize": size, "strides": cgutils.pack_array(builder, strides)} | known
    array = cgutils.get_null_value(model.get_value_type())
    for name, value in known.items():
        array = model.set(builder, array, value, name)
    return array


def parts(model):
    """What is handed on of an array; nobody counts references to it."""
    names = ("data", "shape") if model.fe_type.layout == "C" else ("data", "shape", "strides")
    return {name: model.get_model(model.get_field_position(name)) for name in names}


def unheard(happened):
    """Nobody listens to how long numba takes for what."""


NO_VARIABLES = {str, int, float, bool, type(None), numba_ir.Loc}
#: What is otherwise while a kernel is compiled: ours instead of theirs, and ours around theirs.
OURS = (
    (arrayobj, "fix_integer_index", as_it_is),
    (postproc.PostProcessor, "run", tidy),
    (numba_ir.Inst, "_rec_list_vars", variables),
    (event, "broadcast", unheard),
    (models.ArrayModel, "get_argument_type", argument_type),
    (models.ArrayModel, "as_argument", as_argument),
    (models.ArrayModel, "from_argument", from_argument),
)
AROUND = (
    (types.BaseFunction, "get_call_type", remembering),
    (Codegen, "unserialize_library", unserializing),
)


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
def prefetch(typing, array, place):
    """`sim.instructions.prefetch` as the processor's instruction."""

    def lower(context, builder, signature, arguments):
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        array = arrayobj.make_array(signature.args[0])(context, builder, arguments[0])
        offset = builder.mul(arguments[1], builder.extract_value(array.strides, 0))
        start = builder.gep(builder.bitcast(array.data, byte), [offset])
        fetch = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(ir.VoidType(), [byte, number, number, number]), "llvm.prefetch.p0i8"
        )
        builder.call(fetch, [start, number(READ), number(KEEP), number(DATA)])
        return context.get_dummy_value()

    return types.void(array, types.intp), lower


@intrinsic
def lowest_bit(typing, mask):
    """`sim.instructions.lowest_bit` as the processor's instruction."""

    def lower(context, builder, signature, arguments):
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return mask(mask), lower


@intrinsic
def no_later(typing, times, place):
    """`sim.instructions.no_later` by vector instructions."""

    def lower(context, builder, signature, arguments):
        array = arrayobj.make_array(signature.args[0])(context, builder, arguments[0])
        lanes = ir.VectorType(ir.FloatType(), WIDE)
        place = builder.bitcast(builder.gep(array.data, [arguments[1]]), lanes.as_pointer())
        begin, end = (builder.load(builder.gep(place, [ir.Constant(ir.IntType(32), k)]), align=4) for k in (0, 1))
        bits = builder.bitcast(builder.fcmp_ordered("<=", begin, end), ir.IntType(WIDE))
        return builder.zext(bits, ir.IntType(64))

    return types.int64(times, types.int64), lower


@intrinsic
def fma(typing, a, b, c):
    """`sim.instructions.fma` as the processor's instruction."""

    kind = types.float32 if a == b == c == types.float32 else types.float64

    def lower(context, builder, signature, arguments):
        return builder.fma(*(context.cast(builder, each, of, kind) for each, of in zip(arguments, signature.args)))

    return kind(a, b, c), lower


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
