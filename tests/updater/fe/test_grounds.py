"""Supports on a floor with a mode of its own, in the model: closed form and another model."""

import numpy as np
import pytest

from tests.examiner.designs import PORTAL
from tests.examiner.models.frame import Floor, Frame
from tests.support.updater.frames import LINE, ROD
from tests.support.updater.reference_frame import t_frame
from updater import StructureError, build_model, dump_structure, parse_structure, t_structure_toml
from updater.fe import self_stress
from updater.structure import AXES, Ground

ON_GROUND = f"""{ROD}
[[ground]]
at = [[0, 0, 0]]
axis = "x"
mass = 3.0
frequency = 20.0
"""


def test_foot_on_a_floor_matches_two_masses_in_series() -> None:
    """2 kg on k = EA/L = 1e5 N/m, on 3 kg at 20 Hz. The fixed foot is held a million times as stiff as the floor."""
    found = build_model(parse_structure(ON_GROUND), mass="consistent").modes(2).frequency
    k, m, own, spring = 1e5, 2.0, 3.0, 3.0 * (40 * np.pi) ** 2
    sum_, product = k / m + (k + spring) / own, k * spring / (m * own)
    np.testing.assert_allclose(found, np.sort(np.sqrt(np.roots([1, -sum_, product]))) / (2 * np.pi), rtol=1e-5)


@pytest.mark.parametrize("axis", [0, 1, 2, 3, 4])
def test_slab_under_both_feet_has_the_modes_of_another_model(axis: int) -> None:
    """Elements of the other model are quadratic: without the slab its lowest frequencies differ by up to 0.1 %."""
    slab = Floor(grounds=(0, 1), axis=axis, mass=60.0, frequency=14.0)
    frame = Frame(bars=PORTAL.bars, grounds=PORTAL.grounds, meetings=PORTAL.meetings, floors=(slab,))
    feet = tuple(frame.bar(g.bar).point(g.s) for g in frame.grounds)
    structure = parse_structure(PORTAL.toml())
    ground = Ground(at=feet, axis=AXES[axis], mass=slab.mass, frequency=slab.frequency)
    model = build_model(structure.model_copy(update={"ground": (ground,)}), shear_flexible=True, mass="consistent")
    expected = frame.solved(6).frequency
    print(expected)
    np.testing.assert_allclose(model.modes(6).frequency, expected, rtol=3e-3)


STIFF = LINE.replace("1e9", "2e15").replace("4e8", "8e14")
ROCKER = f"""{STIFF}
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "rz"]
[[support]]
at = [0.02, 0, 0]
fixed = ["z"]
[[body]]
at = [1, 0, 0]
mass = 2.0
[[ground]]
at = [[0, 0, 0], [0.02, 0, 0]]
axis = "ry"
mass = 3.0
frequency = 2.0
"""


def test_feet_near_the_axis_of_a_rocking_ground_turn_with_it() -> None:
    """2 kg at 0.99 m from the axis, on 3 kg m2 at 2 Hz. Both feet are 10 mm from the axis."""
    found = build_model(parse_structure(ROCKER)).modes(1).frequency[0]
    assert found == pytest.approx(2.0 * np.sqrt(3.0 / (3.0 + 2.0 * 0.99**2)), rel=1e-5)


def test_foot_on_two_grounds_does_not_depend_on_their_order() -> None:
    at = (t_frame().support[0].at,)
    stiff = Ground(at=at, axis="x", mass=1e5, frequency=300.0)
    soft = Ground(at=at, axis="x", mass=1e-3, frequency=3.0)
    one, other = (t_frame().model_copy(update={"ground": both}) for both in ((stiff, soft), (soft, stiff)))
    first, second = (build_model(structure).modes(6).frequency for structure in (one, other))
    np.testing.assert_allclose(first, second, rtol=1e-6)
    for structure in (one, other):
        assert structure.grounded_supports[0].stiffness["x"] == pytest.approx(1e6 * soft.stiffness)


def test_floor_under_all_supports_restrains_nothing_of_a_determinate_structure() -> None:
    ground = Ground(at=((0.0, 0.0, 0.0),), axis="x", mass=10.0, frequency=20.0)
    assert self_stress(build_model(t_frame().model_copy(update={"ground": (ground,)}))).n == 0


def test_ground_is_written_and_read_back() -> None:
    structure = parse_structure(ON_GROUND)
    assert parse_structure(dump_structure(structure)).ground == structure.ground


def test_ground_without_a_support_is_refused() -> None:
    text = t_structure_toml() + '\n[[ground]]\nat = [[0, 0, 1]]\naxis = "x"\nmass = 1\nfrequency = 1\n'
    with pytest.raises(StructureError, match=r"ground along x: there is no support at \[0.0, 0.0, 1.0\]"):
        parse_structure(text)


def test_support_given_twice_is_refused() -> None:
    text = ON_GROUND.replace("at = [[0, 0, 0]]\n", "at = [[0, 0, 0], [0, 0, 0]]\n")
    with pytest.raises(StructureError, match=r"ground along x: the support at \[0.0, 0.0, 0.0\] is given twice"):
        parse_structure(text)
