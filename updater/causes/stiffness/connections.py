"""A foot or a joint that gives more, or less, than it did: modal flexibility Lambda^-1 + sum_a c_a mu_a mu_a^T.

mu_a = (moment of each mode in the spring about axis a) / omega^2 is the modal displacement under a unit couple at the
spring, so that a flexibility c_a [rad/(N m)] more is, with self-stress, exact in all modes and nearly so in thirty.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import BoolArray, Cause, Discrete
from updater.causes.modal_loads import modal_spring_force
from updater.inference import Comparison, Effect, Fit, common_magnitude, first_order, no_effect
from updater.modal_data import Sites
from updater.quantities import SIGNIFICANT, ParameterChange, Quantity, Where
from updater.reference import Reference
from updater.structure import (
    Axis,
    Joint,
    Member,
    ModelParameter,
    Structure,
    Support,
    all_knobs,
    flexibility_unit,
    is_of,
)

TURNS: tuple[Axis, Axis, Axis] = ("rx", "ry", "rz")
SLIDES: tuple[Axis, Axis, Axis] = ("x", "y", "z")
LOOSE = 0.1  #: prior standard deviation of c E I / L, and of a parameter: a connection that has come loose
_SOFTER = 10.0  # likewise of a bearing, of its own flexibility
_GIVES = 1e-2  # and at least of c E I / L^3
_LARGE = 2.0  # times the prior standard deviation, which a Gaussian prior permits in 5 % of cases
_ORDERS = 1e-3, 300.0  # range of the order of a parameter, over that: hardly visible to a hinge
_WIDER = 3.0  # times the size of a large change: standard deviation of its prior, which then hardly pulls it
_FAR = 10.0  # times the order of the prior of a fit: largest order
_HINGE = 10.0  # parameter where a fit begins that may end near a hinge: by L / (E I), nine tenths of the way to it
_LOOSENED = (0.1, 0.3, 1.0, 3.0)  # parameters, about all axes alike, where a fit of a large change begins too
_LIKELY = 150.0  # of log evidence below the best alternative: those that also begin there
_SAME_ORDER = 0.2  # logarithm of the ratio of two orders of a prior that make no difference


@dataclass(frozen=True, eq=False, kw_only=True)
class Springs(Discrete):
    """Connections with springs; parameters are flexibilities added about, or along, x y z, in usual units.

    Alternatives are the possibly changed axes of each connection, singly and together: an unchanged axis, or one
    without effect on the data, must not affect the evidence. Each is there twice, started from no change and from the
    frequencies to first order: where modes cross on the way, one of them may not converge. A large change is fitted
    from changes of several orders too (`refined`). A free axis starts with the stiffness of the member, because only
    there its stiffness moves a mode.
    """

    name: str
    advice: str
    structure: Structure  #: structure with the connections
    connections: tuple[Support | Joint, ...]  #: (n,) of each alternative
    axes: tuple[tuple[Axis, Axis, Axis], ...]  #: (n,) that its three parameters are about or along
    active: BoolArray  #: (n, 3) of which each alternative changes these
    before_std: FloatArray  #: (n, 3) of the flexibility that each had [rad/(N m)] or [m/N]
    rigid: BoolArray  #: (n, 3) whether it was a stand-in for a rigid connection
    unit: FloatArray  #: (n, 3) 1 / c of a parameter of one [N m/rad] or [N/m]
    couple: FloatArray  #: (n, 3, n_modes + n_stress) mu, and moments of self-stress; 0 where there is nothing to change
    begun: FloatArray  #: (n, 3) where the fit begins
    place_free: bool = False

    @property
    def start(self) -> FloatArray:
        """Start of a fit: no change, or the first-order estimate."""
        return self.begun

    def repeats(self, other: Self, row: int) -> BoolArray:
        """Return the alternatives with one of the springs of alternative `row`: a spring changes once."""
        same = [
            axes == other.axes[row] and same_connection(connection, other.connections[row])
            for connection, axes in zip(self.connections, self.axes, strict=True)
        ]
        return np.asarray(np.array(same) & (self.active & other.active[row]).any(1), bool)

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return flexibility changes."""
        couple = self.couple[rows]
        compliance = (couple * (theta / self.unit[rows])[:, :, None]).transpose(0, 2, 1) @ couple
        return replace(no_effect(len(rows), self.comparison), compliance=compliance)

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for a change of any order: the same about all axes, as of one loss."""
        gaussian = float(self.prior_std[0])  # much larger orders would be extrapolated
        least, most = _ORDERS[0] * LOOSE, min(_ORDERS[1] * LOOSE, _FAR * gaussian)
        found = common_magnitude(theta, covariance, gaussian=gaussian, least=least, most=most)
        return found + self.opening(theta, rows)

    def opening(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the log likelihood ratio (len(rows),) of opening and closing to none by the signals."""
        return self.comparison.circumstances.opening_at(self.name, self.sites(theta, rows))

    def sites(self, theta: FloatArray, rows: IndexArray) -> Sites:
        """Return the connections; without a loss with no share about any axis."""
        return Sites(path=self._paths()[rows], distance=np.zeros(len(rows)), share=self.axis_shares(theta, rows))

    def axis_shares(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the flexibility added about or along each axis (len(rows), 3), in usual units over the most."""
        lost = np.where(self.active[rows], np.maximum(theta, 0.0), 0.0)
        most = lost.max(1, keepdims=True)
        return np.asarray(lost / np.where(most > 0, most, 1.0))

    def about_axes(self, theta: FloatArray, row: int, share: FloatArray) -> list[Effect]:
        """Return the effects of a loss about each axis alone, with a share (3,) of the alternative's largest one."""
        paths = self._paths()
        same = paths == paths[row]
        added = float(theta.max()) * share
        found = []
        for a in range(3):
            with_axis = np.flatnonzero(same & self.active[:, a])
            couple = self.couple[with_axis[:1], a]  # none where the axis cannot change
            compliance = added[a] / self.unit[row, a] * np.einsum("pr,ps->rs", couple, couple)
            found.append(replace(no_effect(1, self.comparison), compliance=compliance[None]))
        return found

    def _paths(self) -> IndexArray:
        """Return the first alternative (n,) of the same connection and axes."""
        first = dict[tuple[int, tuple[Axis, Axis, Axis]], int]()
        keys = [(id(one), axes) for one, axes in zip(self.connections, self.axes, strict=True)]
        return np.array([first.setdefault(key, row) for row, key in enumerate(keys)], np.intp)

    def places(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the node of each alternative (len(rows), 3) [m]."""
        del theta
        return np.array([self.connections[row].at for row in rows])

    def refined(self, log_density: FloatArray, theta: FloatArray) -> Self | None:
        """Return each alternative once, likely ones from other starts too, with a wide prior; None for a usual change.

        The evidence has a prior of unknown order in any case. The usual Gaussian prior of the fit pulls a large change
        towards zero, and leaves a residual in the frequencies and shapes. On the way to a large change modes cross,
        where a fit may end: likely alternatives also begin with a change of several orders, the same about their axes,
        and with a hinge about each. `rescaled` then sets the order of the prior.
        """
        if self._size(log_density, theta) <= _LARGE * self.prior_std[0]:
            return None
        once = self._best_of_each(log_density)
        likely = once[log_density[once] > log_density.max() - _LIKELY]
        alike = [size * self.active[likely] for size in _LOOSENED]
        rows, begun = [once, *[likely] * len(alike)], [theta[once], *alike]
        for a in range(3):
            turning = likely[self.active[likely, a]]
            rows.append(turning)
            begun.append(theta[turning])
            begun[-1][:, a] = np.maximum(begun[-1][:, a], _HINGE)
        return self._only(np.concatenate(rows), np.concatenate(begun), _HINGE)

    def rescaled(self, log_density: FloatArray, theta: FloatArray) -> Self | None:
        """Return every alternative once, with a prior of the order of the best change."""
        order = float(np.clip(_WIDER * self._size(log_density, theta), LOOSE, _ORDERS[1] * LOOSE))
        rows = self._best_of_each(log_density)
        if len(rows) == len(theta) and abs(np.log(order / self.prior_std[0])) < _SAME_ORDER:
            return None
        return self._only(rows, theta[rows], order)

    def _size(self, log_density: FloatArray, theta: FloatArray) -> float:
        """Return the root mean square of the parameters of the best alternative."""
        best = int(np.argmax(log_density + self.log_prior))
        return float(np.sqrt(np.mean(theta[best, self.active[best]] ** 2)))

    def _best_of_each(self, log_density: FloatArray) -> IndexArray:
        """Return the most probable row of each alternative, which is there once for each start of its fit."""
        first: dict[tuple[int, tuple[Axis, Axis, Axis], tuple[bool, ...]], int] = {}
        for row in np.argsort(-log_density, kind="stable").tolist():
            key = id(self.connections[row]), self.axes[row], tuple(self.active[row].tolist())
            first.setdefault(key, row)
        return np.sort(np.array(list(first.values()), np.intp))

    def _only(self, rows: IndexArray, begun: FloatArray, order: float) -> Self:
        """Return some rows, whose fit begins elsewhere, with a prior of another order."""
        return replace(
            self,
            prior_std=np.full(3, order),
            lower=self.lower[rows],
            connections=tuple(self.connections[row] for row in rows),
            axes=tuple(self.axes[row] for row in rows),
            active=self.active[rows],
            before_std=self.before_std[rows],
            rigid=self.rigid[rows],
            unit=self.unit[rows],
            couple=self.couple[rows],
            begun=begun,
        )

    def where(self, fit: Fit[Cause]) -> Where:
        """Return the node."""
        found = self.connections[fit.best]
        member = found.member if isinstance(found, Joint) else None
        return Where(member=member, position=found.at, position_std=0.0, region=((found.at, found.at),))

    def deviations(self, fit: Fit[Cause]) -> float:
        """Return the change of the most changed spring in standard deviations."""
        return float(np.max(self._deviations(fit), where=self.active[fit.best], initial=0.0))

    def relative_std(self, fit: Fit[Cause]) -> float:
        """Return the smallest relative standard deviation of an added flexibility [-]."""
        std = np.sqrt(np.diagonal(fit.covariance[fit.best]))
        return 1 / float(np.max(np.abs(fit.theta[fit.best]) / std, where=self.active[fit.best], initial=0.0))

    def _deviations(self, fit: Fit[Cause]) -> FloatArray:
        """Return the changes (3,) of the best alternative in standard deviations, as they act on the modes.

        A spring that is much softer than its member is nearly a hinge. Its effect t / (1 + t) is certain where its
        flexibility t, on which the modes hardly depend, is not. The prior does not count as knowledge of this effect.
        """
        theta, variance = fit.theta[fit.best], np.diagonal(fit.covariance[fit.best])
        by_data = np.sqrt(np.maximum(1 / variance - self.prior_std**-2.0, 0.0))
        effect = (1 + np.maximum(theta, 0.0)) * by_data
        return np.asarray(np.abs(theta) * np.maximum(effect, variance**-0.5))

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the stiffness about or along each axis with a significant change."""
        found = {}
        deviations = self._deviations(fit)
        for a, axis, now in self._now(self.connections[fit.best], fit.best, fit.theta[fit.best]):
            own = float(fit.covariance[fit.best, a, a] ** 0.5)
            if deviations[a] < SIGNIFICANT:
                continue
            by_mesh = fit.theta[fit.best, a] * self.comparison.size_error  # of the compliance that is added
            more = float(np.hypot(own, by_mesh)) / self.unit[fit.best, a]
            std = float(np.hypot(more, self.before_std[fit.best, a])) * now**2
            found[f"stiffness_{axis}"] = Quantity(value=now, std=std, unit="N m/rad" if axis in TURNS else "N/m")
        return found

    def changes(self, fit: Fit[Cause]) -> tuple[ParameterChange, ...]:
        """Return the springs that changed."""
        connection, after = self.connections[fit.best], self.parameters(fit)
        rigid = dict(zip(self.axes[fit.best], self.rigid[fit.best].tolist(), strict=True))
        return tuple(
            ParameterChange(
                name=knob.key,
                quantity=knob.quantity,
                of=knob.of,
                position=connection.at,
                unit=after[f"stiffness_{knob.axis}"].unit,
                before=None if rigid[knob.axis] else _stiffness(connection)[knob.axis],
                after=after[f"stiffness_{knob.axis}"].value,
                std=after[f"stiffness_{knob.axis}"].std,
                before_std=0.0 if rigid[knob.axis] else self._std_before(fit.best, knob.axis),
                **_member_end(self.structure, connection, knob.axis),
            )
            for knob in all_knobs(self.structure)
            if is_of(self.structure, connection, knob) and f"stiffness_{knob.axis}" in after
        )

    def _std_before(self, row: int, axis: Axis) -> float:
        """Return the standard deviation of a spring before the change."""
        stiffness = _stiffness(self.connections[row])[axis]
        return float(self.before_std[row, self.axes[row].index(axis)]) * stiffness**2

    def own_flexibility(self, row: int) -> FloatArray:
        """Return the parameter (3,) that adds to each spring as much flexibility as it had; 0 about a rigid axis."""
        stiffness = _stiffness(self.connections[row])
        return np.array(
            [u / stiffness.get(axis, np.inf) for u, axis in zip(self.unit[row], self.axes[row], strict=True)]
        )

    def flexibility(self, row: int, theta: FloatArray) -> dict[str, float]:
        """Return the flexibility of the springs that an alternative changes, by the key and in the unit of each."""
        connection = self.connections[row]
        now = {axis: stiffness for _, axis, stiffness in self._now(connection, row, theta)}
        return {
            knob.key: flexibility_unit(self.structure, knob.axis, knob.at) / now[knob.axis]
            for knob in all_knobs(self.structure)
            if is_of(self.structure, connection, knob) and knob.axis in now
        }

    def same_springs(self, row: int, knobs: Sequence[ModelParameter]) -> FloatArray:
        """Return the parameters of an alternative for a unit of each knob of the same spring (3, n_knobs)."""
        connection, axes = self.connections[row], self.axes[row]
        found = np.zeros((3, len(knobs)))
        for k, knob in enumerate(knobs):
            if knob.axis in axes and is_of(self.structure, connection, knob):
                a = axes.index(knob.axis)
                found[a, k] = self.unit[row, a] / flexibility_unit(self.structure, knob.axis, knob.at)
        return np.where(self.active[row, :, None], found, 0.0)

    def physical_std(self, fit: Fit[Cause]) -> dict[str, float]:
        """Return the standard deviations of the springs."""
        return {change.name: change.std for change in self.changes(fit)}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the new stiffnesses."""
        found = self.connections[row]
        kind = "joint" if isinstance(found, Joint) else "support"
        parts = [
            self._changed(part, row, theta) if same_connection(part, found) else part
            for part in getattr(structure, kind)
        ]
        return structure.model_copy(update={kind: tuple(parts)})

    def _changed(self, connection: Support | Joint, row: int, theta: FloatArray) -> Support | Joint:
        new = {axis: now for _, axis, now in self._now(connection, row, theta)}
        return connection.model_copy(update={"stiffness": {**connection.stiffness, **new}})

    def _now(self, connection: Support | Joint, row: int, theta: FloatArray) -> list[tuple[int, Axis, float]]:
        """Return the changed axes of an alternative, with their number and the present springs of a connection."""
        old = _stiffness(connection)
        return [
            (a, axis, float(1 / (1 / old[axis] + theta[a] / self.unit[row, a])))
            for a, axis in enumerate(self.axes[row])
            if self.active[row, a]
        ]


#: feet and joints of a structure by the cause that changes their stiffness
CONNECTIONS: Mapping[str, Callable[[Structure], Sequence[Support | Joint]]] = {
    "support_stiffness": lambda structure: structure.support,
    "joint_stiffness": lambda structure: structure.joint,
}


def _member_end(structure: Structure, connection: Support | Joint, axis: Axis) -> dict[str, Any]:
    """Return the member that a rotational spring holds, its end's stiffness about the axis, and whether it twists."""
    at, own = connection.at, getattr(connection, "member", None)
    members = [m for m in structure.member if (m.name == own if own else at in (m.start, m.end))]
    if axis not in TURNS or structure.external is not None or not members:
        return {}
    ends = [(*_end_stiffness(structure, member, axis), member.name) for member in members]
    stiffness, twists, name = max(ends)
    return {"member": name, "member_stiffness": stiffness, "twists": twists}


def _end_stiffness(structure: Structure, member: Member, axis: Axis) -> tuple[float, bool]:
    """Return 4 E I / L and G J / L of a member, as far as each acts about a global axis [N m/rad]; whether J does."""
    material, section = structure.material[member.material], structure.section[member.section]
    bending = [4 * material.youngs_modulus * moment for moment in section.second_moment]
    rigidity = np.array([material.shear_modulus * section.torsion_constant, *bending])
    share = member.axes[:, TURNS.index(axis)] ** 2
    return float(share @ rigidity) / member.length, bool(share[0] > 0.5)


def _stiffness(connection: Support | Joint) -> dict[Axis, float]:
    return dict(connection.stiffness.items())


def same_connection(one: Support | Joint, other: Support | Joint) -> bool:
    """Return whether two entries are the same foot, bearing or joint, with whatever springs."""
    return one.at == other.at and getattr(one, "member", None) == getattr(other, "member", None)


def propose_support_stiffness(reference: Reference, comparison: Comparison) -> Springs | None:
    """Return the supports that are held along or about some axis by a spring."""
    model = reference.model
    advice = "Tighten the foot's bolts, look at the bearing, and measure again."
    supports = reference.structure.support
    return _springs(
        "support_stiffness",
        advice,
        reference,
        comparison,
        [(s, axes, [model.support_rows(s.at, a) for a in axes]) for axes in (TURNS, SLIDES) for s in supports],
    )


def propose_joint_stiffness(reference: Reference, comparison: Comparison) -> Springs | None:
    """Return the joints."""
    model, joints = reference.model, reference.structure.joint
    advice = "Look at the joint's weld or bolts; sensors that turn with either side of it would show the hinge."
    rows: list[Connection] = [(j, TURNS, [model.joint_rows(j, a) for a in range(3)]) for j in joints]
    return _springs("joint_stiffness", advice, reference, comparison, rows)


Connection = tuple[Support | Joint, tuple[Axis, Axis, Axis], list[FloatArray]]


def _springs(
    name: str, advice: str, reference: Reference, comparison: Comparison, given: Sequence[Connection]
) -> Springs | None:
    """Return the springs among connections; each with three axes and the rows (n_dofs,) that read it there."""
    structure = reference.structure
    sprung = [one for one in given if set(one[1]) & set(_stiffness(one[0]))]
    if not sprung:
        return None
    stiffness, bending, unit = _stiffness_and_unit(structure, sprung)
    own, of_member = unit / stiffness, unit / bending
    both = np.zeros((*stiffness.shape, len(comparison.frequency) + comparison.n_stress))
    for i, (connection, axes, rows) in enumerate(sprung):
        for a, axis in enumerate(axes):
            if np.isfinite(stiffness[i, a]):
                both[i, a] = modal_spring_force(reference, connection, axis, rows[a])
    before_std = np.array([[reference.calibration.flexibility_std(c, a) for a in axes] for c, axes, _ in sprung])
    rigid = np.array([[reference.calibration.is_rigid(c, a) for a in axes] for c, axes, _ in sprung])
    which, active = _together(stiffness)
    couple = np.where(active[:, :, None], both[which], 0.0)
    lower = -0.999 * own[which]
    least = np.where(own > of_member, of_member - own, -0.999 * own)[which]
    square = (2 * np.pi * comparison.frequency[comparison.paired]) ** 2
    slope = -0.5 / unit[which][:, :, None] * square * couple[:, :, comparison.paired] ** 2
    first = np.maximum(first_order(comparison, slope, LOOSE)[0], least)
    return Springs(
        name=name,
        advice=advice,
        prior_std=np.full(3, LOOSE),
        lower=np.tile(lower, (2, 1)),
        drifting=True,
        comparison=comparison,
        structure=structure,
        connections=2 * tuple(sprung[i][0] for i in which),
        axes=2 * tuple(sprung[i][1] for i in which),
        active=np.tile(active, (2, 1)),
        before_std=np.tile(before_std[which], (2, 1)),
        rigid=np.tile(rigid[which], (2, 1)),
        unit=np.tile(unit[which], (2, 1)),
        couple=np.tile(couple, (2, 1, 1)),
        begun=np.concatenate([np.zeros(first.shape), first]),
    )


def _stiffness_and_unit(
    structure: Structure, sprung: Sequence[Connection]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (n, 3) stiffness about or along three axes, infinite where held, E I / L, and 1 / c of a parameter of one.

    The flexibility of a loose connection is so much larger (`LOOSE`): by E I / L where it turns, by its own spring
    where it slides. A free axis may lock. Of external matrices E I is unknown: each spring's own stiffness takes the
    place of E I / L, and each may become ten times as flexible.
    """
    stiffness = np.array([[_stiffness(c).get(a, np.inf) for a in axes] for c, axes, _ in sprung])
    if structure.external is not None:
        own = np.where(np.isfinite(stiffness), stiffness, 1.0)
        return stiffness, own, own * LOOSE / _SOFTER
    bending = np.array([[flexibility_unit(structure, a, c.at) for a in axes] for c, axes, _ in sprung])
    turning = np.array([[a in TURNS for a in axes] for _, axes, _ in sprung])
    usual = np.where(turning, np.maximum(LOOSE, bending / stiffness), np.maximum(_SOFTER * bending / stiffness, _GIVES))
    return stiffness, bending, bending * LOOSE / usual


def _together(stiffness: FloatArray) -> tuple[IndexArray, BoolArray]:
    """Return every set of springs that may change together: connection (n_sets,), and whether each axis (n_sets, 3).

    Parameters
    ----------
    stiffness : (n_connections, 3), infinite where nothing can change
    """
    sets = [
        (i, axes)
        for i in range(len(stiffness))
        for axes in itertools.product((False, True), repeat=3)
        if any(axes) and np.isfinite(stiffness[i, list(axes)]).all()
    ]
    return np.array([i for i, _ in sets]), np.array([axes for _, axes in sets])
