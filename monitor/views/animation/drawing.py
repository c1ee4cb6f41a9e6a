"""Drawing of an animation: members, ribs that show torsion, sensors, and their motion."""

import numpy as np

from daq import FloatArray
from daq.notebook import number_text
from monitor.views.geometry import side
from oma import ComplexArray, ModalEstimate
from updater.validation import ExpandedShapes

SWAY = 0.12  #: largest displacement drawn, of the structure's size
_SIDE = (32.0, 22.0)  # degrees: azimuth and elevation of the viewer
_RIB = 0.035  # of the structure's size: half the length of a rib
_APART = 0.05  # of the structure's size: least distance of two ribs


class Drawing:
    """Points at rest, their motion in each mode, and the lines between them.

    Parameters
    ----------
    estimate : measured modes
    shapes : their shapes at all nodes
    """

    def __init__(self, estimate: ModalEstimate, shapes: ExpandedShapes) -> None:
        model, nodes = shapes.model, shapes.model.nodes
        extent = np.ptp(nodes, axis=0)
        self.name = model.structure.name
        self.size = float(np.linalg.norm(extent))
        self.centre: FloatArray = (nodes.min(0) + nodes.max(0)) / 2
        self.towards: FloatArray = side(extent, *_SIDE)  #: (3,) towards the viewer
        self.labels = [_label(estimate, k) for k in range(estimate.n_modes)]
        at, way = _ribs(nodes, model.spans, self.towards, _APART * self.size)
        arms = _RIB * self.size * np.concatenate([way, -way])
        owner = np.concatenate([at, at])
        turned = np.cross(shapes.rotation[:, owner], arms)
        self.points: FloatArray = np.concatenate([nodes, nodes[owner] + arms])  #: (n, 3) at rest [m]
        moved = np.concatenate([shapes.translation, shapes.translation[:, owner] + turned], axis=1)
        self.motion: ComplexArray = (SWAY * self.size * moved).astype(np.complex128)  #: (n_modes, n, 3) [m]
        self.spans = [(int(a), int(b)) for a, b in model.spans]  #: pairs of points: members
        self.ribs = [(len(nodes) + i, len(nodes) + len(at) + i) for i in range(len(at))]  #: pairs of points
        places = {s.at for s in model.structure.corrected_sensors if s.channel in estimate.channels}
        self.sensors = sorted({int(np.argmin(np.linalg.norm(nodes - place, axis=1))) for place in places})  #: points

    @property
    def reach(self) -> float:
        """Radius about the centre that holds all motions [m]."""
        farthest = np.linalg.norm(self.points - self.centre, axis=1).max()
        return float(farthest + SWAY * self.size)


def _label(estimate: ModalEstimate, k: int) -> str:
    frequency = number_text(float(estimate.frequency[k]), float(estimate.frequency_std[k]))
    damping = number_text(100 * float(estimate.damping[k]), 100 * float(estimate.damping_std[k]))
    return f"Mode {k + 1}\n{frequency} Hz, {damping} %"


def _ribs(
    nodes: FloatArray, spans: list[tuple[int, int]], towards: FloatArray, apart: float
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
