"""Geometry of universal files: nodes (datasets 15 and 2411) and trace lines (dataset 82)."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.files.formats.universal.datasets import Dataset, datasets, length_unit

_NODES, _LINES, _UNITS = (15, 2411), 82, 164


@dataclass(frozen=True, eq=False, kw_only=True)
class Geometry:
    """Nodes, and lines to draw through them."""

    nodes: dict[int, tuple[float, float, float]]  #: number -> position [m]
    lines: tuple[tuple[int, ...], ...]  #: numbers of nodes, two or more each


def read_geometry(path: Path) -> Geometry | None:
    """Read nodes and trace lines; None if the file has no nodes.

    Positions are taken as those of the global Cartesian system.

    Raises
    ------
    DataError
        Naming the file, and the dataset that is wrong.
    """
    sets = datasets(path, (*_NODES, _LINES, _UNITS))
    length = length_unit(path, sets)
    nodes = {number: at for k, s in sets if s["type"] in _NODES for number, at in _nodes(path, k, s, length)}
    if not nodes:
        return None
    lines = [line for k, s in sets if s["type"] == _LINES for line in _lines(path, k, s, nodes)]
    return Geometry(nodes=nodes, lines=tuple(lines))


def _nodes(path: Path, number: int, one: Dataset, length: float) -> Iterator[tuple[int, tuple[float, float, float]]]:
    columns = [np.asarray(one[name], np.float64) for name in ("node_nums", "x", "y", "z")]
    if len({len(column) for column in columns}) > 1 or not np.isfinite(np.concatenate(columns)).all():
        raise DataError(path, f"dataset {number}: expected a number and three finite coordinates per node")
    for node, x, y, z in zip(*(column.tolist() for column in columns), strict=True):
        yield int(node), (x / length, y / length, z / length)


def _lines(path: Path, number: int, one: Dataset, nodes: Collection[int]) -> Iterator[tuple[int, ...]]:
    """Yield the pieces of a trace line: a zero lifts the pen."""
    piece: list[int] = []
    for node in [*np.asarray(one["nodes"], np.float64).tolist(), 0]:
        if node and node not in nodes:
            raise DataError(path, f"dataset {number}: node {node:g} of the trace line is not among the nodes")
        if node:
            piece.append(int(node))
            continue
        if len(piece) > 1:
            yield tuple(piece)
        piece = []
