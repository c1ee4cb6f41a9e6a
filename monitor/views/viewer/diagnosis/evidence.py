"""Log evidence of the causes as bars."""

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.comparison import DiagnosisAnswer
from monitor.views.palette import ALARM, DIM, GREY, OK, STEEL, TEXT
from monitor.views.viewer.primitives import bars, text
from updater.quantities import plain

_LINEAR = 5.0  # log evidence up to which the scale is linear: ratio of 150 to 1
_WIDTH, _STEP, _BAR = 120.0, 9.0, 2.6  # of the longest bar, between bars, and half of a bar's height
_NAME, _VALUE = 30.0, 14.0  # places of names to the right of zero, of values to the left of a bar


def evidence_bounds(diagnosis: DiagnosisAnswer) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the bounds of the drawing, x and y."""
    n = len(diagnosis.rejected) + bool(diagnosis.causes)
    return (-_WIDTH - 2 * _VALUE, 2 * _NAME), (-_STEP, _STEP * max(n, 8))


def draw_evidence(recording: rr.RecordingStream, diagnosis: DiagnosisAnswer) -> None:
    """Draw one bar per refused cause, its log evidence against the best explanation; logarithmic beyond -5."""
    refused = sorted(diagnosis.rejected, key=lambda cause: -cause.log_evidence)
    accepted = " + ".join(dict.fromkeys(plain(cause.cause) for cause in diagnosis.causes))
    names = [accepted] * bool(accepted) + [plain(cause.cause) for cause in refused]
    if not names:
        return
    values = np.array([0.0] * bool(accepted) + [cause.log_evidence for cause in refused])
    scaled = bar_lengths(values)
    y = _STEP * np.arange(len(names))
    ends = [(0.0, float(a), b) for a, b in zip(scaled, y.tolist(), strict=True)]
    colours = [ALARM if value > 0 else STEEL for value in values]
    bars(recording, "/evidence/bars", ends, _BAR, colours)
    zero = rr.LineStrips2D([[[0.0, -_STEP / 2], [0.0, y[-1] + _STEP / 2]]], colors=[DIM], draw_order=5.0)
    recording.log("/evidence/zero", zero, static=True)
    first = OK if accepted else TEXT
    text(recording, "/evidence/names", [[_NAME, b - 4.0] for b in y], names, [first, *[TEXT] * (len(names) - 1)])
    beside = [[min(float(a), 0.0) - _VALUE, b - 4.0] for a, b in zip(scaled, y, strict=True)]
    labels = ["accepted" if accepted and i == 0 else f"{value:+.1f}" for i, value in enumerate(values)]
    text(recording, "/evidence/values", beside, labels, [GREY])


def bar_lengths(values: FloatArray) -> FloatArray:
    """Return signed lengths (n,) of bars, linear to 5 and logarithmic beyond; the longest has the full width."""
    size = np.abs(values) / _LINEAR
    length = np.where(size < 1, size, 1 + np.log10(np.maximum(size, 1)))
    return np.asarray(_WIDTH * np.sign(values) * length / max(float(length.max(initial=0.0)), 1.0))
