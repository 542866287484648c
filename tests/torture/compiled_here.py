"""Compiling as the package does, for code outside of it that calls the package's functions."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config

from airhockey_env import compiled

_files: set[Path] = set()
"""Those that hold compiled functions, as far as they are imported."""


def _sources_hash() -> str:
    """Hash of what the machine code was compiled from: these files and the package."""
    digest = hashlib.sha256(compiled.sources_hash().encode())
    for path in sorted(_files):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _keyed_to_sources(locator: type) -> type:
    return type(locator.__name__, (locator,), {"get_source_stamp": lambda self: _sources_hash()})


def _locators() -> list[type]:
    return [_keyed_to_sources(locator) for locator in compiled._locators()]


class _CacheImpl(compiled._CacheImpl):
    _locator_classes: Any = _locators()


class _Cache(compiled._Cache):
    _impl_class = _CacheImpl


def compiled_here(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function with numba, cached on disk."""
    _files.add(Path(function.__code__.co_filename))
    dispatcher: Any = numba.njit(function, nogil=True, error_model="numpy")
    if not config.DISABLE_JIT:  # type: ignore[attr-defined]
        dispatcher._cache = _Cache(function)
    return dispatcher
