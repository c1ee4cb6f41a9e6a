"""A stretch of a member that has lost stiffness about one axis more than about the other: a saw cut, a loose flange.

As `local_stiffness`, but with separate factors for bending about either axis of the section and for twist: 1 - loss
about one axis, and a share, from none to all, of the added compliance about the other axis and in twist. Only short
losses are considered: gains, or losses along half a member with such shares, are similar to changes outside the
catalogue.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.stiffness.local_stiffness import (
    LENGTHS,
    SHEAR,
    SOFTEST,
    LocalStiffness,
    flexibility_by_axis,
    start_of,
)
from updater.causes.stretches import Kinds, begun, everywhere, may_be_cut
from updater.inference import Comparison, Fit
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Segment, Structure

_SHARE = 0.3  # of the compliance about the axis, about the other and in twist: a cut of a third of the depth adds it
_ABOUT_Z = 1000  # beyond the kinds about y, those about z
_BEGUN = 0.05  # smallest start of a fit: at its bound the gradient is zero
_SHORT = (8, 30)  # kinds of lengths
_ALTERNATIVES = tuple((kind, kind + axis) for axis in (0, _ABOUT_Z) for kind in _SHORT)
_KINDS = Kinds(
    size={own: LENGTHS.size[kind] for kind, own in _ALTERNATIVES},
    step={own: LENGTHS.step[kind] for kind, own in _ALTERNATIVES},
    about={own: LENGTHS.about[kind] for kind, own in _ALTERNATIVES},
)


@dataclass(frozen=True, eq=False, kw_only=True)
class OneSidedStiffness(LocalStiffness):
    """Stretches of all members about y or z; the last two parameters are the shares of the other axis and of twist.

    Compliances are about y and z, in twist and in shear.
    """

    @property
    def prior_std(self) -> FloatArray:
        """Standard deviation of the parameters of any stretch, and of the shares minus those of a cut."""
        return np.append(super().prior_std, [_SHARE, _SHARE])

    @property
    def neutral_start(self) -> FloatArray:
        """Next to nothing is done."""
        start = super().neutral_start
        start[:, 0] = _BEGUN
        return start

    @property
    def lower(self) -> FloatArray:
        """Nothing is gained, and no share is negative."""
        return np.tile([0.0, -np.inf, -np.inf, -SHEAR, -_SHARE, -_SHARE], (len(self.member), 1))

    def shares(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the compliance added about y and z, in twist and in shear (len(rows), 4), relative to the axis."""
        about_z = self.kind[rows] >= _ABOUT_Z
        other, twist = np.minimum(_SHARE + theta[:, 4:6], 1.0).T
        shear = np.minimum(SHEAR + theta[:, 3], 1.0)
        return np.stack([np.where(about_z, other, 1.0), np.where(about_z, 1.0, other), twist, shear], axis=1)

    def axis_shares(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the compliance added about y and z and in twist (len(rows), 3), over the most of them."""
        return self.shares(theta, rows)[:, :3]

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the shares of stiffness that are lost about the member's local axes and in twist, and the length."""
        lost, std = self._lost(fit)
        names = "loss_about_local_y", "loss_about_local_z", "loss_in_twist"
        each = {name: self.averaged(fit, lost[:, k], std[:, k]) for k, name in enumerate(names)}
        most = max(names[:2], key=lambda name: abs(each[name][0]))
        extent = self.averaged(fit, *self.extents(fit))
        return {
            **{key: Quantity(value=v, std=s, unit="-") for key, (v, s) in {"loss": each[most], **each}.items()},
            "extent": Quantity(value=extent[0], std=extent[1], unit="m"),
        }

    def _lost(self, fit: Fit[Cause]) -> tuple[FloatArray, FloatArray]:
        """Return the shares lost about y and z and in twist (n, 3), and their deviations."""
        rows = np.arange(len(self.member))
        shares, more = self.shares(fit.theta, rows)[:, :3], np.expm1(fit.theta[:, :1])
        slope = np.zeros((len(rows), 3, fit.theta.shape[1]))
        slope[:, :, 0] = (1 + more) * shares
        slope[rows, np.where(self.kind >= _ABOUT_Z, 0, 1), 4] = more[:, 0]
        slope[:, 2, 5] = more[:, 0]
        std = np.sqrt(np.einsum("pij,pjk,pik->pi", slope, fit.covariance, slope))
        return 1 - 1 / (1 + more * shares), std / (1 + more * shares) ** 2

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Add a segment of the stretch's stiffness."""
        member, at, extent = self.stretch(row, theta)
        more = np.expm1(min(theta[0], SOFTEST)) * self.shares(theta[None], np.array([row]))[0]
        about_y, about_z, twist, shear = (1 / (1 + more)).tolist()
        segment = Segment(
            member=member, at=at, extent=extent, bending=(about_y, about_z), torsion=twist, shear_stiffness=shear
        )
        return structure.model_copy(update={"segment": (*structure.segment, segment)})


def propose_one_sided_stiffness(reference: Reference, comparison: Comparison) -> OneSidedStiffness | None:
    """Return stretches as those of one factor are, about either axis."""
    if not may_be_cut(reference.structure):
        return None
    cells, compliance = flexibility_by_axis(reference)
    found = OneSidedStiffness(
        reference=reference,
        comparison=comparison,
        cells=cells,
        kinds=_KINDS,
        compliance=compliance,
        **everywhere(cells, _KINDS, 6),
    )
    strength, explained = start_of(found)
    return begun(found, (np.maximum(strength, _BEGUN), explained))
