"""Estimates of signals that arrive block by block, against the record of an independent specimen."""

import numpy as np
from scipy.signal import butter, sosfilt

from tests.support.updater.unmeasured_points import UnmeasuredPoints
from updater.validation import LiveFilter, Point, ResponseModel

INNER = slice(50, -50)  # the removal of delays leaves no samples at the ends


def test_blocks_one_after_another_give_the_same_as_one(frame: UnmeasuredPoints, learned: ResponseModel) -> None:
    """The offset is that of the first block: none here."""
    data = frame.record(2.0, 9)[0].data[INNER]
    first, rest = (part - part.mean(0) for part in (data[:400], data[400:]))
    whole = LiveFilter(learned, frame.points).run(np.vstack([first, rest]))
    live = LiveFilter(learned, frame.points)
    blocks = [live.run(part) for part in (first, *np.array_split(rest, 5))]
    assert np.isfinite(whole[0]).all()
    for k in (0, 1):
        parts = np.concatenate([block[k] for block in blocks])
        np.testing.assert_allclose(parts, whole[k], rtol=1e-6, atol=1e-6 * np.abs(whole[k]).max())


def test_filter_settles_and_follows_the_truth(frame: UnmeasuredPoints, learned: ResponseModel) -> None:
    """The truth has passed the same band-pass filter; the offset of gravity has no part in the estimates."""
    points = [point for point in frame.points if isinstance(point, Point)]
    recording, truth = frame.record(20.0, 10)
    data, truth = recording.data[INNER], truth[INNER]
    live = LiveFilter(learned, points)
    assert not live.settled
    estimates = np.concatenate([live.run(part)[0] for part in np.array_split(data + 9.81, 40)])
    assert live.settled
    exact = sosfilt(butter(4, learned.band, "bandpass", fs=recording.rate, output="sos"), truth, axis=0)
    settled = slice(2 * learned.settling, None)
    error = (estimates - exact[:, : len(points)])[settled].std(0) / exact[settled, : len(points)].std(0)
    assert np.median(error) < 0.12  # as of the filter that runs both ways
