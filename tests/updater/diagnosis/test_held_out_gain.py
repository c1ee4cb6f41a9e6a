"""The gain of a diagnosis: on records and modes that the fit has not seen, none where it may be chance, and losses."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.thorough import few_of
from tests.support.updater.diagnosis_data import Change, learnt
from updater import Body, diagnose
from updater.causes import prediction
from updater.diagnosis.gain import Gained, change_gain_left_out, change_gain_on
from updater.diagnosis.model_extension import agreeing
from updater.diagnosis.schema import Gain, Pair
from updater.diagnosis.weighing import EvidenceComparison
from updater.inference import compare

CHANGE = Change(bodies=(Body(at=(0.2, 0, 1.48), mass=0.3),))  # over 1 % in frequency
ONLY = ("added_mass",)  # which cause is found is tested elsewhere
GAIN = Gain(
    heldout=False,
    frequency_error_percent=Pair(before=0.42, after=4.7),
    one_minus_mac=Pair(before=0.05, after=0.27),
    log_likelihood=Pair(before=10.0, after=-800.0),
    change_error_percent=Pair(before=1.8, after=0.7),
    n_modes=10,
    n_measured=11,
)
STD = GAIN.model_copy(update={"frequency_error_percent": Pair(before=0.017, after=0.1)})


@pytest.mark.parametrize("seed", few_of([301, 302]))
def test_held_out_data_are_predicted_within_noise(seed: int) -> None:
    """Changes are mispredicted by at most 1.5 times the noise of the records, and by an eighth of the changes."""
    reference, _, event = learnt(seed)
    found = diagnose(reference, event(CHANGE), heldout=(kept := event(CHANGE)), only=ONLY)
    gain = found.diagnosis.gain
    assert gain is not None
    assert gain.heldout
    assert gain.change_error_percent is not None
    before, after = gain.change_error_percent.before, gain.change_error_percent.after
    assert before is not None
    assert after is not None
    noise = 100 * np.sqrt(np.mean(kept.log_frequency_std**2 + reference.baseline.log_frequency_std**2))
    assert after < 1.5 * noise
    assert after < before / 8


def test_extended_model_parameters_are_adjusted_to_the_measured_frequencies() -> None:
    """Of 400 g: the decision leaves 1 % of the shift; the extended model is as near to the frequencies as possible."""
    reference, _, event = learnt(306)
    data = compare(reference, event(Change(bodies=(Body(at=(0.1, 0, 1.48), mass=0.4),))))
    (mass,) = EvidenceComparison(reference, data).singles(("added_mass",))
    close = agreeing(data, mass.chosen)
    rest = [np.linalg.norm(data.log_ratio - prediction(data, c).log_ratio[0]) for c in (mass.chosen, close)]
    assert rest[1] < rest[0]
    std = np.sqrt(np.diag(mass.parts[0].covariance[mass.parts[0].best]))
    assert (np.abs(close[0].theta - mass.chosen[0].theta) < 3 * std).all()  # and is within what was left open


def test_a_held_out_record_may_lack_a_mode_or_a_channel() -> None:
    """A mode fewer is judged without it; other channels are not judged at all, and each mode is left out instead."""
    reference, _, event = learnt(305)
    found, kept = event(CHANGE), event(CHANGE)
    fewer = replace(kept, log_frequency=np.where(np.arange(len(kept.n)) == 5, np.nan, kept.log_frequency))
    gain = diagnose(reference, found, heldout=fewer, only=ONLY).diagnosis.gain
    assert gain is not None
    assert gain.heldout
    gain = diagnose(reference, found, heldout=kept.at(kept.channels[:-1]), only=ONLY).diagnosis.gain
    assert gain is not None
    assert not gain.heldout


def test_a_held_out_record_may_have_a_further_channel() -> None:
    """A channel of the baseline, or a further sensor: it is left out."""
    reference, _, event = learnt(305)
    found, kept = event(CHANGE), event(CHANGE)
    fewer = replace(reference, baseline=reference.baseline.at(kept.channels[:-1]))
    gains = [diagnose(one, found.at(kept.channels[:-1]), heldout=kept, only=ONLY) for one in (reference, fewer)]
    assert [found.diagnosis.gain is not None and found.diagnosis.gain.heldout for found in gains] == [True, True]


def test_each_left_out_mode_is_predicted_by_the_others() -> None:
    """A mode that is left out is predicted within four stated deviations; not closer than noise allows."""
    reference, _, event = learnt(303)
    found = diagnose(reference, event(CHANGE), only=ONLY)
    assert found.gained is not None
    error, std = found.gained.gain.change_error_percent, found.gained.std.change_error_percent
    assert error is not None
    assert std is not None
    assert error.before is not None
    assert error.after is not None
    assert std.after is not None
    assert not found.gained.gain.heldout
    assert 0 < error.after < error.before / 8
    assert error.after < 0.1  # %: five windows of 0.1 % each, and what the reference gets wrong of 1 %


def test_gain_of_a_negligible_mass_is_not_significant() -> None:
    """A thousandth of an undetectable mass, on data in which nothing has changed."""
    reference, _, event = learnt(304)
    data = compare(reference, event(Change()))
    (mass,) = EvidenceComparison(reference, data).singles(("added_mass",))
    small = tuple(replace(c, theta=c.theta * 1e-3) for c in mass.chosen)
    assert not change_gain_on(data, small).significant
    assert not change_gain_left_out(data, small).significant


@pytest.mark.parametrize(
    ("error", "likelihood", "worse"),
    [
        pytest.param((0.42, 4.7), (10.0, -800.0), True, id="a mast whose bending modes mix"),
        pytest.param((0.42, 0.8), (10.0, -80.0), False, id="less than double"),
        pytest.param((0.42, 4.7), (10.0, 20.0), False, id="shapes agree better by more"),
        pytest.param((0.05, 0.3), (10.0, -1.0), False, id="within the noise"),
        pytest.param((None, 0.3), (10.0, -1.0), False, id="not compared"),
    ],
)
def test_doubled_error_contradicts(
    error: tuple[float | None, float], likelihood: tuple[float, float], *, worse: bool
) -> None:
    """A written model that contradicts the measured modes is no explanation."""
    changed = {
        "frequency_error_percent": Pair(before=error[0], after=error[1]),
        "log_likelihood": Pair(before=likelihood[0], after=likelihood[1]),
    }
    gained = Gained(gain=GAIN.model_copy(update=changed), std=STD, significant=True)
    assert gained.is_worse == worse
    assert not replace(
        gained, gain=GAIN.model_copy(update={"frequency_error_percent": Pair(before=4.7, after=0.4)})
    ).is_worse
