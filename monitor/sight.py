"""What the sensors of a structure can see of its modes."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from oma import mac_matrix
from updater import Model, Modes, Structure, build_model

ALIKE = 0.9  #: MAC at the sensors above which two modes cannot be told apart by their shapes [-]
UNSEEN = 0.05  #: share of a mode's largest motion under which sensors do not see it [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class Sight:
    """Modes of a structure's model, and how they look at its sensors."""

    model: Model
    modes: Modes
    at_sensors: FloatArray  #: (n_modes, n_sensors) mass-normalised [1/sqrt(kg)]
    seen: FloatArray  #: (n_modes,) largest motion at a sensor over the largest anywhere [-]
    auto_mac: FloatArray  #: (n_modes, n_modes) MAC of the modes at the sensors [-]; NaN for one that none of them sees

    @property
    def motion(self) -> FloatArray:
        """Displacements (n_modes, n_nodes, 3) of the nodes, the largest of each mode 1 [-]."""
        moved = _motion(self.model, self.modes)
        return np.asarray(moved / np.linalg.norm(moved, axis=2).max(axis=1)[:, None, None])

    def alike(self, mode: int) -> tuple[int, ...]:
        """Return the other modes that are seen, but whose shapes the sensors cannot tell from this one's."""
        others = np.flatnonzero(np.nan_to_num(self.auto_mac[mode]) > ALIKE)
        return tuple(int(k) for k in others if k != mode and self.is_seen(int(k)) and self.is_seen(mode))

    def is_seen(self, mode: int) -> bool:
        """Tell whether a sensor sees enough of a mode."""
        return bool(self.seen[mode] >= UNSEEN)


def look(structure: Structure, n_modes: int) -> Sight:
    """Return what the sensors see of the lowest modes.

    Parameters
    ----------
    structure : Structure
    n_modes : asked for; a coarse mesh may have fewer

    Raises
    ------
    ModelError
        If the structure is a mechanism, or something lies on no member.
    """
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(max(1, min(n_modes, model.n_dofs - 1)))
    at_sensors = (model.sensor_rows @ modes.shape).T
    amplitude = np.linalg.norm(at_sensors, axis=1)
    largest = np.linalg.norm(_motion(model, modes), axis=2).max(axis=1)
    visible = np.flatnonzero(amplitude > 1e-9 * largest)
    auto_mac = np.full((len(at_sensors), len(at_sensors)), np.nan)
    auto_mac[np.ix_(visible, visible)] = mac_matrix(at_sensors[visible], at_sensors[visible])
    return Sight(
        model=model,
        modes=modes,
        at_sensors=at_sensors,
        seen=np.abs(at_sensors).max(axis=1, initial=0.0) / largest,
        auto_mac=auto_mac,
    )


def _motion(model: Model, modes: Modes) -> FloatArray:
    """Return the translations (n_modes, n_nodes, 3) of the nodes."""
    padded = np.vstack([modes.shape, np.zeros((1, modes.shape.shape[1]))])
    return np.asarray(np.moveaxis(padded[model.dofs[:, :3]], 2, 0))
