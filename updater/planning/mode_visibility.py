"""Visibility of modes, and of a body on the structure, to its sensors."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from daq import FloatArray
from oma import mac_matrix
from updater.errors import ModelError
from updater.fe import Model, Modes, build_model
from updater.planning.detectability import DetectabilityStudy, study_detectability
from updater.planning.expected_reference import UNSEEN, largest_motion, motion, seen_by
from updater.planning.record_noise import Record
from updater.planning.sensor_placement import Choice, best_additional_sensor
from updater.structure import Sensor, Structure

ALIKE = 0.9  #: MAC at the sensors above which two modes cannot be distinguished by their shapes [-]
_NODES = 60  # at which one sensor more is tried
_TYPICAL = 0.01  # of the structure's mass: the body that one more sensor is to locate


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeVisibility:
    """Modes of a structure's model, and how they look at its sensors."""

    model: Model
    modes: Modes
    at_sensors: FloatArray  #: (n_modes, n_sensors) mass-normalised [1/sqrt(kg)]
    seen: FloatArray  #: (n_modes,) largest motion at a sensor over the largest anywhere [-]
    #: (n_modes, n_modes) MAC of the modes at the sensors [-]; NaN for modes that no sensor measures
    auto_mac: FloatArray
    record: Record  #: record lengths, before a change and after
    outlook: DetectabilityStudy | None  #: study of a body anywhere; None if the sensors are too few
    too_few: str  #: why, if so

    @property
    def motion(self) -> FloatArray:
        """Displacements (n_modes, n_nodes, 3) of the nodes, the largest of each mode 1 [-]."""
        return np.asarray(motion(self.model, self.modes) / largest_motion(self.model, self.modes)[:, None, None])

    def alike(self, mode: int) -> tuple[int, ...]:
        """Return the other measurable modes whose shapes the sensors cannot distinguish from this one's."""
        others = np.flatnonzero(np.nan_to_num(self.auto_mac[mode]) > ALIKE)
        return tuple(int(k) for k in others if k != mode and self.is_seen(int(k)) and self.is_seen(mode))

    def is_seen(self, mode: int) -> bool:
        """Return whether a sensor measures a mode sufficiently."""
        return bool(self.seen[mode] >= UNSEEN)

    @property
    def typical_mass(self) -> float:
        """A hundredth of the structure's mass [kg]."""
        return _TYPICAL * self.model.total_mass()

    @cached_property
    def weakest(self) -> FloatArray:
        """Weakest mass that raises the alarm, at each of the outlook's places (n_places,) [kg]; empty without one."""
        return self.outlook.weakest_mass() if self.outlook else np.zeros(0)

    @cached_property
    def helper(self) -> Choice | None:
        """The sensors with the one more that would make the place of a body surest."""
        return best_additional_sensor(self.outlook, self.typical_mass) if self.outlook else None

    @property
    def unseen(self) -> tuple[int, ...]:
        """Modes that no sensor measures."""
        return tuple(k for k in range(len(self.seen)) if not self.is_seen(k))

    @property
    def pairs_alike(self) -> tuple[tuple[int, int], ...]:
        """Pairs of measurable modes that the sensors cannot distinguish by their shapes."""
        return tuple((k, other) for k in range(len(self.seen)) for other in self.alike(k) if other > k)


def look(
    structure: Structure, n_modes: int, record: Record | None = None, within: float | None = None
) -> ModeVisibility:
    """Return the visibility of the lowest modes, and of a body.

    Parameters
    ----------
    structure : Structure
    n_modes : requested; a coarse mesh may have fewer
    record : record lengths before a change and after. Default: ten minutes
    within : required accuracy of the location of a body [m]. Default: a centimetre, or more on long members

    Raises
    ------
    ModelError
        If the structure is a mechanism, or something lies on no member.
    """
    record = record or Record()
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(max(1, min(n_modes, model.n_dofs - 1)))
    at_sensors = (model.sensor_rows @ modes.shape).T
    outlook, too_few = _outlook(structure, record, within)
    return ModeVisibility(
        model=model,
        modes=modes,
        at_sensors=at_sensors,
        seen=seen_by(model, modes),
        auto_mac=_auto_mac(at_sensors, largest_motion(model, modes)),
        record=record,
        outlook=outlook,
        too_few=too_few,
    )


def _outlook(structure: Structure, record: Record, within: float | None) -> tuple[DetectabilityStudy | None, str]:
    try:
        return study_detectability(structure, record, within), ""
    except ModelError as error:
        return None, str(error)


def _auto_mac(at_sensors: FloatArray, largest: FloatArray) -> FloatArray:
    visible = np.flatnonzero(np.linalg.norm(at_sensors, axis=1) > 1e-9 * largest)
    auto_mac = np.full((len(at_sensors), len(at_sensors)), np.nan)
    auto_mac[np.ix_(visible, visible)] = mac_matrix(at_sensors[visible], at_sensors[visible])
    return auto_mac


def clearer(sight: ModeVisibility) -> tuple[Sensor, ModeVisibility] | None:
    """Return the additional sensor that measures most unmeasured modes and distinguishes most pairs.

    None if there is nothing to improve, or no single sensor that improves it.
    """
    best, least = None, _blur(sight)
    if least[:2] == (0, 0):
        return None
    nodes = np.unique(np.linspace(0, len(sight.model.nodes) - 1, _NODES).astype(int))
    largest = largest_motion(sight.model, sight.modes)
    for node in nodes:
        for axis in range(3):
            moved = sight.motion[:, node, axis]
            at_sensors = np.column_stack([sight.at_sensors, moved * largest])
            seen = np.maximum(sight.seen, np.abs(moved))
            tried = replace(sight, at_sensors=at_sensors, seen=seen, auto_mac=_auto_mac(at_sensors, largest))
            if _blur(tried) < least and _blur(tried)[:2] < _blur(sight)[:2]:
                x, y, z = sight.model.nodes[node].tolist()
                direction = (float(axis == 0), float(axis == 1), float(axis == 2))
                best, least = (Sensor(channel="new", at=(x, y, z), direction=direction), tried), _blur(tried)
    return best


def _blur(sight: ModeVisibility) -> tuple[int, int, float]:
    """Return how many modes are unseen, how many pairs alike, and how much the least seen mode lacks."""
    return len(sight.unseen), len(sight.pairs_alike), 1 - float(sight.seen.min())
