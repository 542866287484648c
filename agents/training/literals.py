"""`policy_kwargs` as RL-Zoo's files have them, Python in a string, read without running it."""

from __future__ import annotations

import ast
import importlib
from typing import Any

import torch

from agents import features

ACTIVATIONS = ("ReLU", "Tanh", "ELU", "GELU", "LeakyReLU", "SiLU")

_OBJECTS: dict[str, Any] = {
    **{f"{torch_nn}.{name}": getattr(torch.nn, name) for torch_nn in ("nn", "th.nn") for name in ACTIVATIONS},
    **{
        f"importlib.import_module('agents.features').{name}": getattr(features, name)
        for name in ("RelativeFeatures", "SmallCnn")
    },
}
"""What such a string may name, by how it is written."""


def read_kwargs(text: str, trust: bool = False) -> Any:
    """What `dict(net_arch=[64, 64], activation_fn=nn.ReLU)` says.

    Args:
        text: numbers, strings, True, False, None, lists, tuples, dicts, `dict(...)`, and what `_OBJECTS` names.
        trust: run it as Python, where it is more than that.

    Raises:
        ValueError: it is more than that, and not trusted; or no Python at all.
    """
    try:
        return _value(ast.parse(text.strip(), mode="eval").body)
    except (ValueError, SyntaxError, RecursionError, MemoryError) as error:
        if not trust:
            raise ValueError(
                f"policy_kwargs must be dict(...) of plain values and of {', '.join(_OBJECTS)}; got {error}. Anything "
                "else is code: run it with --trust if you trust whoever wrote the file"
            ) from error
    return eval(text, {"nn": torch.nn, "th": torch, "importlib": importlib})


def _value(node: ast.expr) -> Any:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "dict" and not node.args:
        if all(word.arg is not None for word in node.keywords):
            return {word.arg: _value(word.value) for word in node.keywords}
    elif isinstance(node, ast.List):
        return [_value(part) for part in node.elts]
    elif isinstance(node, ast.Tuple):
        return tuple(_value(part) for part in node.elts)
    elif isinstance(node, ast.Dict) and all(key is not None for key in node.keys):
        return {ast.literal_eval(key): _value(part) for key, part in zip(node.keys, node.values, strict=True) if key}
    elif isinstance(node, (ast.Constant, ast.UnaryOp)):
        return ast.literal_eval(node)
    elif ast.unparse(node) in _OBJECTS:
        return _OBJECTS[ast.unparse(node)]
    raise ValueError(ast.unparse(node))
