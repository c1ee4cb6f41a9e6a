"""Section forces of modes along the members of a frame: forces, torque and bending moments.

The flexibility that a softer stretch adds is the integral of its actions squared, the unit-load method: dF_rs =
sum_k int (1/s - 1) A_kr A_ks / D_k dx, with D = (E A, kappa G A_y, kappa G A_z, G J, E I_y, E I_z).
"""

from collections import defaultdict
from collections.abc import Collection, Iterator

import numpy as np

from daq import FloatArray, IndexArray
from updater.fe.eigen import Modes
from updater.fe.element import Element
from updater.fe.model import Model
from updater.structure import Member

N_ACTIONS = 6  # axial force, shear along y and z, twist, bending about y and z
_TOTAL = (3, 4, 5)  # that follow from dynamic equilibrium at an element's ends


def weighted_actions(model: Model, modes: Modes, stations: dict[int, FloatArray]) -> dict[int, FloatArray]:
    """Return the actions at stations along members, each over the root of the stiffness that bears it.

    At an element's ends moments and twist are those of dynamic equilibrium, (K - omega^2 M) b, continuous from one
    element to the next; in between a parabola has the mean that turns the ends against each other as they are turned.

    Parameters
    ----------
    model : of beam elements
    modes : (n_modes,) of the model
    stations : number of a member -> distances from its start (n,) [m]

    Returns
    -------
    dict
        Number of the member -> (n, 6, n_modes), unit elastic energy a metre [sqrt(J/m)].
    """
    found = {}
    for m, at in stations.items():
        found[m] = np.empty((len(at), N_ACTIONS, modes.shape.shape[1]))
        for span, start, here in _spans_at(model, model.structure.member[m], at):
            found[m][here] = _within(model, modes, span, at[here] - start)
    return found


def section_rigidity(model: Model, member: Member, at: FloatArray) -> FloatArray:
    """Return the stiffness that bears each action (n, 6) at stations (n,) from a member's start [m], [N] and [N m2]."""
    found = np.empty((len(at), N_ACTIONS))
    for span, _, here in _spans_at(model, member, at):
        element = model.elements[span][2]
        assert isinstance(element, Element)
        found[here] = element.rigidity
    return found


def element_at(model: Model, member: Member, at: float) -> tuple[int, float]:
    """Return the number of the element at a distance from a member's start, and its own distance [m]."""
    ((span, start, _),) = _spans_at(model, member, np.array([at]))
    return span, start


def _spans_at(model: Model, member: Member, at: FloatArray) -> Iterator[tuple[int, float, IndexArray]]:
    """Yield the elements with stations (n,) of a member: number, start [m], stations in it."""
    own = sorted((_distance(model, member, i), i) for i in model.elements_of[member.name])
    starts = np.array([start for start, _ in own])
    which = np.clip(np.searchsorted(starts, at, side="right") - 1, 0, len(own) - 1)
    for k in np.unique(which):
        start, span = own[k]
        yield span, start, np.flatnonzero(which == k)


def elastic_energy(model: Model, shape: FloatArray, members: Collection[str]) -> FloatArray:
    """Return twice the elastic energy of shapes in the elements of some members.

    Parameters
    ----------
    model : of beam elements
    shape : (n_dofs, n_modes) displacements [m] and rotations [rad]
    members : names of the members

    Returns
    -------
    (n_modes,)
        [J]; with shapes of unit modal mass [1/s2].
    """
    kinds = defaultdict(list)  # elements of one matrix and direction
    for name, span in zip(model.member_names, model.elements, strict=True):
        if name in members:
            kinds[id(span[2])].append(span)
    held = np.vstack([shape, np.zeros(shape.shape[1])])  # the last row is that of held DOFs
    energy = np.zeros(shape.shape[1])
    for spans in kinds.values():
        first, last, element = spans[0]
        assert isinstance(element, Element)
        dofs = model.dofs[[span[:2] for span in spans]].reshape(len(spans), 12)
        local = element.rotation(model.nodes[last] - model.nodes[first]) @ held[dofs]
        energy += (local * (element.elastic_stiffness @ local)).sum((0, 1))
    return energy


def parts_between(
    model: Model, shape: FloatArray, member: Member, start: float, end: float
) -> list[tuple[Element, FloatArray]]:
    """Return the elements on a part of a member, each with shapes (12, n_modes) in its own axes [m, rad].

    Parameters
    ----------
    model : of beam elements
    shape : (n_dofs, n_modes) displacements [m] and rotations [rad]
    member : one of the structure
    start, end : distances from the start of the member [m]
    """
    return [_local(model, shape, i) for i in elements_between(model, member, start, end)]


def elements_between(model: Model, member: Member, start: float, end: float) -> list[int]:
    """Return the numbers of the elements on a part of a member, given by distances from its start [m]."""
    return [i for i in model.elements_of[member.name] if start < _middle(model, member, i) < end]


def _local(model: Model, shape: FloatArray, span: int) -> tuple[Element, FloatArray]:
    """Return an element, and shapes (12, n_modes) at its ends in its own axes."""
    first, last, element = model.elements[span]
    assert isinstance(element, Element)
    axes = element.axes(model.nodes[last] - model.nodes[first])
    dofs = np.concatenate([model.dofs[first], model.dofs[last]])
    moved = np.where(dofs[:, None] >= 0, shape[dofs], 0.0)
    return element, np.asarray(axes @ moved.reshape(4, 3, -1), float).reshape(12, -1)


def _distance(model: Model, member: Member, span: int) -> float:
    return float(np.linalg.norm(model.nodes[model.elements[span][0]] - member.start))


def _middle(model: Model, member: Member, span: int) -> float:
    first, last, _ = model.elements[span]
    return float(np.linalg.norm((model.nodes[first] + model.nodes[last]) / 2 - member.start))


def _within(model: Model, modes: Modes, span: int, x: FloatArray) -> FloatArray:
    """Return the actions (n, 6, n_modes) of one element at distances x (n,) from its start."""
    element, local = _local(model, modes.shape, span)
    elastic = element.elastic_stiffness @ local
    total = element.stiffness @ local - element.consistent_mass @ local * modes.omega**2
    inner = np.array([-elastic[:6], elastic[6:]])  # section forces of the left part at either end
    mean = inner.mean(0)
    inner[:, _TOTAL] = np.array([-total[:6], total[6:]])[:, _TOTAL]
    xi = (x / element.length)[:, None, None]
    bulge = 6 * xi * (1 - xi) * (mean - inner.mean(0))
    rigidity = element.rigidity.copy()
    if not element.shear_flexible:
        rigidity[[1, 2]] = np.inf
    return np.asarray((inner[0] * (1 - xi) + inner[1] * xi + bulge) / np.sqrt(rigidity)[:, None])
