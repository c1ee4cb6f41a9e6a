"""Accelerations at points without a sensor, against the records of independent specimens."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.signal.windows import tukey

from daq import FloatArray
from tests.support.snippets import code_blocks, run_cells
from tests.support.updater.unmeasured_points import FRAME_SEED, UnmeasuredPoints, unmeasured_points
from updater import ModalDataError, ModelError
from updater.modal_data import NO_DELAYS
from updater.validation import Fibre, MotionQuantity, Point, ResponseEstimate, ResponseModel


def in_band(truth: FloatArray, estimate: ResponseEstimate) -> FloatArray:
    sections = butter(4, estimate.band, "bandpass", fs=estimate.recording.rate, output="sos")
    return np.asarray(sosfiltfilt(sections, truth, axis=0))


def compare(case: UnmeasuredPoints, model: ResponseModel, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return error over deviation (n_samples, n_points), and rms error over rms signal (n_points,)."""
    recording, truth = case.record(12.0, seed)
    found = model.estimate(recording, case.points)
    settled = np.isfinite(found.recording.data[:, 0])
    truth = in_band(truth, found)[settled]
    error = found.recording.data[settled] - truth
    return error / found.std, np.sqrt((error**2).mean(0) / (truth**2).mean(0))


def assert_within_deviations(case: UnmeasuredPoints, model: ResponseModel, seed: int) -> None:
    """All samples at a point have the same error of shape, so that the share of one specimen varies about 95 %.

    Without the error of the shapes, some 50 to 75 % are within two deviations.
    """
    ratio, relative = compare(case, model, seed)
    strained = np.array([isinstance(point, Fibre) for point in case.points])
    for which, most in ((~strained, 0.08), (strained, 0.12)):
        assert (np.abs(ratio[:, which]) < 2).mean() > 0.80
        assert np.median(relative[which]) < most
    assert (np.abs(ratio) < 1).mean() < 0.95  # deviations are not too large either


def test_truth_is_within_the_deviations_where_there_is_no_sensor(
    frame: UnmeasuredPoints, learned: ResponseModel
) -> None:
    """Accelerations at twelve points, and stresses at six."""
    assert_within_deviations(frame, learned, FRAME_SEED + 1000)


@pytest.mark.thorough
@pytest.mark.parametrize(("which", "seed"), [("portal", 0), ("portal", 2), ("bridge", 0), ("mast", 0), ("mast", 3)])
def test_truth_is_within_the_deviations_of_other_specimens(which: str, seed: int) -> None:
    print(f"seed {seed}")
    case = unmeasured_points(which, seed)
    assert_within_deviations(case, ResponseModel.learn(case.reference, case.record(40.0, seed)[0]), seed + 1000)


def test_deviations_without_delays_of_devices_have_no_part_of_clocks(
    frame: UnmeasuredPoints, learned: ResponseModel
) -> None:
    """A reference that was learned without delays has none, whose mean is not a number."""
    recording, _ = frame.record(8.0, 7)
    known = learned.estimate(recording, frame.points)
    unknown = replace(learned, reference=replace(learned.reference, delays=NO_DELAYS))
    found = unknown.estimate(recording, frame.points)
    assert (found.std < known.std).all()
    assert (found.std > 0).all()


def test_deviations_follow_the_level_of_the_excitation(frame: UnmeasuredPoints, learned: ResponseModel) -> None:
    recording, _ = frame.record(8.0, 7)
    quiet, loud = (learned.estimate(replace(recording, data=k * recording.data), frame.points) for k in (0.5, 4.0))
    np.testing.assert_allclose(loud.std, 8 * quiet.std, rtol=1e-9)
    assert loud.level == pytest.approx(8 * quiet.level)


def test_estimate_does_not_depend_on_a_gap_elsewhere(frame: UnmeasuredPoints, learned: ResponseModel) -> None:
    """The filter starts anew after it; both agree as soon as its start is forgotten."""
    recording, _ = frame.record(18.0, 8)
    data = recording.data.copy()
    data[5000:5100, 4] = np.nan
    whole, parts = (
        learned.estimate(r, frame.points).recording.data for r in (recording, replace(recording, data=data))
    )
    assert np.isnan(parts[5000:5100]).all()
    later = np.isfinite(parts).all(1) & (np.arange(len(parts)) > 12000) & np.isfinite(whole).all(1)
    assert later.sum() > 3000
    scale = np.nanstd(whole, axis=0)
    assert (np.abs(parts - whole)[later] / scale).max() < 0.02


def test_blocks_one_after_another_give_the_same_as_one(frame: UnmeasuredPoints, learned: ResponseModel) -> None:
    recording, _ = frame.record(2.0, 9)
    whole, _ = learned.filter(frame.points).run(recording.data)
    blocks = learned.filter(frame.points)
    parts = np.concatenate([blocks.run(part)[0] for part in np.array_split(recording.data, 7)])
    np.testing.assert_allclose(parts, whole, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("quantity", "order"), [("velocity", 1), ("displacement", 2)])
def test_integrated_truth_is_within_the_deviations(
    frame: UnmeasuredPoints, learned: ResponseModel, quantity: MotionQuantity, order: int
) -> None:
    """The truth is the recorded acceleration, integrated in the band by its spectrum; 80 % as for accelerations."""
    points = [point for point in frame.points if isinstance(point, Point)]  # the first ones
    recording, truth = frame.record(20.0, 10)
    truth = truth[:, : len(points)]
    found = learned.estimate(recording, [replace(point, quantity=quantity) for point in points])
    taper = tukey(len(truth), 0.2)[:, None]
    spectrum = np.fft.rfft(taper * in_band(truth, found), axis=0)
    omega = 2 * np.pi * np.fft.rfftfreq(len(truth), 1 / recording.rate)
    spectrum[1:] /= (1j * omega[1:, None]) ** order
    spectrum[0] = 0.0
    exact = np.fft.irfft(spectrum, len(truth), axis=0)
    settled = np.isfinite(found.recording.data[:, 0]) & (taper[:, 0] == 1)
    error = (found.recording.data - exact)[settled]
    assert (np.abs(error / found.std) < 2).mean() > 0.80
    assert np.median(error.std(0) / exact[settled].std(0)) < 0.15


def test_snippet_of_the_page_runs(frame: UnmeasuredPoints) -> None:
    code = code_blocks(Path(__file__).parents[4] / "docs" / "explanation" / "update" / "response.md")
    given = {"reference": frame.reference, "recording": frame.record(8.0, 12)[0], "later": frame.record(6.0, 13)[0]}
    names = run_cells(code, **given)
    assert names["estimate"].recording.data.shape == (6000, 1)
    assert 0 < names["estimate"].std[0] < 1e-6
    assert names["found"].predicted.shape == (6000, 2)


def test_deviations_do_not_depend_on_how_channels_are_divided_into_devices(
    frame: UnmeasuredPoints, learned: ResponseModel
) -> None:
    """A table of measurements is one device; the places of its sensors are those of the structure."""
    recording, _ = frame.record(25.0, FRAME_SEED)
    table = replace(recording, channels=tuple(replace(channel, device="import") for channel in recording.channels))
    np.testing.assert_array_equal(ResponseModel.learn(frame.reference, table).shape_error, learned.shape_error)


def test_records_that_do_not_fit_are_refused(frame: UnmeasuredPoints, learned: ResponseModel) -> None:
    recording, _ = frame.record(6.0, 11)
    with pytest.raises(ModalDataError, match="expected a rate of 1000 Hz, found 500 Hz"):
        learned.estimate(replace(recording, rate=500.0), frame.points)
    fewer = replace(recording, channels=recording.channels[1:], data=recording.data[:, 1:])
    with pytest.raises(ModalDataError, match="of the reference is missing"):
        learned.estimate(fewer, frame.points)
    with pytest.raises(ModalDataError, match="long enough for the filter to settle"):
        learned.estimate(replace(recording, data=recording.data[:300]), frame.points)
    with pytest.raises(ModalDataError, match="without a gap are too short"):
        ResponseModel.learn(frame.reference, replace(recording, data=recording.data[:300]))
    with pytest.raises(ModalDataError, match="expected a rate of at least"):
        ResponseModel.learn(frame.reference, replace(recording, rate=400.0))
    with pytest.raises(ModelError):
        learned.estimate(recording, [Point(at=(5.0, 5.0, 5.0), axis=0)])
