"""A sensor that points elsewhere than it should, or a device that is turned with all its sensors.

A channel of direction d then reads R(theta) d: less of its own direction, and the two across it by the sines, which the
reference's modes have at its position. A rotation about the sensor's own direction has no effect. Its previous
direction is known to a degree or two; the baseline has this in its shapes, and the same share of the reading across it
is its own.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.sensors.channel_fault import Chain, groups_of
from updater.inference import Comparison, Effect, Fit, evaluate, no_effect
from updater.quantities import ASKEW_STD, Quantity
from updater.reference import Reference
from updater.structure import Structure, sensor_axes

_STD = 0.2  # rad: a bracket that is bent or screwed on askew, not a sensor on another face
_TRIED = 0.3  # rad: angles from which a fit may start, of both signs
_ALONG = 1e-3  # of a direction's part across an axis, under which turning about it shows nothing
_TURNS = ("about_x", "about_y", "about_z")


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorOrientation(Chain):
    """A channel turned about two axes across it, or a device about one.

    Parameters are the angles, and the deviation of the previous direction from a right angle to the one it now reads
    [rad].
    """

    axes: FloatArray  #: (n_alternatives, 2, 3) of each angle; zeros where there is no second
    turned: FloatArray  #: (n_alternatives, n_channels) 1 for the channels of each
    mounted: FloatArray  #: (n_channels, 3, 3) direction and the two across it, of each channel
    name: str = "sensor_orientation"
    advice: str = (
        "Hold a square and a level to the sensor; at rest, gravity shows how far an axis is from the vertical."
    )

    @cached_property
    def start(self) -> FloatArray:
        """Start of each alternative: no turn, or a turn about one axis in the direction that fits better.

        The cosine of an angle has no sign: from no turn a fit may end in the minimum of the other sign.
        """
        none, rows = np.zeros(self.lower.shape), np.arange(len(self.lower))
        turns = [sign * _TRIED * np.eye(3)[axis] for axis in (0, 1) for sign in (1, -1)]
        starts = np.stack([none, *(none + turn for turn in turns)])
        cost = [evaluate(self.comparison, self, each, rows).cost for each in starts]
        return np.asarray(starts[np.argmin(cost, axis=0), rows])

    @property
    def neutral_start(self) -> FloatArray:
        """No turn."""
        return np.zeros(self.lower.shape)

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the reading of each channel of its own direction and of those across it."""
        vector = np.einsum("pk,pkx->px", theta[:, :2], self.axes[rows])
        turn = Rotation.from_rotvec(vector).as_matrix()
        now = np.einsum("pxy,cy->pcx", turn, self.mounted[:, 0])
        reads = np.einsum("pcx,ckx->pkc", now, self.mounted)  # (p, own and two across, n_channels)
        reads[:, 0] += (theta[:, 2] * np.sin(np.linalg.norm(vector, axis=1)))[:, None]
        same = np.array([1.0, 0.0, 0.0])[:, None]
        reads = np.where(self.turned[rows][:, None, :] > 0, reads, same)
        n = len(self.mounted)
        chain = np.concatenate([reads[:, k, :, None] * np.eye(n) for k in range(3)], axis=2)
        return replace(no_effect(len(rows), self.comparison), chain=chain)

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the angle in all, and about each global axis."""
        row = fit.best
        axes, theta, covariance = self.axes[row], fit.theta[row, :2], fit.covariance[row, :2, :2]
        vector, spread = axes.T @ theta, np.sqrt(np.einsum("kx,kl,lx->x", axes, covariance, axes))
        size = float(np.linalg.norm(vector))
        way = theta / np.linalg.norm(theta) if size else np.array([1.0, 0.0])  # axes are at right angles
        found = {"angle": Quantity(value=size, std=float(np.sqrt(way @ covariance @ way)), unit="rad")}
        for name, value, std in zip(_TURNS, vector.tolist(), spread.tolist(), strict=True):
            if std > 0:
                found[name] = Quantity(value=value, std=std, unit="rad")
        return found

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Turn the sensors' directions."""
        turn = Rotation.from_rotvec(theta[:2] @ self.axes[row]).as_matrix()
        sensors = tuple(
            sensor.model_copy(update={"direction": tuple((turn @ np.array(sensor.direction)).tolist())})
            if corrected.channel in self.channels[row]
            else sensor
            for sensor, corrected in zip(structure.sensor, structure.corrected_sensors, strict=True)
        )
        return structure.model_copy(update={"sensor": sensors})


def propose_sensor_orientation(reference: Reference, comparison: Comparison) -> SensorOrientation:
    """Return every channel, and every device about each global axis."""
    corrected = {s.channel: s for s in reference.structure.corrected_sensors}
    mounted = np.array([sensor_axes(corrected[c].direction) for c in comparison.channels])
    groups: list[tuple[str, ...]] = []
    axes: list[FloatArray] = []
    for group in groups_of(reference, comparison):
        if len(group) == 1:
            groups.append(group)
            axes.append(mounted[comparison.channels.index(group[0]), 1:])
        else:
            for axis in np.eye(3):
                turned = tuple(c for c in group if np.linalg.norm(np.cross(axis, corrected[c].direction)) > _ALONG)
                if len(turned) > 1:  # else it is a sensor by itself
                    groups.append(turned)
                    axes.append(np.array([axis, np.zeros(3)]))
    return SensorOrientation(
        prior_std=np.array([_STD, _STD, ASKEW_STD]),
        lower=np.full((len(groups), 3), -np.inf),
        comparison=comparison,
        channels=tuple(groups),
        axes=np.array(axes),
        turned=np.array([[float(c in group) for c in comparison.channels] for group in groups]),
        mounted=mounted,
    )
