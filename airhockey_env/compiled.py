"""The one way in which this package compiles: numba, cached on disk, never stale.

numba's own `cache=True` looks only at the file that a function stands in, so after a change to a callee in
another file (or an upgrade) its callers would go on running old machine code. Here the cache is keyed to a hash of
all sources of the package, whose functions call each other across files.

The cache lies in the `__pycache__` folders beside the sources or, where these are read-only, in numba's user-wide
cache folder; `NUMBA_CACHE_DIR` moves it and `NUMBA_DISABLE_JIT=1` runs everything as plain Python.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import caching, config, types
from numpy.typing import NDArray

PLAIN_ROOMS = ("live", "web")
"""Folders of the package in which nothing is compiled: a change in them leaves the cache valid."""


@functools.cache
def sources_hash() -> str:
    """Hash of the package's Python files outside `PLAIN_ROOMS`: what the machine code was compiled from."""
    digest = hashlib.sha256()
    root = Path(__file__).parent
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] in PLAIN_ROOMS:
            continue
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _keyed_to_sources(locator: type) -> type:
    """A cache locator that takes the whole package, not one file, as the source of a function."""
    return type(locator.__name__, (locator,), {"get_source_stamp": lambda self: sources_hash()})


def records(length: int | tuple[int, ...], dtype: np.dtype) -> NDArray[np.void]:
    """Zeroed records for compiled code.

    As plain Python (with NUMBA_DISABLE_JIT=1) that code needs the attributes of a recarray; numba knows them anyway,
    and takes four times as long to look at a recarray as to play a step.
    """
    array = np.zeros(length, dtype)
    return array.view(np.recarray) if config.DISABLE_JIT else array  # type: ignore[attr-defined]


def _locators() -> list[type]:
    """The places where numba looks for a cache; in its older versions their names begin with an underscore."""
    names = ("UserProvidedCacheLocator", "InTreeCacheLocator", "UserWideCacheLocator")
    return [_keyed_to_sources(getattr(caching, name, None) or getattr(caching, f"_{name}")) for name in names]


@functools.cache  # once in a process
def _say_that_it_takes_a_while() -> None:
    """Tell who sits in front of a terminal why nothing happens."""
    with contextlib.suppress(Exception):  # whatever stands in for a terminal
        if sys.stderr.isatty():
            print("airhockey_env: compiling, which takes up to half a minute, once; then it is cached", file=sys.stderr)


class _CacheImpl(caching.CompileResultCacheImpl):
    _locator_classes: Any = _locators()


class _Cache(caching.FunctionCache):
    """A cache that is no more than a cache: what cannot be read (a damaged file, say) is compiled and written again."""

    _impl_class = _CacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        code = None
        try:
            code = super().load_overload(sig, target_context)
        except Exception:  # whatever unpickling a bad file raises
            self.flush()
        if code is None:
            _say_that_it_takes_a_while()
        return code

    def save_overload(self, sig: Any, data: Any) -> None:
        with contextlib.suppress(OSError):  # a full disk, say
            super().save_overload(sig, data)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function with numba: no fast-math (bits must repeat), without the GIL, cached on disk."""
    return _compile(function)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Like `compiled`, for small parts of the hot path: the machine code is always put into the caller's.

    Passing arrays and records through a call costs more than what such a part does.
    """
    return _compile(function, forceinline=True)


def machine_code(function: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """A compiled function for arguments of the types of these ones.

    Numba looks at the types of all arguments in every call, which takes longer than a step of one table. What this
    returns does not: it must be called with arguments of the same types and layouts, and takes read-only arrays too.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    dispatcher: Any = function
    return dispatcher.compile(tuple(map(numba.typeof, arguments)))


def _compile(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """A dispatcher for callers in Python; what compiled callers see is another one behind it.

    For callers in Python, numba wraps every function in two others, which takes longer to compile than most functions
    do; and for compiled ones, it compiles a function once more for each constant that is given to it. Few functions are
    called from Python, and constants reach the others where these are inlined.
    """
    jit: Any = functools.partial(numba.njit, function, nogil=True, error_model="numpy", **options)
    dispatcher = jit()
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return dispatcher
    inner = jit(no_cpython_wrapper=True, no_cfunc_wrapper=True)
    dispatcher.get_overload = inner.get_overload
    dispatcher.get_call_template = lambda given, named: inner.get_call_template(
        tuple(map(types.unliteral, given)), {name: types.unliteral(kind) for name, kind in named.items()}
    )
    dispatcher.compile = _without_garbage_collection(dispatcher.compile)
    with contextlib.suppress(RuntimeError):  # no folder to write to: compile in every process
        dispatcher._cache = _Cache(function)
    return dispatcher


def _without_garbage_collection(work: Callable[..., Any]) -> Callable[..., Any]:
    """Compiling makes many objects and hardly any garbage, and looking for it takes a tenth of the time."""

    def uninterrupted(*arguments: Any) -> Any:
        collecting = gc.isenabled()
        gc.disable()
        try:
            return work(*arguments)
        finally:
            if collecting:
                gc.enable()

    return uninterrupted
