"""Positions in space, and viewpoints on them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from monitor.results.windows import ReferenceResult
from updater.quantities import vector
from updater.structure import NamedPlaces

FIELD_OF_VIEW = np.radians(55.0)  # vertical, of the viewer's eye
RIB = 0.035  #: of the structure's size: half the length of a line across a member, which shows its torsion
RIBS_APART = 0.05  #: of the structure's size: least distance of two of them
_LEVEL = 1e-6  # m: ends no higher than the lowest
_HELD = 1e-9  # largest displacement in any mode of a node that a support holds, as a share of the mode's largest


@dataclass(frozen=True, eq=False, kw_only=True)
class Eye:
    """A place to look from."""

    position: FloatArray  #: (3,) [m]
    target: FloatArray  #: (3,) [m]


class Geometry:
    """Nodes and members of a reference, with a length to draw by and a side to look from; z is up.

    Parameters
    ----------
    reference : of any structure
    """

    def __init__(self, reference: ReferenceResult) -> None:
        self.nodes: FloatArray = np.array(reference.nodes, float)
        self.lines: dict[str, IndexArray] = {k: np.array(v, np.intp) for k, v in reference.lines.items()}
        self.extent: FloatArray = np.ptp(self.nodes, axis=0)
        self.size = float(np.linalg.norm(self.extent)) or 1.0
        self.centre: FloatArray = (self.nodes.min(0) + self.nodes.max(0)) / 2
        self.held = _held(reference)
        self._sensors = {channel: place for channel, (place, _) in reference.sensors.items()}

    @property
    def names(self) -> NamedPlaces:
        """Names of places."""
        at = [vector(node) for node in self.nodes]
        return NamedPlaces(
            members={name: (at[line[0]], at[line[-1]]) for name, line in self.lines.items()},
            supports=[at[node] for node in self.held.tolist()],
            sensors=self._sensors,
        )

    def strips(self, displacement: FloatArray | None = None) -> list[FloatArray]:
        """Return one polyline a member, displaced by (n_nodes, 3) [m]."""
        at = self.nodes if displacement is None else self.nodes + displacement
        return [at[line] for line in self.lines.values()]

    def axis(self, member: str) -> FloatArray:
        """Return the unit vector (3,) from a member's start to its end."""
        first, last = self.nodes[self.lines[member][[0, -1]]]
        return np.asarray((last - first) / np.linalg.norm(last - first))

    def place(self, member: str, position: FloatArray) -> str:
        """Return the place on a member in words: by the global axis that the member runs along, else from its start."""
        along = np.abs(self.axis(member))
        if along.max() > 1 - 1e-6:
            axis = int(np.argmax(along))
            return f"{member} {'xyz'[axis]} {position[axis]:.3f}"
        start = self.nodes[self.lines[member][0]]
        return f"{member}, from its start {np.linalg.norm(position - start):.3f}"

    def side(self, azimuth: float, elevation: float) -> FloatArray:
        """Return the unit vector (3,) towards the viewer.

        Parameters
        ----------
        azimuth : away from facing the structure's broad side [degrees]
        elevation : above the horizon [degrees]
        """
        return side(self.extent, azimuth, elevation)

    def eye(self, towards: FloatArray, points: FloatArray, aspect: float, fill: float) -> Eye:
        """Return the nearest eye that has all points in its picture.

        Parameters
        ----------
        towards : (3,) unit vector from the structure towards the eye
        points : (n, 3) visible points [m]
        aspect : width over height of the picture
        fill : share of the picture to use
        """
        right, up = screen(towards)
        flat = points @ np.column_stack([right, up])
        middle = (flat.min(0) + flat.max(0)) / 2
        target = middle @ np.array([right, up]) + (self.centre @ towards) * towards
        offset = points - target
        slope = np.tan(FIELD_OF_VIEW / 2) * fill * np.array([aspect, 1.0])
        distance = np.abs(offset @ np.column_stack([right, up])) / slope + (offset @ towards)[:, None]
        return Eye(position=target + distance.max() * towards, target=target)


def side(extent: FloatArray, azimuth: float, elevation: float) -> FloatArray:
    """Return the unit vector (3,) towards the viewer of a structure of some extent (3,) [m]; angles as `Geometry`."""
    turn, lift = np.radians([azimuth, elevation])
    broad = np.array([0.0, -1.0, 0.0]) if extent[1] <= extent[0] else np.array([1.0, 0.0, 0.0])
    across = np.cross([0.0, 0.0, 1.0], broad)
    level = np.cos(turn) * broad + np.sin(turn) * across
    return np.asarray(np.cos(lift) * level + [0.0, 0.0, np.sin(lift)])


def flat_aspect(towards: FloatArray, points: FloatArray) -> float:
    """Return width over height of points (n, 3) seen from `towards` (3,)."""
    width, height = np.ptp(points @ np.column_stack(screen(towards)), axis=0)
    return float(width / max(height, 1e-3 * width))


def screen(towards: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the directions right and up of a picture seen from `towards` (3,), z upwards."""
    right = np.cross([0.0, 0.0, 1.0], towards)
    right = right / np.linalg.norm(right)
    return right, np.cross(towards, right)


def _held(reference: ReferenceResult) -> IndexArray:
    """Return the nodes that no mode moves: the supports; the lowest of members' ends if the modes show none.

    Positions of sensors without a model have none.
    """
    if not reference.has_model:
        return np.array([], np.intp)
    shapes = np.array([mode.displacement for mode in reference.modes], float).reshape(-1, len(reference.nodes), 3)
    still = np.flatnonzero(np.abs(shapes).max(axis=(0, 2), initial=0.0) < _HELD) if len(shapes) else np.array([], int)
    if len(still):
        return still
    ends = np.unique([node for nodes in reference.lines.values() for node in (nodes[0], nodes[-1])])
    height = np.array(reference.nodes)[ends, 2]
    return np.asarray(ends[height <= height.min() + _LEVEL], np.intp)


def ribs(
    nodes: FloatArray, spans: Iterable[tuple[int, int]], towards: FloatArray, apart: float
) -> tuple[list[int], FloatArray]:
    """Return nodes some distance apart, and a direction (n, 3) across their member, as seen from a side the longest."""
    at: list[int] = []
    ways: list[FloatArray] = []
    for a, b in spans:
        near = [i for i in at if np.linalg.norm(nodes[i] - nodes[b]) < apart]
        across = np.cross(nodes[b] - nodes[a], towards)
        length = float(np.linalg.norm(across))
        if not near and length > 0:
            at.append(b)
            ways.append(across / length)
    return at, np.array(ways).reshape(-1, 3)
