"""A graph of ONNX under construction, and columns of it that compute like numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

OPSET, IR_VERSION = 13, 7
"""Versions of the operators and of the format: of 2020, so that old runtimes read the files too."""


class Graph:
    """The nodes and the constants of a graph."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, name: str, value: Any) -> str:
        """Add a constant. Return its name."""
        from onnx import numpy_helper

        self.constants.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    def add(self, kind: str, *inputs: str, outputs: tuple[str, ...] = (), **attributes: Any) -> str:
        """Add a node of an operator. Return the name of its first output."""
        from onnx import helper

        outputs = outputs or (f"{kind.lower()}_{len(self.nodes)}",)
        self.nodes.append(helper.make_node(kind, list(inputs), list(outputs), **attributes))
        return outputs[0]

    def columns(self, values: str, number: int) -> list[Column]:
        """Split an array (N, number) into its columns, in double precision."""
        from onnx import TensorProto

        names = tuple(f"column_{k}" for k in range(number))
        self.add("Split", self.add("Cast", values, to=TensorProto.DOUBLE), outputs=names, axis=1)
        return [Column(self, name) for name in names]


class Column:
    """A column of numbers (N, 1) in double precision. What is computed with it becomes a node of its graph."""

    def __init__(self, graph: Graph, name: str) -> None:
        self.graph, self.name = graph, name

    def _new(self, kind: str, *parts: Column | float) -> Column:
        names = [part.name if isinstance(part, Column) else self._number(part) for part in parts]
        return Column(self.graph, self.graph.add(kind, *names))

    def _number(self, value: float) -> str:
        return self.graph.constant(f"number_{len(self.graph.constants)}", np.float64(value))

    def __add__(self, other: Column | float) -> Column:
        return self._new("Add", self, other)

    def __radd__(self, other: float) -> Column:
        return self._new("Add", other, self)

    def __sub__(self, other: Column | float) -> Column:
        return self._new("Sub", self, other)

    def __rsub__(self, other: float) -> Column:
        return self._new("Sub", other, self)

    def __mul__(self, other: Column | float) -> Column:
        return self._new("Mul", self, other)

    def __rmul__(self, other: float) -> Column:
        return self._new("Mul", other, self)

    def __truediv__(self, other: Column | float) -> Column:
        return self._new("Div", self, other)

    def __rtruediv__(self, other: float) -> Column:
        return self._new("Div", other, self)

    def __neg__(self) -> Column:
        return self._new("Neg", self)

    def __abs__(self) -> Column:
        return self._new("Abs", self)

    def sqrt(self) -> Column:
        """The square root, which `np.sqrt` takes from here."""
        return self._new("Sqrt", self)
