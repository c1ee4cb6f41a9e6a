"""A crack, a connection that gapes, play, or dry friction, as a hinge in a model and in its modes.

With the moment b^T x of displacements x in the hinge, and g that of a unit rotation with all nodes held, a hinge of
flexibility c changes the stiffness matrix to K - c / (1 + c g) b b^T. Of an element, g = b^T K_el^+ b, with the
pseudoinverse of its own stiffness matrix. The flexibility matrix becomes K^-1 + c / (1 + c r) a a^T, with a = K^-1 b
and r = g - b^T K^-1 b, the moment of a unit rotation in the structure at rest. It is zero only if the structure is
statically determinate: with redundant members, load is shifted to them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from daq import FloatArray
from updater.errors import ModelError
from updater.fe.eigen import Modes
from updater.fe.element import Element
from updater.fe.factorization import factorise
from updater.fe.model import Model
from updater.fe.section_forces import element_at, elements_between
from updater.quantities import Opens
from updater.structure import AXES, ON_MEMBER, BreathingCrack, Member, Structure

_COMPLETE = 1e-9  # of a hinge's flexibility beyond the modes: less is rounding
_ALIKE = 0.9  # correlation of the moment of a spring with that of a crack over the modes, at least


@dataclass(frozen=True, kw_only=True)
class Crack:
    """A crack of a member that is open on one side of a moment about a local axis, and closed on the other.

    Or it is open within, or beyond, a moment on both sides of zero, as play, or a joint that gapes under both signs. Or
    it slips with dry friction: a Coulomb slider in series with a spring, beside another spring (Iwan 1966). It is
    closed while it sticks, and open while it slides, until it turns back. It sticks until the moment has changed by
    twice that at which it slipped first.
    """

    member: str
    distance: float  #: from the member's start [m]
    axis: Literal["x", "y", "z"]
    flexibility: float  #: rotation per moment while it is open, over 1 / (E I) or 1 / (G J) [m]
    closed: float = 0.0  #: the same while it is closed [m]
    mean: float = 0.0  #: the same in the model [m]
    moment: float = 0.0  #: moment at which it opens, closes, or first slips [N m]
    opens: Opens = "above"  #: side of that moment on which it is open

    @classmethod
    def of(cls, structure: Structure) -> "Crack | None":
        """Return the crack of a structure file; None if it has none.

        Raises
        ------
        ModelError
            If there are several.
        """
        found = structure.breathing_crack
        if len(found) > 1:
            raise ModelError(f"breathing_crack: expected at most one in a simulation, found {len(found)}")
        return next((cls._of(structure, crack) for crack in found), None)

    @classmethod
    def _of(cls, structure: Structure, crack: BreathingCrack) -> "Crack":
        start = structure.member_named(crack.member).start
        known = {key: value for key, value in crack if key != "at"}
        return cls(distance=float(np.linalg.norm(np.subtract(crack.at, start))), **known)

    @property
    def side(self) -> float:
        """-1 if it opens below its moment, else 1."""
        return -1.0 if self.opens == "below" else 1.0

    @property
    def place(self) -> tuple[str, float, str]:
        """Member, distance from its start [m], and axis."""
        return self.member, self.distance, self.axis

    @property
    def action(self) -> int:
        """Number of its moment among the section forces."""
        return 3 + "xyz".index(self.axis)

    @property
    def by_sides(self) -> tuple[float, float]:
        """Flexibility on the near side of its moment, where zero is if it is positive, and on the far side."""
        both = self.closed, self.flexibility
        return both[::-1] if self.opens == "within" else both


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalCrack:
    """A crack in modes of a model and a residual shape, which together have all its flexibility.

    Moments are over root E I of the member without segments, and positive on the side on which the crack is open.
    """

    crack: Crack
    modes: Modes
    action: FloatArray  #: (n_modes,) moments of unit modal displacements
    opens: float  #: moment at which it opens, closes, or first slips
    stiffness: float  #: moment of a unit rotation with all displacements held, over E I [1/m]

    @classmethod
    def of(cls, crack: Crack, model: Model, modes: Modes) -> "ModalCrack":
        """Return the crack in modes, and in one shape more.

        The shape is the static one under the crack's rotation, less its part in the modes: a Ritz vector (Wilson, Yuan
        & Dickens 1982), orthogonal to them in mass and stiffness. It has the flexibility of all modes left out.

        Parameters
        ----------
        crack : on a member of the model
        model : of beam elements, with the mean flexibility of the crack
        modes : (n_modes,) of the model

        Raises
        ------
        ModelError
            If the model does not have the mean flexibility at the crack.

        References
        ----------
        Wilson, E. L., Yuan, M.-W. & Dickens, J. M. (1982). Dynamic analysis by direct superposition of Ritz vectors.
        Earthquake Engineering & Structural Dynamics 10(6), 813-821.
        """
        hinge = _Hinge.of(crack, model, modes)
        static = factorise(model.stiffness)(hinge.row)
        shape = static - modes.shape @ (modes.shape.T @ (model.mass @ static))
        stiffness = float(shape @ (model.stiffness @ shape))
        if stiffness > _COMPLETE * float(hinge.row @ static):
            mass = float(shape @ (model.mass @ shape))
            frequency = np.append(modes.frequency, np.sqrt(stiffness / mass) / (2 * np.pi))
            shape /= np.sqrt(mass)
            modes = Modes(frequency=frequency, shape=np.column_stack([modes.shape, shape]))
        return cls(
            crack=crack,
            modes=modes,
            action=hinge.row @ modes.shape,
            opens=crack.side * crack.moment / float(np.sqrt(_rigidity(crack, model))),
            stiffness=hinge.stiffness,
        )


def _rigidity(crack: Crack, model: Model) -> float:
    """Return E I, or G J, of the member without segments [N m2]."""
    structure = model.structure
    return structure.rigidity(structure.member_named(crack.member))[crack.action - 3]


@dataclass(frozen=True, eq=False)
class _Hinge:
    """A hinge in a flexible part of a model; moments as for `ModalCrack`."""

    row: FloatArray  #: (n_dofs,) moment of unit displacements
    stiffness: float  #: moment of a unit rotation with all nodes held, over E I [1/m]

    @classmethod
    def of(cls, crack: Crack, model: Model, modes: Modes) -> "_Hinge":
        """Return the hinge in the element at the place; one with a mean flexibility in the softest part there.

        Such a part is a segment of the member, or a spring of a support or of a joint. It has more flexibility than the
        crack lacks of its mean while it is closed.
        """
        member = model.structure.member_named(crack.member)
        span, start = element_at(model, member, crack.distance)
        share = (crack.distance - start) / model.elements[span][2].length
        in_element = cls._in_elements(crack, model, [(span, share, 1.0)])
        if not crack.mean:
            return in_element
        parts = [*cls._in_segments(crack, model, member), *in_element.in_springs(crack, model, modes)]
        least = crack.mean - min(crack.closed, crack.flexibility)
        own = max((1 / hinge.stiffness for hinge in parts), default=0.0)
        if own <= least:
            raise ModelError(
                f"breathing_crack of {crack.member}: expected more than {least:.4g} m of its mean flexibility in a "
                f"segment, support or joint at its place, found {own:.4g} m"
            )
        return min(parts, key=lambda hinge: hinge.stiffness)

    @classmethod
    def _in_elements(cls, crack: Crack, model: Model, parts: Sequence[tuple[int, float, float]]) -> "_Hinge":
        """Return a hinge by numbers of elements, its share of the length of each, and the part of its rotation there.

        Nodal forces are those of rotations of both ends, against each other.
        """
        row, stiffness, rigidity = np.zeros(model.n_dofs), 0.0, _rigidity(crack, model)
        for span, share, part in parts:
            first, last, element = model.elements[span]
            assert isinstance(element, Element)
            turned = np.zeros(12)
            turned[[crack.action, 6 + crack.action]] = -(1 - share) * part, share * part
            force = element.elastic_stiffness @ turned
            stiffness += float(turned @ force) / rigidity
            dofs = model.dofs[[first, last]].ravel()
            nodal = force @ element.rotation(model.nodes[last] - model.nodes[first])
            np.add.at(row, dofs[dofs >= 0], nodal[dofs >= 0] / np.sqrt(rigidity))
        return cls(crack.side * row, stiffness)

    @classmethod
    def _in_segments(cls, crack: Crack, model: Model, member: Member) -> list["_Hinge"]:
        """Return hinges of one curvature over the length of each segment at the place."""
        found = []
        for start, end, _ in model.structure.segments_of(member):
            if start - ON_MEMBER <= crack.distance <= end + ON_MEMBER:
                spans = elements_between(model, member, start, end)
                lengths = np.array([model.elements[span][2].length for span in spans])
                parts = (lengths / lengths.sum()).tolist()
                found.append(
                    cls._in_elements(crack, model, [(span, 0.5, p) for span, p in zip(spans, parts, strict=True)])
                )
        return found

    def in_springs(self, crack: Crack, model: Model, modes: Modes) -> list["_Hinge"]:
        """Return hinges in series with the springs at the place whose moment is that of this hinge in the modes."""
        structure, found = model.structure, []
        at = structure.member_named(crack.member).point(crack.distance)
        own = self.row @ modes.shape / modes.omega
        for (_, place, axis), (turn, stiffness) in model.spring_rows().items():
            if axis in AXES[:3] or np.linalg.norm(np.subtract(place, at)) > ON_MEMBER:
                continue
            moment = stiffness * turn
            in_spring = moment @ modes.shape / modes.omega
            shared, square = float(own @ in_spring), float(in_spring @ in_spring)
            if shared**2 > _ALIKE**2 * square * float(own @ own):
                ratio = shared / square
                found.append(_Hinge(ratio * moment, ratio**2 * stiffness))
        return found
