"""Spectrogram: the first singular value of the spectral matrix, window by window."""

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.run_results import RunResults
from monitor.views.member_axis import ticks
from monitor.views.palette import GREY, heat
from monitor.views.viewer.primitives import clock, text

_WIDTH, _HEIGHT = 480, 220  # pixels
BOUNDS = ((-62.0, 490.0), (-10.0, 250.0))  # of the drawing, x and y
_ABOVE = 1.12  # of the highest mode: end of the frequency axis
_FLOOR, _TOP = 0.05, 0.999  # quantiles of the levels at the ends of the colours
_TIMES = 5


def draw_spectrogram(recording: rr.RecordingStream, run_results: RunResults) -> None:
    """Draw all spectra of a run, time to the right, frequency upwards."""
    level, highest = spectrogram(run_results)
    low, high = np.quantile(level, [_FLOOR, _TOP])
    colours = heat(np.clip((level - low) / max(high - low, 1e-9), 0, 1).ravel()).reshape(*level.shape, 3)
    windows = [window for window, _ in run_results.spectra]
    rows = np.linspace(len(level) - 1, 0, _HEIGHT).round().astype(int)
    columns = np.linspace(0, len(windows) - 1, _WIDTH).round().astype(int)
    recording.log("/spectrogram/image", rr.Image(colours[rows][:, columns]), static=True)
    frequencies = ticks(0.0, highest, 5)
    beside = [[-30.0, _HEIGHT * (1 - f / highest) - 8] for f in frequencies]
    numbers = np.unique(np.linspace(0, len(windows) - 1, _TIMES).round().astype(int)).tolist()
    below = [[_WIDTH * (number + 0.5) / len(windows), _HEIGHT + 4.0] for number in numbers]
    labels = [*(f"{f:g} Hz" for f in frequencies), *(clock(windows[number].end) for number in numbers)]
    text(recording, "/spectrogram/ticks", [*beside, *below], labels, [GREY])


def spectrogram(run_results: RunResults) -> tuple[FloatArray, float]:
    """Return the levels (n_frequencies, n_windows) [dB re (m/s2)2/Hz] from 0 Hz up, and the highest frequency [Hz]."""
    spectra = [spectrum for _, spectrum in run_results.spectra]
    modes = run_results.reference.modes if run_results.reference else []
    end = min(s.frequency[-1] for s in spectra)
    highest = min(end, _ABOVE * max((m.frequency for m in modes), default=end))
    grid = np.linspace(0.0, highest, _HEIGHT)
    return np.array([np.interp(grid, s.frequency, s.singular_values[0]) for s in spectra]).T, highest
