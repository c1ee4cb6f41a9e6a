"""A cause of your own: ice along one whole member. See docs/howto/extend/cause.md."""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater import Body, Reference, Structure
from updater.causes import Discrete
from updater.inference import Comparison, Effect, Fit, no_effect
from updater.quantities import Quantity, Where

POINTS = 21  # along a member, that represent it


@dataclass(frozen=True, eq=False, kw_only=True)
class Ice(Discrete):
    """Alternatives are the members; the parameter is the ice's mass [kg]."""

    structure: Structure
    carried: FloatArray  #: (n_members, n_modes, n_modes) modal mass of a kilogram along each member
    name: str = "ice"
    place_free: bool = False
    advice: str = "Look at the member, or wait until it thaws."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return what masses theta (n, 1) on members `rows` (n,) do to the modal mass."""
        return replace(no_effect(len(rows), self.comparison), mass=theta[:, :, None] * self.carried[rows])

    def where(self, fit: Fit["Ice"]) -> Where:
        """Return the most probable member."""
        member = self.structure.member[fit.best]
        return Where(member=member.name, position=_point(member.point(member.length / 2)))

    def parameters(self, fit: Fit["Ice"]) -> dict[str, Quantity]:
        """Return the mass."""
        std = float(fit.covariance[fit.best, 0, 0] ** 0.5)
        return {"mass": Quantity(value=float(fit.theta[fit.best, 0]), std=std, unit="kg")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the ice as bodies along the member."""
        points, share = spread(structure, row)
        return structure.with_bodies(
            Body(at=_point(p), mass=float(theta[0]) * s) for p, s in zip(points, share.tolist(), strict=True)
        )


def spread(structure: Structure, row: int) -> tuple[FloatArray, FloatArray]:
    """Return points along a member and their shares of its length."""
    member = structure.member[row]
    return member.point((np.arange(POINTS) + 0.5) * member.length / POINTS), np.full(POINTS, 1 / POINTS)


def _point(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z


def propose_ice(reference: Reference, comparison: Comparison) -> Ice:
    """Return every member as an alternative."""
    structure, model = reference.structure, reference.model
    carried = []
    for row in range(len(structure.member)):
        points, share = spread(structure, row)
        moved = (model.reader(points) @ reference.shape).reshape(POINTS, 6, -1)[:, :3]
        carried.append(np.einsum("p,pam,pan->mn", share, moved, moved))
    return Ice(
        prior_std=np.array([0.05 * model.total_mass()]),
        lower=np.zeros((len(carried), 1)),
        drifting=True,  # temperature may shift all frequencies a little, too
        comparison=comparison,
        structure=structure,
        carried=np.array(carried),
    )
