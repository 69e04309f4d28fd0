"""From plain Python to compiled kernels: with `sim.compiler` everything that knows numba.

The kernels of `sim` are plain functions that call each other by name. `bind` rebuilds such a function with some of the names
in its call tree bound to other things (`step` to a method's, a count to a constant) and compiles it. A kernel specialised
that way is as fast as one written by hand and, unlike a closure, numba can keep it on disk.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from types import FunctionType
from typing import Any

from sim.instructions import fma, lowest_bit, no_later, prefetch


@cache
def numba():
    """numba, set up to keep its code in a folder of its own for each version of these sources.

    numba looks for changes in the file of the cached function only, not in those it calls, hence the hash over all.
    """
    import numba
    from numba.core.codegen import get_host_cpu_features

    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "carom"
    try:
        home.mkdir(parents=True, exist_ok=True)
        writable = os.access(home, os.W_OK)
    except OSError:
        writable = False
    if not writable:
        home = Path(tempfile.gettempdir()) / f"carom-{os.getuid()}"
    numba.config.CACHE_DIR = str(home / digest.hexdigest()[:16])
    features = get_host_cpu_features()
    # LLVM keeps to half of registers of 512 bits: the first processors with them ran slower with all, those with this feature hardly do
    if "+avx512vbmi2" in features and numba.config.CPU_NAME is None and numba.config.CPU_FEATURES is None:
        numba.config.CPU_FEATURES = f"{features},-prefer-256-bit"
    return numba


@cache
def bind(function: Callable, compiled: bool = True, **names: Any) -> Callable:
    """`function` with the global `names` of its whole call tree bound to the values given; all must be hashable.

    With `compiled` False the plain Python function, for oracles and for reading tracebacks.
    """
    return _rebuild(function, tuple(sorted(names.items())), compiled, inner=False)


def entry(function: Callable, like: tuple, **names: Any) -> Callable:
    """`function` with `names` bound, compiled, as an argument for kernels, which they call: compiled once, they call any of them.

    `like` are arguments of the types that it is called with.
    """
    from sim.compiler import Entry

    names = tuple(sorted(names.items()))
    kernel = _rebuild(function, _used(function, names), compiled=True)
    arguments = tuple(numba().typeof(each) for each in like)
    kernel.compile(arguments)
    return Entry(_rebuild(function, names, compiled=False), kernel.overloads[arguments])


def typed(values: tuple) -> tuple:
    """Values of a named tuple that knows its type: to find out that of entries numba takes as long as a short flight, each time."""
    kind, known = type(values), numba().typeof(values)
    typed = type(kind.__name__, (kind,), {"_numba_type_": known})
    numba().extending.typeof_impl.register(typed)(lambda value, context: known)
    return typed(*values)


@cache
def _rebuild(function: Callable, names: tuple, compiled: bool, inner: bool = True) -> Callable:
    if compiled and function in (fma, lowest_bit, no_later, prefetch):
        from sim import compiler

        return getattr(compiler, function.__name__)
    bound, globals_ = dict(names), dict(function.__globals__)
    for name in function.__code__.co_names:
        value = bound.get(name, globals_.get(name))
        if _is_kernel(value):
            value = _rebuild(value, _used(value, names), compiled)
        if name in globals_:
            globals_[name] = value
    rebuilt = FunctionType(function.__code__, globals_, function.__name__, function.__defaults__)
    if not compiled:
        return rebuilt
    rebuilt.__module__ = function.__module__
    # The name tells numba's files apart: two kernels of one name would be served each other's code.
    bindings = ", ".join([*(f"{name}={_label(value)}" for name, value in names), "" if inner else "for Python to call"])
    rebuilt.__qualname__ = f"{function.__name__}_{hashlib.sha256(bindings.encode()).hexdigest()[:16]}"
    # Without numba's runtime: kernels make no arrays, and to count references to those they hand on costs more than they do. What is
    # said of `fastmath` and `forceinline` a function would have from its caller, and both are in its name: code on disk would call it
    # by one name, and find it compiled for another caller by another.
    njit = partial(numba().njit, error_model="numpy", fastmath=False, _nrt=False, no_cfunc_wrapper=True)
    from sim.compiler import Melt, Plain, SetApart

    if not inner:  # released, so that threads move the balls of one run at once
        return njit(cache=True, forceinline=False, pipeline_class=Plain, nogil=True)(rebuilt)
    njit = partial(njit, no_cpython_wrapper=True)
    if _melts(function):
        return _widened(njit(forceinline=True, pipeline_class=Melt)(rebuilt))
    return _widened(njit(cache=True, forceinline=False, pipeline_class=SetApart)(rebuilt), (function, names))


def _widened(kernel: Any, apart: tuple = ()) -> Any:
    """The kernel, compiled once for all integers: numba compiles it anew for a 0 and a 1 written in a call, to no gain.

    What stays `apart` of it, a function and its names, is loaded before any code from disk that calls it; what melts is looked for
    on disk once it is called for: another worker may have compiled it.
    """
    from numba.core.types import unliteral

    template, look_on_disk = kernel.get_call_template, cache(kernel.enable_caching)

    def resolve(args, kws):
        if not apart:
            look_on_disk()
        args = tuple(unliteral(a) for a in args)
        found = template(args, kws)
        compiled = kernel.overloads[args]
        compiled.library._reload_init = {partial(_load, *apart, args)} if apart else set(compiled.reload_init)
        return found

    kernel.get_call_template = resolve
    return kernel


def _load(function: Callable, names: tuple, args: tuple) -> None:
    """Have a function that stays apart ready, for arguments of the types `args`."""
    _rebuild(function, names, compiled=True).compile(args)


def _used(function: Callable, names: tuple) -> tuple:
    """Those of `names` that occur in the call tree of `function`: what it shares with no other it compiles only once."""
    bound, seen, todo = dict(names), set(), [function]
    while todo:
        f = todo.pop()
        for name in f.__code__.co_names:
            value = bound.get(name, f.__globals__.get(name))
            if (f, name) not in seen and _is_kernel(value):
                todo.append(value)
            seen.add((f, name))
    return tuple((name, value) for name, value in names if any(name == used for _, used in seen))


def _is_kernel(value: Any) -> bool:
    return isinstance(value, FunctionType) and value.__module__.startswith("sim.")


#: Kernels that stay functions of their own: too large to vanish, or seldom called.
LARGE = {
    *("advance", "travel", "fly", "strike", "hop", "look", "reckon", "calm", "check", "onward", "response", "touch_edge", "beside"),
    *("onto_face", "onto_edge", "count_along", "load_contacts", "save_contacts", "slide_around", "turn", "arc", "passes_out"),
    *("slides_off", "curves", "reaches_end", "renewed", "reaction", "pressing", "pressed", "put_on", "meets", "stays_off"),
    *("coast", "take", "march", "step_in", "commit"),
    *("ashore", "finish_search", "lies_on", "next_crossing", "falls_back", "majorant.fall", "falls_again", "off_face"),
}


def _melts(function: Callable) -> bool:
    """Whether calls must vanish into the caller: the loop over lanes vectorises only so, and to hand arrays and tuples to a
    function costs more than most of them compute."""
    names = {function.__name__, f"{function.__module__.rpartition('.')[2]}.{function.__name__}"}
    return not names & LARGE and not function.__module__.startswith(("sim.advance", "sim.contact"))


def _label(value: Any) -> str:
    return f"{value.__module__}.{value.__name__}" if _is_kernel(value) else str(value)
