"""Nodes and elements in the input and result files of other programs: positions, and faces of shells and solids."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from daq import FloatArray, IntArray
from updater.errors import StructureError
from updater.fe.external.programs.coordinates import GridPoints
from updater.fe.external.programs.nastran import bulk_cards
from updater.fe.external.programs.numbers import MAX_ROWS, SCALAR, Row, read_text

Point = tuple[float, float, float]
#: corners of the faces of solids, by the number of their corners
_SOLID = {
    4: ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)),
    6: ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (0, 2, 5, 3)),
    8: ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}
#: corners of elements by the beginning of their name in Abaqus and CalculiX: shells, then solids
_ABAQUS = {
    **dict.fromkeys(("S3", "STRI3", "CPS3", "STRI65", "S6"), (3, False)),
    **dict.fromkeys(("S4", "S8", "CPS4", "CPS8", "M3D4"), (4, False)),
    **dict.fromkeys(("C3D4", "C3D10"), (4, True)),
    **dict.fromkeys(("C3D6", "C3D15"), (6, True)),
    **dict.fromkeys(("C3D8", "C3D20"), (8, True)),
}
_NASTRAN = {
    **dict.fromkeys(("CTRIA3", "CTRIA6", "CTRIAR"), (3, False)),
    **dict.fromkeys(("CQUAD4", "CQUAD8", "CQUADR"), (4, False)),
    "CTETRA": (4, True),
    "CPENTA": (6, True),
    "CHEXA": (8, True),
}


@dataclass(frozen=True)
class FileMesh:
    """Nodes of a file, and the corners of its faces."""

    nodes: dict[int, Point]  #: by number, in the file's unit of length
    shells: list[tuple[int, ...]] = field(default_factory=list)  #: corners of each triangle or quadrilateral
    solids: list[tuple[int, ...]] = field(default_factory=list)  #: corners of each solid
    scalars: list[int] = field(default_factory=list)  #: numbers of the scalar points of Nastran
    axes: Mapping[int, FloatArray] = field(default_factory=dict)  #: (3, 3) axes of displacements that are not x, y, z

    def rows(self) -> tuple[Row, ...]:
        """Return the rows of all points by their numbers: six per node, one per scalar point."""
        axes = dict.fromkeys(self.nodes, range(6)) | dict.fromkeys(self.scalars, range(SCALAR, SCALAR + 1))
        return tuple((point, axis) for point in sorted(axes) for axis in axes[point])

    def faces(self, number: dict[int, int]) -> IntArray:
        """Return the corners (n_faces, 4) of shells and of the surface of solids, -1 as the last of a triangle.

        Parameters
        ----------
        number : index of each node that is used
        """
        sides = [tuple(solid[k] for k in side) for solid in self.solids for side in _SOLID[len(solid)]]
        times = Counter(frozenset(side) for side in sides)
        every = self.shells + [side for side in sides if times[frozenset(side)] == 1]
        found = [[*(number[node] for node in face), -1][:4] for face in every if all(node in number for node in face)]
        return np.array(found, np.int32).reshape(-1, 4)


def read_mesh(path: Path) -> FileMesh:
    """Read nodes and elements: input file (.inp; .bdf, .dat, .nas), result of CalculiX (.frd) or table of nodes.

    A table has the number of the node and x, y, z per line; other lines are left out, as in a listing.

    Raises
    ------
    StructureError
        If there is no node, or a node is not three finite numbers.
    """
    lines = read_text(path).splitlines()
    kind = path.suffix.lower()
    try:
        if kind == ".inp":
            found = _abaqus(lines)
        elif kind in (".bdf", ".dat", ".nas"):
            found = _nastran(lines)
        elif kind == ".frd":
            found = FileMesh(dict(_frd(lines)))
        else:
            found = FileMesh(dict(_table(lines)))
    except (ValueError, IndexError) as error:
        raise StructureError(path, f"no nodes can be read: {error}") from error
    wrong = next((node for node, place in found.nodes.items() if not np.isfinite(place).all()), None)
    if not found.nodes or wrong is not None:
        raise StructureError(path, "no nodes can be read" + ("" if wrong is None else f": node {wrong} is not finite"))
    return found


def _table(lines: Sequence[str]) -> Iterator[tuple[int, Point]]:
    for line in lines:
        words = line.replace(",", " ").replace(";", " ").split()
        if len(words) >= 4 and words[0].isdecimal():
            yield int(words[0]), _point(words[1:4])


def _frd(lines: Sequence[str]) -> Iterator[tuple[int, Point]]:
    """Yield the nodes of the block 2C: -1, number in 10 columns, three numbers in 12 each."""
    inside = False
    for line in lines:
        if line.startswith("    2C"):
            inside = True
        elif line.startswith(" -3"):
            inside = False
        elif inside and line.startswith(" -1"):
            yield int(line[3:13]), _point([line[13 + 12 * k : 25 + 12 * k] for k in range(3)])


def _abaqus(lines: Sequence[str]) -> FileMesh:
    found = FileMesh({})
    keyword, options, held = "", "", ""
    for line in (line.strip() for line in lines):
        if line.startswith("**") or not line:
            continue
        if line.startswith("*"):
            keyword, _, options = line.upper().replace(" ", "").partition(",")
            held = ""
        elif keyword == "*NODE":
            words = [*line.split(","), "0", "0", "0"]
            node, place = int(words[0]), _point([word.strip() or "0" for word in words[1:4]])
            if found.nodes.setdefault(node, place) != place:
                raise ValueError(f"node {node} is at two places, as in several parts: expected a file without parts")
        elif keyword == "*INSTANCE":
            if any(float(word) for word in line.split(",")[:3] if word.strip()):
                raise ValueError("an instance of a part is moved: expected a file without parts")
        elif keyword == "*ELEMENT":
            if line.endswith(","):
                held += line
                continue
            words, held = (held + line).split(","), ""
            _add(found, _kind(options.partition("TYPE=")[2].partition(",")[0], _ABAQUS), words[1:])
    return found


def _kind(name: str, known: dict[str, tuple[int, bool]]) -> tuple[int, bool] | None:
    """Return corners and solidity of an element by the longest known beginning of its name."""
    fitting = [key for key in known if name.startswith(key) and not name[len(key) :][:1].isdecimal()]
    return known[max(fitting, key=len)] if fitting else None


def _add(found: FileMesh, kind: tuple[int, bool] | None, words: Sequence[str]) -> None:
    if kind is None:
        return
    corners = tuple(int(word) for word in words[: kind[0]])
    if len(corners) < kind[0]:
        raise ValueError(f"an element has {len(corners)} nodes, expected {kind[0]}")
    (found.solids if kind[1] else found.shells).append(corners)


def _nastran(lines: Sequence[str]) -> FileMesh:
    """Read GRID, CORD1x, CORD2x and SPOINT cards, shells and solids: free fields, or fields of 8 or 16 columns."""
    found, grids = FileMesh({}), GridPoints()
    for card in bulk_cards(lines):
        name = card[0]
        grids.add(card)
        if name == "SPOINT":
            found.scalars.extend(_scalar_points([word for word in card[1:] if word]))
        elif name in _NASTRAN:
            _add(found, _NASTRAN[name], card[3:])
    found.nodes.update(grids.points())
    return replace(found, axes=grids.directions())


def _scalar_points(words: Sequence[str]) -> Sequence[int]:
    """Return the numbers of a card: a list, or the first and the last one with THRU between."""
    if len(words) == 3 and words[1].upper() == "THRU":
        first, last = int(words[0]), int(words[2])
        if not 0 <= last - first < MAX_ROWS:
            raise ValueError(f"scalar points: expected up to {MAX_ROWS}, found {first} THRU {last}")
        return range(first, last + 1)
    return [int(word) for word in words]


def _point(words: Sequence[str]) -> Point:
    x, y, z = (float(word) for word in words)
    return x, y, z
