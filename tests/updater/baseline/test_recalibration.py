"""A reference of a frame whose file is far off: recalibrated until all modes are paired, and its use."""

import numpy as np
import pytest

from monitor.analysis.observation import Observation
from tests.examiner.designs import BRIDGE
from tests.examiner.models.specimen import State
from tests.examiner.models.storeys import FOOT, LOOSE_FOOT, as_it_stands, toml, with_channels, with_loose_foot
from tests.examiner.path import observation, structure_of
from tests.examiner.signals import estimated
from tests.support.thorough import few_of
from updater import Reference, diagnose, learn_reference, parse_structure
from updater.reference import matched_surely

STRUCTURE = parse_structure(toml())


def observed(state: State, n_windows: int, random: np.random.Generator) -> Observation:
    return observation(state, estimated(state, n_windows, random, noise="law"))


def learnt(before: Observation) -> Reference:
    return learn_reference(STRUCTURE, before.estimates, before.tracks, before.lateness.delays)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", few_of([1, 2]))
def test_loosened_foot_stiffness_is_within_its_stated_deviations(seed: int) -> None:
    """The file has the second mode 35 % off and the feet clamped: 60 kN m/rad before, 15 after."""
    random, state = np.random.default_rng((seed, 6)), as_it_stands(seed)
    reference = learnt(observed(state, 8, random))
    calibration = reference.calibration
    error = np.log(calibration.modes.frequency[reference.paired]) - reference.baseline.log_frequency
    print(f"seed {seed}: {len(error)} of {len(reference.known.n)} modes paired, {100 * np.std(error):.2f} % off")
    assert len(error) == len(reference.known.n) == 16
    assert np.sqrt(np.mean(error**2)) < 2e-3  # what no beam model is expected to fall short of
    for support in calibration.structure.support:
        for axis in ("rx", "ry"):
            assert support.stiffness[axis] == pytest.approx(FOOT, rel=0.1)
    after = observed(with_loose_foot(state), 5, random)
    event = matched_surely(reference, reference.mean_of(after.modes))
    found = diagnose(reference, event, only=("support_stiffness", "joint_stiffness", "added_mass")).diagnosis
    (foot,) = found.causes
    assert foot.cause == "support_stiffness"
    assert foot.where is not None
    assert foot.where.position == (0.0, 0.0, 0.0)
    for name in ("stiffness_rx", "stiffness_ry"):
        reported = foot.parameters[name]
        print(f"  {name} {reported.value:.0f} ± {reported.std:.0f} N m/rad")
        assert abs(reported.value - LOOSE_FOOT) < 3 * reported.std
        assert reported.std < 0.1 * LOOSE_FOOT


@pytest.mark.parametrize("seed", few_of([324, 325, 327, 329]))
def test_mode_shapes_identify_the_softer_of_two_bearings(seed: int) -> None:
    """Frequencies alone do not determine it: a fit to them leaves both bearings alike."""
    state = BRIDGE.draw(seed)
    before = observed(state, 8, np.random.default_rng(seed))
    file = structure_of("bridge: ")
    calibration = learn_reference(file, before.estimates, before.tracks, before.lateness.delays).calibration
    found = {change.name: change for change in calibration.changes()}
    first, last = found["support 0.z"], found["support 1.z"]
    true = [ground.along[2] for ground in state.frame.grounds]
    print(f"seed {seed}: {true}, found {first.after:.4g} ± {first.std:.2g} and {last.after:.4g} ± {last.std:.2g} N/m")
    assert (first.after < 0.99 * last.after) == (true[0] < true[1])
    assert (last.after < 0.99 * first.after) == (true[1] < true[0])
    for one, stiffness in zip((first, last), true, strict=True):
        assert abs(one.after - stiffness) < 3 * one.std


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [3])
def test_modes_far_from_the_file_are_paired_after_recalibration(seed: int) -> None:
    """Eight sensors along x: the first sway mode of the file is half as high again as the measured one."""
    before = observed(with_channels(as_it_stands(seed), "x"), 8, np.random.default_rng((seed, 6)))
    reference = learnt(before)
    n_modes = len(reference.known.n)
    print(f"seed {seed}: {reference.calibration.n_nominal}, then {len(reference.paired)} of {n_modes} modes paired")
    assert len(reference.paired) == n_modes
    found = diagnose(reference, reference.baseline, only=("added_mass",)).diagnosis
    assert found.calibration is not None
    assert found.calibration.modes_measured == found.calibration.modes_paired.after == n_modes
    error = found.calibration.frequency_error_percent
    assert error.before is not None
    assert error.after is not None
    assert error.after < 0.3 < 5 < error.before
