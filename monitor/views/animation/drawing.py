"""Drawing of an animation: members, ribs that show torsion, sensors, and their motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from daq import FloatArray
from daq.notebook import number_text
from monitor.results.sensor_geometry import SensorGeometry
from monitor.views.geometry import RIB, RIBS_APART, ribs, side
from oma import ComplexArray, ModalEstimate
from updater.validation import ModelModes, expand_measured

SWAY = 0.12  #: largest displacement drawn, of the structure's size
_SIDE = (32.0, 22.0)  # degrees: azimuth and elevation of the viewer
_TINY = 1e-12  # of a shape of unit norm


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """Nodes, and their motion in each mode; the largest displacement of each mode is 1."""

    name: str
    nodes: FloatArray  #: (n_nodes, 3) at rest [m]
    spans: Sequence[tuple[int, int]]  #: pairs of nodes that a line joins
    sensors: Sequence[int]  #: nodes with a sensor
    translation: ComplexArray  #: (n_modes, n_nodes, 3) [-]
    rotation: ComplexArray | None = None  #: likewise; None without a model [rad per m of displacement]

    @classmethod
    def of_model(cls, estimate: ModalEstimate, compared: ModelModes) -> "Motion":
        """Return measured shapes expanded to all nodes of a model."""
        shapes = expand_measured(estimate, compared)
        nodes, structure = shapes.model.nodes, shapes.model.structure
        places = {s.at for s in structure.corrected_sensors if s.channel in estimate.channels}
        return cls(
            name=structure.name,
            nodes=nodes,
            spans=[(int(a), int(b)) for a, b in shapes.model.spans],
            sensors=sorted({int(np.argmin(np.linalg.norm(nodes - place, axis=1))) for place in places}),
            translation=shapes.translation,
            rotation=shapes.rotation,
        )

    @classmethod
    def of_sensors(cls, estimate: ModalEstimate, geometry: SensorGeometry) -> "Motion":
        """Return measured shapes at the positions of the sensors."""
        moved = geometry.displacement(estimate.channels, estimate.shape)
        largest = np.maximum(np.linalg.norm(moved, axis=2).max(1), _TINY)
        return cls(
            name="Sensors",
            nodes=np.array(geometry.nodes),
            spans=[pair for chain in geometry.chains for pair in pairwise(chain)],
            sensors=range(len(geometry.nodes)),
            translation=moved / largest[:, None, None],
        )


class Drawing:
    """Points at rest, their motion in each mode, and the lines between them.

    Parameters
    ----------
    estimate : measured modes
    motion : of their shapes
    """

    def __init__(self, estimate: ModalEstimate, motion: Motion) -> None:
        nodes, moved = motion.nodes, motion.translation
        extent = np.ptp(nodes, axis=0)
        self.name = motion.name
        self.size = float(np.linalg.norm(extent))
        self.centre: FloatArray = (nodes.min(0) + nodes.max(0)) / 2
        self.towards: FloatArray = side(extent, *_SIDE)  #: (3,) towards the viewer
        self.labels = [_label(estimate, k) for k in range(estimate.n_modes)]
        self.points: FloatArray = nodes  #: (n, 3) at rest [m]
        self.ribs: list[tuple[int, int]] = []  #: pairs of points
        if motion.rotation is not None:
            at, way = ribs(nodes, motion.spans, self.towards, RIBS_APART * self.size)
            arms = RIB * self.size * np.concatenate([way, -way])
            owner = np.concatenate([at, at])
            turned = np.cross(motion.rotation[:, owner], arms)
            self.points = np.concatenate([nodes, nodes[owner] + arms])
            moved = np.concatenate([moved, moved[:, owner] + turned], axis=1)
            self.ribs = [(len(nodes) + i, len(nodes) + len(at) + i) for i in range(len(at))]
        self.motion: ComplexArray = (SWAY * self.size * moved).astype(np.complex128)  #: (n_modes, n, 3) [m]
        self.spans = list(motion.spans)  #: pairs of points: members, or lines between sensors
        self.sensors = list(motion.sensors)  #: points

    @property
    def reach(self) -> float:
        """Radius about the centre that holds all motions [m]."""
        farthest = np.linalg.norm(self.points - self.centre, axis=1).max()
        return float(farthest + SWAY * self.size)


def _label(estimate: ModalEstimate, k: int) -> str:
    frequency = number_text(float(estimate.frequency[k]), float(estimate.frequency_std[k]))
    damping = number_text(100 * float(estimate.damping[k]), 100 * float(estimate.damping_std[k]))
    return f"Mode {k + 1}\n{frequency} Hz, {damping} %"
