"""Sections with width and height exchanged in the file.

Modes are of Bernoulli elements of their own (`tests.support.portals.tube_portal`), with other stiffness of the feet
than in the file.
"""

from collections.abc import Sequence

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation
from monitor.errors import StateError
from monitor.text.diagnosis import exchanged_text, note_texts
from monitor.text.verdicts import verdict_text
from tests.support.portals.measured_modes import observed
from tests.support.portals.tube_portal import LEFT, Load, Portal
from tests.support.thorough import few_of
from updater import Structure
from updater.modal_data import mean_modes
from updater.quantities import ExchangedSections
from updater.reference import exchanged_sections

POSTS, BEAM = ("left post", "right post"), ("beam",)


def _drawn(seed: int, stream: int = 93) -> tuple[Portal, float, np.random.Generator]:
    """Return a portal whose sides differ by a tenth or more, the stiffness of its right foot and its generator."""
    random = np.random.default_rng((seed, stream))
    short, wall = random.uniform((0.012, 0.001), (0.018, 0.002))
    sides = short * np.array([1.0, random.uniform(1.1, 1.6)])
    height, width = random.uniform((0.7, 0.8), (1.1, 1.4))
    across, along = random.permutation(sides).tolist()
    portal = Portal(across, along, float(wall), float(height), float(width))
    return portal, LEFT * float(np.exp(random.uniform(-1.5, 1.5))), random


def _exchanged(file: Structure, members: Sequence[str]) -> Structure:
    """Return a file in which the section of members has its second moments exchanged."""
    right = file.section["tube"]
    wrong = right.model_copy(update={"second_moment": right.second_moment[::-1]})
    own = (m.model_copy(update={"section": "wrong" if m.name in members else "tube"}) for m in file.member)
    return file.model_copy(update={"section": {"tube": right, "wrong": wrong}, "member": tuple(own)})


def _observed(portal: Portal, foot: float, random: np.random.Generator) -> Observation:
    frequency, shape, _ = portal.modes(foot)
    return observed(portal, frequency, shape, 0, random)


@pytest.mark.parametrize(
    ("members", "seed"), few_of([(m, seed) for seed in range(16) for m in ((), BEAM, POSTS, POSTS + BEAM)])
)
def test_members_with_exchanged_dimensions_are_named(members: tuple[str, ...], seed: int) -> None:
    portal, foot, random = _drawn(seed)
    file = _exchanged(portal.file(), members)
    found = exchanged_sections(file, mean_modes(_observed(portal, foot, random).modes))
    print(seed, portal, foot, found)
    assert (found.members if found else ()) == members


def _rigid(file: Structure) -> Structure:
    feet = (
        one.model_copy(update={"stiffness": {}, "fixed": ("x", "y", "z", "rx", "ry", "rz")}) for one in file.support
    )
    return file.model_copy(update={"support": tuple(feet)})


@pytest.mark.parametrize("seed", few_of(list(range(6))))
@pytest.mark.parametrize(
    "members", [POSTS, *(pytest.param(one, marks=pytest.mark.thorough) for one in (BEAM, POSTS + BEAM))]
)
def test_exchanged_members_of_a_file_with_rigid_feet_are_named(seed: int, members: tuple[str, ...]) -> None:
    portal, foot, random = _drawn(seed)
    file = _rigid(_exchanged(portal.file(), members))
    found = exchanged_sections(file, mean_modes(_observed(portal, foot, random).modes))
    print(seed, portal, foot, found)
    assert found
    assert found.members == members


def _other_moments(file: Structure, random: np.random.Generator) -> Structure:
    right = file.section["tube"]
    moments = np.array(right.second_moment) * random.uniform(0.85, 1.15, 2)
    wrong = right.model_copy(update={"second_moment": tuple(moments.tolist())})
    return file.model_copy(update={"section": {"tube": wrong}})


def _swapped(file: Structure, random: np.random.Generator) -> Structure:
    """Return a file with the channels of two sensors exchanged."""
    sensors = list(file.sensor)
    i, j = random.choice(len(sensors), 2, replace=False).tolist()
    one, other = sensors[i].channel, sensors[j].channel
    sensors[i], sensors[j] = (sensors[k].model_copy(update={"channel": name}) for k, name in ((i, other), (j, one)))
    return file.model_copy(update={"sensor": tuple(sensors)})


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(8))
def test_other_errors_of_the_file_are_no_exchange(seed: int) -> None:
    """No exchange with rigid feet, other second moments, exchanged channels, several of these, or a missing body."""
    portal, foot, random = _drawn(seed, 94)
    right, file = mean_modes(_observed(portal, foot, random).modes), portal.file()
    at, mass = random.uniform(0.2, 0.9), random.uniform(0.3, 2.0)
    frequency, shape, _, _ = portal.loaded(Load("beam", float(at), float(mass), (0.0, 0.0, 0.0)))
    loaded = mean_modes(observed(portal, frequency, shape, 0, random).modes)
    for wrong, modes in (
        (_rigid(file), right),
        (_other_moments(file, random), right),
        (_swapped(file, random), right),
        (_rigid(_other_moments(file, random)), right),
        (_rigid(_swapped(file, random)), right),
        (file, loaded),
        (_rigid(file), loaded),
    ):
        assert exchanged_sections(wrong, modes) is None


def test_unexplained_change_has_a_note_on_the_sections() -> None:
    portal, foot, random = _drawn(2)
    file = _exchanged(portal.file(), POSTS + BEAM)
    before = _observed(portal, foot, random)
    frequency, shape, _, _ = portal.loaded(Load("beam", 0.7, 0.2, (0.0, 0.0, 0.0)))
    now = observed(portal, frequency, shape, 10, random)
    diagnosis = explain(file, before, now, only=("temperature",)).diagnosis
    print(diagnosis.verdict, note_texts(diagnosis))
    assert diagnosis.exchanged_sections
    assert diagnosis.exchanged_sections.members == POSTS + BEAM
    start = "The frequencies fit with width and height of the section of left post, right post and beam exchanged"
    assert note_texts(diagnosis)[0].startswith(start)
    assert exchanged_sections(portal.file(), mean_modes(before.modes)) is None


@pytest.mark.parametrize(("members", "only"), few_of([(POSTS, ("support_stiffness",)), (POSTS, ()), (BEAM, ())], 0))
def test_change_is_unexplained_by_a_model_that_does_not_fit_the_reference(
    members: tuple[str, ...], only: tuple[str, ...]
) -> None:
    """A foot softens by 65 %; exchanged sections of some members leave 6 % of the frequencies, a right file 0.1 %."""
    portal, random = Portal(0.025, 0.02, 0.002, 0.9, 1.2), np.random.default_rng(96)
    before, now = _observed(portal, LEFT, random), _observed(portal, 0.35 * LEFT, random)
    found = explain(_rigid(_exchanged(portal.file(), members)), before, now, only=only).diagnosis
    print(found)
    assert found.verdict == "unexplained"
    assert found.calibration
    assert not found.calibration.fits_reference
    assert verdict_text(found).startswith("Unexplained: the model does not fit the reference logs. ")
    right = explain(_rigid(portal.file()), before, now, only=("support_stiffness",)).diagnosis
    assert right.verdict == "explained"
    assert right.calibration
    assert right.calibration.fits_reference


def test_modes_without_a_partner_are_explained_by_the_sections() -> None:
    """Frequencies of a flat section differ by more than 30 % if it is turned: no mode has a partner."""
    portal = Portal(0.024, 0.009, 0.001, 1.0, 1.2)
    before = _observed(portal, LEFT, np.random.default_rng(95))
    with pytest.raises(StateError, match=r"are paired with one.* width and height of the section"):
        explain(_exchanged(portal.file(), POSTS + BEAM), before, before)


def test_text_without_pairs_in_the_file() -> None:
    found = ExchangedSections(
        members=("mast",), paired=0, paired_exchanged=8, error_percent=None, error_percent_exchanged=0.123
    )
    assert "of mast exchanged (0.12 % rms, 8 modes; as in the file: too few modes)" in exchanged_text(found)
