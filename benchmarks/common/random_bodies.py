"""Bodies at random places of true frames, the least errors that anyone can make about them, and how answers are judged.

The bound is that of Cramér and Rao for the data (log frequency ratios and shapes before and after, with their noise)
and for all unknowns: position, mass, the body's offsets and radius of gyration with the spread from which they are
drawn, a drift common to all frequencies, and the density, without which frequencies determine a body only as a share of
the structure. It is evaluated on the true frame, not on the reference.
"""

from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta

from daq import FloatArray, IndexArray
from updater import Body, MassChange, Model, Structure, build_model
from updater.fe.model import body_mass
from updater.modal_data import COMMON_STD
from updater.structure import Member

OFFSET_STD, GYRATION_STD = 0.02, 0.03**2  # m, m2: of the bodies that are drawn
DENSITY_STD = 0.01  # of the true frames
TOTAL = 7.505  # kg of the frame as drawn
N_MODES = 8
_BASIS = 60  # modes of the true frame that the bound is computed in
_STEPS = (1e-3, 1e-4, 1e-4, 1e-4, 1e-6)  # m, kg, m, m, m2: of its differences
_GRID = 5e-4  # m: half of the positions' distance
_TO_MEDIAN = 0.6745  # median of |x| over the standard deviation of x


@dataclass(frozen=True, kw_only=True)
class Placed:
    """A body on a member."""

    member: Member
    distance: float  # from the member's start [m]
    mass: float  # [kg]
    offset: tuple[float, float] = (0.0, 0.0)  # along the member's two cross axes [m]
    gyration: float = 0.0  # squared radius [m2]

    @property
    def body(self) -> Body:
        """Return it as a body of a structure."""
        axes = self.member.axes
        offset = np.array(self.offset) @ axes[1:]
        at = tuple(self.member.point(self.distance).tolist())
        return Body(at=at, mass=self.mass, offset=tuple(offset.tolist()), inertia=(self.mass * self.gyration,) * 3)


def draw(structure: Structure, mass: float, random: np.random.Generator) -> Placed:
    """Return a body anywhere on the members, every metre with equal probability, its centre off their axes."""
    length = np.array([member.length for member in structure.member])
    chosen = int(random.choice(len(length), p=length / length.sum()))
    first, second = OFFSET_STD * random.standard_normal(2)
    return Placed(
        member=structure.member[chosen],
        distance=float(random.uniform(0, length[chosen])),
        mass=mass,
        offset=(float(first), float(second)),
        gyration=float(abs(GYRATION_STD * random.standard_normal())),
    )


class Limit:
    """The least errors on one true frame.

    Parameters
    ----------
    structure : the true one, bare; its first eight modes are measured
    """

    def __init__(self, structure: Structure) -> None:
        self._measured: IndexArray = np.arange(N_MODES)
        self.member = {member.name: member for member in structure.member}
        self._model: Model = build_model(structure, shear_flexible=True, mass="consistent")
        self._modes = self._model.modes(_BASIS)
        self._at_sensors: FloatArray = self._model.sensor_rows @ self._modes.shape

    def only(self, measured: IndexArray) -> "Limit":
        """Return the same with other modes measured (n_modes,)."""
        other = copy(self)
        other._measured = measured
        return other

    def least(self, placed: Placed, frequency_std: FloatArray, shape_std: FloatArray) -> tuple[float, float]:
        """Return the least standard deviations of place [m] and mass [kg].

        Parameters
        ----------
        frequency_std : (n_modes,) of log frequencies, before as after
        shape_std : (n_modes,) of each component of unit shapes, before as after
        """
        inside = np.clip(placed.distance, _STEPS[0], placed.member.length - _STEPS[0])
        theta = np.array([inside, placed.mass, *placed.offset, max(placed.gyration, _STEPS[4])])
        offset = np.diag(_STEPS)
        above = [self._predict(placed.member, theta + step) for step in offset]
        below = [self._predict(placed.member, theta - step) for step in offset]
        slope = np.array([(a - b) / (2 * h) for a, b, h in zip(above, below, _STEPS, strict=True)]).T
        n = len(frequency_std)
        covariance = np.diag(2 * frequency_std**2) + COMMON_STD**2
        information = slope[:n].T @ np.linalg.solve(covariance, slope[:n])
        of_shapes = slope[n:].reshape(n, -1, len(theta)) / (np.sqrt(2) * shape_std[:, None, None])
        information += np.einsum("mci,mcj->ij", of_shapes, of_shapes)
        information += np.diag([0, 0, OFFSET_STD**-2, OFFSET_STD**-2, GYRATION_STD**-2])
        variance = np.diag(np.linalg.inv(information))
        return float(np.sqrt(variance[0])), float(np.sqrt(variance[1] + (DENSITY_STD * placed.mass) ** 2))

    def _predict(self, member: Member, theta: FloatArray) -> FloatArray:
        """Return log frequencies and, one after another, unit shapes in the directions that shapes can differ."""
        distance, mass, first, second, gyration = theta
        body = Placed(member=member, distance=0, mass=mass, offset=(first, second), gyration=gyration).body
        moved = self._model.read(member.point(distance)) @ self._modes.shape
        whole = np.eye(_BASIS) + moved.T @ body_mass(body) @ moved
        root = self._modes.omega**-1.0
        value, vector = np.linalg.eigh(root[:, None] * whole * root)
        vector, value = root[:, None] * vector[:, ::-1][:, self._measured], value[::-1][self._measured]
        shape = self._at_sensors @ vector
        shape /= np.linalg.norm(shape, axis=0) * np.sign(shape[np.abs(shape).argmax(0), np.arange(len(value))])
        return np.concatenate([-0.5 * np.log(value), shape.T.ravel()])


@dataclass(frozen=True, kw_only=True)
class Judged:
    """One answer with the truth and the bound."""

    share: float  # of the structure's mass
    off: float  # m
    mass_error: float  # share of the mass, signed
    least_off: float  # m
    least_mass: float  # share of the mass
    in_region: bool
    in_interval: bool


def judge(found: MassChange, placed: Placed, limit: Limit, frequency_std: FloatArray, shape_std: FloatArray) -> Judged:
    """Judge an answer."""
    least_off, least_mass = limit.least(placed, frequency_std, shape_std)
    point = limit.member[found.member].point(found.distance)
    return Judged(
        share=placed.mass / TOTAL,
        off=float(np.linalg.norm(point - placed.member.point(placed.distance))),
        mass_error=found.mass / placed.mass - 1,
        least_off=least_off,
        least_mass=least_mass / placed.mass,
        in_region=any(
            part.member == placed.member.name and part.start - _GRID <= placed.distance <= part.stop + _GRID
            for part in found.region
        ),
        in_interval=abs(found.mass - placed.mass) < 1.96 * found.mass_std,
    )


def row(label: str, judged: list[Judged]) -> str:
    """Return a line of the table."""
    off = np.array([j.off for j in judged])
    error = np.array([abs(j.mass_error) for j in judged])
    cells = [
        f"{1000 * np.median(off):.1f} ({over_least(off, [j.least_off for j in judged]):.2f})",
        f"{1000 * np.percentile(off, 90):.0f}",
        f"{100 * np.median(error):.1f} ({over_least(error, [j.least_mass for j in judged]):.2f})",
        share([j.in_region for j in judged]),
        share([j.in_interval for j in judged]),
    ]
    return " | ".join([f"| {label}", str(len(judged)), *cells]) + " |"


def over_least(error: FloatArray, least: list[float]) -> float:
    """Return the median error, each in its own least deviation, over that of a standard normal variable."""
    return float(np.median(error / np.array(least)) / _TO_MEDIAN)


HEAD = (
    "| | places | off, median [mm] (over least) | 90 % [mm] | mass off, median [%] (over least) | place in region "
    "| mass in interval |\n| --- |" + " ---: |" * 6
)


def share(hits: list[bool]) -> str:
    """Return a percentage with Clopper and Pearson's 95 % interval."""
    k, n = sum(hits), len(hits)
    low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    return f"{100 * k / n:.1f} ({100 * low:.1f}-{100 * high:.1f})"
