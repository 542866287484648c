"""Compiled functions as other compiled functions see them: parts, which are linked into what Python calls.

Numba makes machine code of every function, with all that it calls in it, although most functions here are only called
by others, whose machine code contains them once more. So compiling takes longer with every level of calls. A `Part` is
never translated: its callers link it into what Python calls, and of that alone machine code is made.

Besides, numba asks the same questions over and over while it compiles, such as what a float times a float is, and
looks for things that no function here has. Parts remember the answers and leave out the search.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ClassVar

import numba
from numba.core import codegen, compiler, typed_passes, types, typing, untyped_passes

_NEEDLESS = (untyped_passes.InlineClosureLikes, typed_passes.InlineOverloads, typed_passes.NopythonRewrites)
"""Passes of numba's that look for closures, for functions to be inlined before LLVM, and for arithmetic on arrays."""


class _Library(codegen.JITCodeLibrary):
    """LLVM's code of a part, never translated; what is inlined anyway is not even optimised before."""

    def __init__(self, target: Any, inlined: bool) -> None:
        super().__init__(target.codegen(), "part")
        self._inlined = inlined

    def _optimize_final_module(self) -> None:
        if not self._inlined:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _TypingContext(typing.Context):
    """Numba's typing context, which remembers what functions that are not ours return for arguments of given types."""

    _known: ClassVar[dict[Any, Any]] = {}

    def __init__(self, context: Any) -> None:
        self.__dict__ = context.__dict__

    def resolve_function_type(self, function: Any, arguments: Any, named: Any) -> Any:
        # "static_getitem" and the like come with values beside the types.
        if named or isinstance(function, (types.Dispatcher, str)):
            return super().resolve_function_type(function, arguments, named)
        question = function, arguments
        answer = self._known.get(question)
        if answer is None:
            answer = self._known[question] = super().resolve_function_type(function, arguments, named)
        return answer


class _Compiler(compiler.Compiler):
    """Compiles a part."""

    def __init__(
        self, typing_context: Any, target: Any, library: Any, arguments: Any, result: Any, flags: Any, kinds: Any
    ) -> None:
        library = _Library(target, flags.forceinline)
        super().__init__(_TypingContext(typing_context), target, library, arguments, result, flags, kinds)
        flags.no_compile = True
        target = self.state.targetctx  # a copy of its own
        target.get_abi_sizeof = functools.partial(_size_of, target.target_data)

    def define_pipelines(self) -> Any:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [one for one in pipeline.passes if one[0] not in _NEEDLESS]
        return pipelines


@functools.cache
def _size_of(target_data: Any, kind: Any) -> int:
    """Bytes of a type of LLVM's, which works that out by compiling a module."""
    return kind.get_abi_size(target_data)


class Part:
    """A function as its compiled callers see it.

    For compiled callers, numba compiles a function once more for each constant that is given to it. Constants reach
    parts where these are inlined, so that one for all numbers is enough.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        made: Any = numba.njit(function, pipeline_class=_Compiler, **options | {"no_cpython_wrapper": True})
        self._dispatcher = made
        self._dispatcher.add_overload = self._add

    def _add(self, result: Any) -> None:
        """Keep what came of compiling the part for one set of types, for callers to be found by its description."""
        result.target_context.insert_user_function(result.fndesc, result.fndesc, [result.library])
        self._dispatcher.overloads[tuple(result.signature.args)] = result

    def get_call_template(self, given: Any, named: Any) -> Any:
        """What numba asks a dispatcher for when it infers the type of a call."""
        named = {name: types.unliteral(kind) for name, kind in named.items()}
        return self._dispatcher.get_call_template(tuple(map(types.unliteral, given)), named)

    def get_overload(self, arguments: Any) -> Any:
        """What numba asks a dispatcher for when it writes a call down."""
        return self._dispatcher.overloads[tuple(arguments)].fndesc
