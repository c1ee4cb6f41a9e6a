"""Diagnosis of records within which the structure changed; the frames are the examiner's, of another model."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from daq import Channel, Recording
from monitor.analysis.explanation import Explanation, explain
from monitor.analysis.observation import Observation
from monitor.analysis.states.record_course import explain_record
from monitor.results.comparison import WithinRecord
from monitor.text.diagnosis import record_change_texts, within_record_text
from tests.examiner.draws import with_lump
from tests.examiner.models.frame import Lump
from tests.examiner.models.specimen import State, draw_state
from tests.examiner.path import FRAME, observation
from tests.examiner.signals import estimated

N_WINDOWS = 24
MASS, POSITION = 0.4, (-0.15, 0.0, 1.48)
FEW = ("added_mass", "temperature")  #: causes that are compared, to save time


def record(mass: np.ndarray, seed: int) -> tuple[Observation, Observation]:
    """Return windows before, and windows with a body of so much mass (n_windows,) on the crossbeam."""
    print(f"seed {seed}")
    random, state = np.random.default_rng((seed, 77)), draw_state(seed)
    bar = state.frame.bar("crossbeam")
    along = POSITION[0] - bar.start[0]
    states: list[State] = [with_lump(state, Lump(bar="crossbeam", s=along, mass=m)) if m > 0 else state for m in mass]
    windows = [estimated(s, 1, random, first=w, noise="law")[0] for w, s in enumerate(states)]
    before = observation(state, estimated(state, 8, random, noise="law"))
    return before, observation(states[-1], windows, [s.loudness for s in states])


def found(mass: np.ndarray, seed: int) -> tuple[Explanation, WithinRecord | None]:
    """Return the explanation of a record, and of the change within it."""
    explained = explain_record(partial(explain, only=FEW), FRAME, *record(mass, seed))
    return explained, explained.diagnosis.within_record


def agrees(explained_mass: float, std: float, truth: float) -> bool:
    """Return whether a mass lies within four deviations, with 2 % for another frame model."""
    return abs(explained_mass - truth) < 4 * std + 0.02 * truth


@pytest.mark.parametrize("seed", [3, *(pytest.param(s, marks=pytest.mark.thorough) for s in range(4, 12))])
def test_mass_that_grows_within_a_record_is_named_with_its_rate(seed: int) -> None:
    share = (np.arange(N_WINDOWS) + 0.5) / N_WINDOWS
    explained, within = found(MASS * share, seed)
    (cause,) = explained.diagnosis.causes
    mass = cause.parameters["mass"]
    assert agrees(mass.value, mass.std, MASS * 5 / 6)  # at the mean time of the last third
    assert within is not None
    assert within.kind == "gradual"
    (change,), (rate,) = within.causes, within.rates
    assert change.where is not None
    assert change.where.position is not None
    assert change.where.position_std is not None
    assert np.linalg.norm(np.subtract(change.where.position, POSITION)) < 0.01 + 4 * change.where.position_std
    hours = N_WINDOWS * (within.end - within.start) * 1e-9 / 3600 / 16  # 16 of 24 windows are between both means
    assert agrees(rate.per_hour, rate.std, MASS / hours)
    assert "gradually" in within_record_text(within)
    assert not within.of_all
    assert "mean of all windows" in within_record_text(within.model_copy(update={"of_all": True}))
    assert any("g/h" in text for text in record_change_texts(within))


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3, 12))
def test_rate_of_a_heavy_body_is_that_with_its_first_part_in_the_model(seed: int) -> None:
    """A sixth of 1.2 kg is there in the first state; without it in the model, the growth was 9 to 17 % too small."""
    _, within = found(3 * MASS * (np.arange(N_WINDOWS) + 0.5) / N_WINDOWS, seed)
    assert within is not None
    (change,) = within.causes
    growth = change.parameters["mass"]
    print(growth)
    assert agrees(growth.value, 0.5 * growth.std, 3 * MASS * 2 / 3)


@pytest.mark.parametrize("seed", [3, *(pytest.param(s, marks=pytest.mark.thorough) for s in range(4, 12))])
def test_body_that_is_added_within_a_record_is_named_and_its_time(seed: int) -> None:
    explained, within = found(np.where(np.arange(N_WINDOWS) < 15, 0.0, MASS), seed)
    (cause,) = explained.diagnosis.causes
    assert agrees(cause.parameters["mass"].value, cause.parameters["mass"].std, MASS)
    assert within is not None
    assert within.step is not None
    assert within.rates == ()
    assert (
        within.step[0] <= within.course[15].time - (within.course[1].time - within.course[0].time) / 2 <= within.step[1]
    )


def test_record_of_one_state_is_explained_as_a_whole() -> None:
    explained, within = found(np.zeros(N_WINDOWS), 3)
    assert within is None
    assert explained.diagnosis.verdict == "nothing_to_explain"


def test_signals_are_kept_only_with_the_window_that_they_are_of() -> None:
    before, _ = record(np.full(3, MASS), seed=3)
    channel = Channel(name="c", device="d", axis=0)
    signals = Recording(channels=(channel,), data=np.zeros((10, 1)), rate=100.0, start=0)
    observed = replace(before, sample=signals)
    last = len(observed.estimates) - 1
    assert observed.chosen(np.arange(last)).sample is None
    assert observed.chosen(np.array([0, last])).sample is signals
