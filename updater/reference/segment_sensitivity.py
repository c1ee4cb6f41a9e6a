"""Sensitivities of frequencies to stretches of members, such as welds and springs of walls, and the error of springs.

A wall that bends has inertia. Below its own lowest frequency f_w, its flexibility at a frequency f exceeds the static
one by a share of (f / f_w)^2, as that of an oscillator. A spring has one flexibility for all modes: the frequency of
each mode is in error by its sensitivity to the spring times this share. The share has a factor for each spring, since
moments and forces bend the wall to different shapes, and this factor is the same in all modes.
"""

from collections.abc import Callable

import numpy as np

from daq import FloatArray
from updater.fe import Element, Model, Modes, parts_between
from updater.structure import WALL_ACTIONS, Axis, Wall, walls_with_springs

_STEP = 1e-4  # of ln of a factor, in the finite difference of an element's matrix


def slope_by_factor(
    modes: Modes, parts: list[tuple[Element, FloatArray]], with_factor: Callable[[Element, float], Element]
) -> FloatArray:
    """Return d ln omega (n_modes,) by the logarithm of a factor on elements' stiffness, their part of b^T dK b.

    Parameters
    ----------
    parts : elements, each with shapes (12, n_modes) in its own axes
    with_factor : an element with a factor
    """
    gained = np.zeros(len(modes.omega))
    for element, local in parts:
        more, fewer = (with_factor(element, float(np.exp(h))) for h in (_STEP, -_STEP))
        change = (more.elastic_stiffness - fewer.elastic_stiffness) @ local / (2 * _STEP)
        gained += (local * change).sum(0)
    return np.asarray(gained / (2 * modes.omega**2))


def slope_by_spring(model: Model, modes: Modes, wall: Wall, axis: Axis) -> FloatArray:
    """Return d ln omega (n_modes,) by the logarithm of the factor of the segment with a wall's spring [-]."""
    parts = parts_between(model, modes.shape, wall.branch, *wall.span(axis))
    action = WALL_ACTIONS[axis]
    return slope_by_factor(modes, parts, lambda element, factor: element.with_factor(action, factor))


def wall_errors(model: Model, modes: Modes) -> FloatArray:
    """Return the relative errors (n_modes, n_springs) of frequencies by the inertia of walls, one for each spring.

    Parameters
    ----------
    model : with the springs in its structure
    modes : of it
    """
    found = [
        slope_by_spring(model, modes, wall, axis) * (modes.frequency / wall.frequency) ** 2
        for wall in walls_with_springs(model.structure)
        for axis in wall.springs(model.structure.segment)
    ]
    return np.array(found).reshape(-1, len(modes.omega)).T
