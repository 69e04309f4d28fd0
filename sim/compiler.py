"""How numba compiles the functions that a kernel calls: each is optimised once, and is machine code once at most.

numba by itself takes each function for an end: it links in all that the function calls, down to the last, optimises the whole
anew, makes machine code of it and wraps that for Python to call. Here a function that vanishes into its callers is left as it
is for them to optimise; one that stays apart is machine code of its own, which its callers find by its name.
"""

from types import SimpleNamespace

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class MeltedCode(JITCodeLibrary):
    """Code that is nothing by itself, only something to link."""

    codegen = SimpleNamespace(set_env=lambda *_: None)  # which numba would do in the machine code

    def _optimize_final_module(self):
        pass

    def _finalize_final_module(self):
        self._finalized = True


class CodeApart(JITCodeLibrary):
    """Machine code, of which there is nothing to link."""

    def finalize(self):
        super().finalize()
        self._shared_module = JITCodeLibrary(self._codegen, self.name)._final_module  # empty


class Melt(Compiler):
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
