"""Bodies on springs of their own, in the model: closed forms."""

import numpy as np
import pytest

from tests.support.updater.frames import ROD
from tests.support.updater.reference_frame import t_frame
from updater import StructureError, build_model, dump_structure, parse_structure, t_structure_toml
from updater.structure import Oscillator

WITH_OSCILLATOR = f"""{ROD}
[[oscillator]]
at = [1, 0, 0]
direction = [3, 0, 0]
mass = 0.1
frequency = 30.0
"""


def test_two_masses_in_series_match_the_closed_form() -> None:
    """k = EA/L = 1e5 N/m holds 2 kg, and 100 g are attached at 30 Hz."""
    found = build_model(parse_structure(WITH_OSCILLATOR), mass="consistent").modes(2).frequency
    k, m, own, spring = 1e5, 2.0, 0.1, 0.1 * (60 * np.pi) ** 2
    sum_, product = (k + spring) / m + spring / own, k * spring / (m * own)
    omega2 = np.roots([1, -sum_, product])
    np.testing.assert_allclose(found, np.sort(np.sqrt(omega2)) / (2 * np.pi), rtol=1e-6)


def test_oscillator_acts_as_a_rigid_body_across_its_direction() -> None:
    """As if of infinite stiffness: the frame's modes that it does not move along are those with a body."""
    structure = t_frame()
    at = (0.0, 0.0, 1.48)
    slow = Oscillator(at=at, direction=(0, 0, 1), mass=0.3, frequency=5.0)
    hung = structure.model_copy(update={"oscillator": (slow,)})
    model = build_model(hung, shear_flexible=True, mass="consistent")
    fast = structure.model_copy(update={"oscillator": (slow.model_copy(update={"frequency": 1e4}),)})
    stiff = build_model(fast, shear_flexible=True, mass="consistent")
    clamped = build_model(
        parse_structure(t_structure_toml() + f"\n[[body]]\nat = {list(at)}\nmass = 0.3\n"),
        shear_flexible=True,
        mass="consistent",
    )
    np.testing.assert_allclose(stiff.modes(8).frequency, clamped.modes(8).frequency, rtol=1e-5)
    assert model.total_mass() == pytest.approx(build_model(structure).total_mass() + 0.3)
    # 5 Hz is far below the column's stretching: the oscillator moves alone, the two bending modes carry it
    assert model.modes(1).frequency[0] == pytest.approx(5.0, rel=1e-3)
    np.testing.assert_allclose(model.modes(3).frequency[1:], clamped.modes(2).frequency, rtol=1e-4)


def test_oscillator_is_written_and_read_back() -> None:
    structure = parse_structure(WITH_OSCILLATOR)
    assert parse_structure(dump_structure(structure)) == structure
    other = Oscillator(at=(0.5, 0, 0), direction=(0, 1, 0), mass=1, frequency=2)
    more = structure.model_copy(update={"oscillator": (*structure.oscillator, other)})
    text = dump_structure(more, WITH_OSCILLATOR, note="found")
    assert parse_structure(text) == more
    assert text.startswith(WITH_OSCILLATOR.rstrip())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("direction = [3, 0, 0]", "direction = [0, 0, 0]", "the direction is zero"),
        ("at = [1, 0, 0]\ndirection", "at = [1, 0, 1]\ndirection", "oscillator: [1.0, 0.0, 1.0] lies on no member"),
        ("frequency = 30.0", "frequency = -1", "oscillator.0.frequency"),
    ],
)
def test_invalid_oscillator_is_named_in_the_error(old: str, new: str, message: str) -> None:
    assert old in WITH_OSCILLATOR
    with pytest.raises(StructureError) as caught:
        parse_structure(WITH_OSCILLATOR.replace(old, new))
    assert message in str(caught.value)
