"""Play in a foot, and a foot that gapes under both signs, distinguished by the signals of one window."""

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from monitor.analysis.observation import observe
from monitor.rig import World, load_scenario, shipped_scenarios
from monitor.text.causes import breathing_text
from tests.end_to_end.test_rig_crack import SECONDS, START, WINDOWS, windows
from tests.support.portals.cracked_portal import OVER, PARTS, RATE, SETTLING, Crack, CrackedPortal, forces, records
from tests.support.portals.tube_portal import Portal
from updater import dump_structure, parse_structure, t_structure_toml
from updater.quantities import Law

PORTAL = Portal(0.018, 0.015, 0.0015, 1.0, 1.175)
PLAY, GAPES = Crack(0.0, 0.12, threshold=1.0, opens="within"), Crack(0.0, 0.12, threshold=1.0, opens="beyond")


@pytest.mark.thorough
@pytest.mark.parametrize(("foot", "law", "seed"), [(PLAY, "within", 1), (GAPES, "beyond", 2)])
def test_foot_that_opens_on_both_sides(foot: Crack, law: Law, seed: int) -> None:
    """Law, share and time within three stated deviations, and the flexibility while open."""
    before, _ = records(PORTAL, foot.healthy, 2 * seed, "white")
    after, open_time = records(PORTAL, foot, 2 * seed + 1, "white")
    (cause,) = explain(PORTAL.file(), observe(before), observe(after)).diagnosis.causes
    found = cause.breathing
    print(f"seed {seed}, open {open_time:.3f}", cause, breathing_text(cause))
    assert "support_stiffness" in {cause.cause, *cause.cannot_be_told_from}
    assert found
    assert found.law == law
    assert abs(found.share.value - foot.share(open_time)) < 3 * found.share.std
    assert found.open_time
    assert abs(found.open_time.value - open_time) < 3 * found.open_time.std
    assert found.opening
    assert (found.opening.member, found.opening.axis, found.opening.opens) == ("left post", "y", law)
    # the healthy hinge of the truth has 1 mm, which calibration adds to the foot
    assert abs(found.opening.flexibility.value - 0.119) < 3 * found.opening.flexibility.std


@pytest.mark.thorough
def test_play_of_the_virtual_rig_is_named_and_predicts_signals() -> None:
    """The shipped scenario; the extended model has the play, and predicts windows that were not used."""
    scenario = load_scenario(shipped_scenarios()["play-in-foot"])
    print(f"seed {scenario.seed}")
    event = scenario.event[0].model_copy(update={"at": WINDOWS * SECONDS})
    world = World(parse_structure(t_structure_toml()), scenario.model_copy(update={"event": (event,)}))
    world.sample(START)
    (loose,) = world.begin(START)
    structure = parse_structure(t_structure_toml())
    before, after, heldout = (
        observe(windows(world, structure, scenario.device, at))
        for at in (START, loose, loose + WINDOWS * SECONDS * 10**9)
    )
    found = explain(structure, before, after, heldout)
    (cause,) = found.diagnosis.causes
    print(cause, breathing_text(cause))
    assert "support_stiffness" in {cause.cause, *cause.cannot_be_told_from}
    assert cause.where
    assert cause.where.position == pytest.approx((0.0, 0.0, 0.0), abs=0.03)
    assert cause.breathing
    assert cause.breathing.law == "within"
    opening, gain = cause.breathing.opening, cause.breathing.heldout
    assert opening
    assert abs(opening.flexibility.value - 0.015) < 3 * opening.flexibility.std
    assert abs(opening.closed.value) < 3 * opening.closed.std
    assert abs(opening.moment.value - 0.006) < 3 * opening.moment.std
    assert gain
    assert gain.log_likelihood.value > 5 * gain.log_likelihood.std
    assert found.explained.extended
    (played,) = parse_structure(dump_structure(found.explained.extended)).breathing_crack
    assert (played.member, played.axis, played.opens) == ("column", "y", "within")


@pytest.mark.thorough
def test_foot_with_dry_friction_moves_as_with_a_slider_in_small_steps() -> None:
    """The slider of each small step is that of the last one: late by at most a sixteenth of a step."""
    portal, n_steps = CrackedPortal(PORTAL, Crack(0.0, 0.12)), 2000
    force = forces(3, "white")[:n_steps, :, :1]
    print("seed 3")
    before = np.zeros((SETTLING * RATE * OVER, *force.shape[1:]))
    sliding, sticking = portal.change
    state, u, limit, expected = np.zeros(2 * len(portal.square)), 0.0, 3e-6, []
    moves, by_force, read = portal.transitions(sticking)
    for own in force[:, :, 0] @ portal.at_forces:
        push = own - (sliding - sticking) * u * portal.jump
        expected.append(read @ state + portal.at_sensors @ push)
        for _ in range(PARTS):
            state = moves[1] @ state + by_force[1] @ (own - (sliding - sticking) * u * portal.jump)
            turned = float(portal.jump @ state[: len(portal.square)])
            u = min(max(u, turned - limit), turned + limit)
    found, slides = (one[..., 0] for one in portal.run(np.concatenate([before, force]), limit, "slips"))
    stuck, _ = portal.run(np.concatenate([before, force]), 1e9, "beyond")
    rms = float(np.std(expected))
    print(f"slides {100 * slides.mean():.0f} %, off {np.abs(found - expected).max() / rms:.4f} of the deviation")
    assert 0.05 < slides.mean() < 0.8
    assert np.abs(stuck[..., 0] - expected).max() > 0.5 * rms
    np.testing.assert_allclose(found, expected, atol=0.05 * rms)
