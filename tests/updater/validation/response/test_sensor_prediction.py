"""Sensors predicted from those at other places, against the records of independent specimens."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.thorough import few_of
from tests.support.updater.unmeasured_points import UnmeasuredPoints, unmeasured_points
from updater import ModalDataError
from updater.validation import SensorPredictor, learn_predictors

SEED = 3


@pytest.fixture(scope="module")
def frame() -> UnmeasuredPoints:
    print(f"seed {SEED}")
    return unmeasured_points("frame", SEED)


@pytest.fixture(scope="module")
def predictors(frame: UnmeasuredPoints) -> tuple[SensorPredictor, ...]:
    return learn_predictors(frame.reference, frame.record(25.0, SEED)[0])


def errors(case: UnmeasuredPoints, predictors: tuple[SensorPredictor, ...]) -> tuple[float, float]:
    """Return the share of samples within two deviations, and the median relative error of the sensors."""
    recording, _ = case.record(12.0, SEED + 1000)
    within, relative = [], []
    for predictor in predictors:
        found = predictor.predict(recording)
        settled = np.isfinite(found.predicted[:, 0])
        error = (found.predicted - found.measured.data)[settled]
        within.append((np.abs(error) < 2 * found.std).mean(0))
        relative.append(error.std(0) / found.measured.data[settled].std(0))
    return float(np.mean(np.concatenate(within))), float(np.median(np.concatenate(relative)))


def test_sensors_are_within_the_deviations_of_their_prediction(
    frame: UnmeasuredPoints, predictors: tuple[SensorPredictor, ...]
) -> None:
    """All samples of a sensor have the same error of shape: the share of one specimen varies about 95 %."""
    assert sorted(channel for own in predictors for channel in own.channels) == sorted(
        frame.reference.baseline.channels
    )
    within, relative = errors(frame, predictors)
    assert within > 0.8
    assert relative < 0.25


@pytest.mark.thorough
@pytest.mark.parametrize(("which", "seed"), few_of([("portal", 0), ("bridge", 0), ("mast", 0)]))
def test_sensors_of_other_specimens_are_within_the_deviations(which: str, seed: int) -> None:
    print(f"seed {seed}")
    case = unmeasured_points(which, seed)
    within, relative = errors(case, learn_predictors(case.reference, case.record(40.0, seed)[0]))
    assert within > 0.8
    assert relative < 0.25


def test_a_predictor_does_not_depend_on_the_sensors_of_its_place(
    frame: UnmeasuredPoints, predictors: tuple[SensorPredictor, ...]
) -> None:
    recording, _ = frame.record(6.0, 1)
    predictor = predictors[0]
    own = np.isin([channel.name for channel in recording.channels], predictor.channels)
    other = replace(recording, data=np.where(own, 7.0, recording.data))
    np.testing.assert_array_equal(predictor.predict(recording).predicted, predictor.predict(other).predicted)
    twice = replace(recording, data=np.where(own, 2.0, 1.0) * recording.data)
    first, second = (predictor.predict(one).measured.data for one in (recording, twice))
    np.testing.assert_allclose(second, 2 * first, rtol=1e-9, atol=1e-12)


def test_gaps_of_a_sensor_are_none_of_its_prediction(
    frame: UnmeasuredPoints, predictors: tuple[SensorPredictor, ...]
) -> None:
    recording, _ = frame.record(9.0, 1)
    predictor, n = predictors[0], len(recording.data)
    own = np.isin([channel.name for channel in recording.channels], predictor.channels)
    early, late = (np.arange(n)[:, None] < n / 2, np.arange(n)[:, None] >= n / 2)
    gap = replace(recording, data=np.where(own & early, np.nan, recording.data))
    whole, found = predictor.predict(recording), predictor.predict(gap)
    np.testing.assert_array_equal(found.predicted, whole.predicted)
    assert np.isnan(found.measured.data[: n // 2]).all()
    assert np.isfinite(found.measured.data).any()
    neither = replace(gap, data=np.where(~own & late, np.nan, gap.data))
    with pytest.raises(ModalDataError, match="is both measured and predicted"):
        predictor.predict(neither)


def test_records_that_do_not_fit_are_refused(frame: UnmeasuredPoints, predictors: tuple[SensorPredictor, ...]) -> None:
    recording, _ = frame.record(6.0, 11)
    predictor = predictors[0]
    own = [channel.name in predictor.channels for channel in recording.channels]
    kept = tuple(channel for channel, left in zip(recording.channels, own, strict=True) if not left)
    fewer = replace(recording, channels=kept, data=recording.data[:, np.logical_not(own)])
    with pytest.raises(ModalDataError, match=f"channel '{predictor.channels[0]}' of the reference is missing"):
        predictor.predict(fewer)
    few = frame.reference.without([channel for own in predictors[3:] for channel in own.channels])
    with pytest.raises(ModalDataError, match="measured places: expected at least 4, found 3"):
        learn_predictors(few, recording)
