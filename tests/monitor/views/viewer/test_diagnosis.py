"""A diagnosis without a run, read back from its file."""

import numpy as np
import pytest

from daq import Channel, Recording
from daq.notebook import rounded_text
from monitor.results.convert import bare_reference
from monitor.results.state_comparison import ModeShapes, StateComparison
from monitor.views.viewer import write_diagnosis
from monitor.views.viewer.diagnosis.evidence import bar_lengths
from monitor.views.viewer.diagnosis.recording import modes_card
from tests.support.monitor import answers
from tests.support.monitor.comparison import NODES, STRUCTURE, shown
from tests.support.monitor.rrd_reader import Rrd

PEAK = 7
RATE, F_BEFORE, F_NOW = 200.0, 12.0, 10.0  # Hz


def tone(frequency: float) -> Recording:
    t = np.arange(4000) / RATE
    data = np.column_stack([np.sin(2 * np.pi * frequency * t), 0.1 * np.cos(2 * np.pi * frequency * t)])
    channels = tuple(
        Channel(name=name, device="a", axis=axis) for axis, name in enumerate(("beam_left_z", "col_037_x"))
    )
    return Recording(channels=channels, data=data, rate=RATE, start=0)


SHAPES = ModeShapes(
    frequency_before=F_BEFORE,
    frequency=F_NOW,
    before=np.array([0.9, -0.5]),
    now=np.array([1.0, -0.3]),
    before_moved=np.array([[0.0, 0.0, 0.9]]),
    now_moved=np.array([[0.0, 0.0, 1.0]]),
    with_causes=np.array([1.0, -0.31]),
)
STATES = StateComparison(
    channels=("beam_left_z", "col_037_x"),
    shapes=(SHAPES,),
    measured_before=True,
    signals_before=tone(F_BEFORE),
    signals=tone(F_NOW),
)


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> Rrd:
    path = tmp_path_factory.mktemp("diagnosed") / "diagnosis.rrd"
    write_diagnosis(path, answers.diagnosis(), shown(peak=PEAK), bare_reference(STRUCTURE), STATES)
    return Rrd(path)


def test_every_view_has_data(rrd: Rrd) -> None:
    origins = {view.origin for view in rrd.views}
    assert origins == {
        "/structure", "/diagnosis", "/evidence", "/modes", "/offsets", "/mac", "/signals/beam_left_z",
        "/sensors/residual", "/sensors/missed", "/state_shapes", "/state_spectra",
    }  # fmt: skip
    for origin in origins:
        assert any((c.entity_path + "/").startswith(origin + "/") for c in rrd.chunks), origin


def test_members_are_red_at_the_residual_forces(rrd: Rrd) -> None:
    strips, colours = (rrd.static("/structure/members", f"LineStrips3D:{name}") for name in ("strips", "colors"))
    green = np.array([c >> 16 & 0xFF for c in colours])
    middle = np.mean(np.array(strips), axis=1)
    assert np.linalg.norm(middle[np.argmin(green)] - NODES[PEAK]) < 0.05  # one element


def test_signals_equal_those_of_the_result(rrd: Rrd) -> None:
    signal = shown().signals[0]
    for name, values in (("measured", signal.measured), ("predicted", signal.predicted)):
        times, rows = rrd.rows(f"/signals/{signal.channel}/{name}", "Scalars:scalars", timeline="seconds")
        assert [row[0] for row in rows] == list(values)
        np.testing.assert_allclose(np.diff(times), signal.step * 1e9)


def test_causes_are_drawn_at_their_positions(rrd: Rrd) -> None:
    (place,) = rrd.static("/structure/causes/places", "Points3D:positions")
    np.testing.assert_allclose(place, (0.25, 0.0, 1.48), atol=1e-6)
    names = rrd.static("/structure/causes/names", "Points3D:labels")
    assert names == ["302 ± 5 g added", "sensor gain: col_037_x"]


def test_bars_are_linear_up_to_five_and_logarithmic_beyond() -> None:
    lengths = bar_lengths(np.array([0.0, -2.5, -5.0, -50.0, -500.0, 5.0]))
    np.testing.assert_allclose(lengths / lengths[4], [0, 1 / 6, 1 / 3, 2 / 3, 1, -1 / 3])


def test_evidence_has_a_bar_per_cause_and_the_accepted_one_first(rrd: Rrd) -> None:
    names = rrd.static("/evidence/names", "Points2D:labels")
    values = rrd.static("/evidence/values", "Points2D:labels")
    found = answers.diagnosis()
    assert len(names) == len(values) == 1 + len(found.rejected)
    assert values[0] == "accepted"
    assert values[1:] == [f"{cause.log_evidence:+.1f}" for cause in found.rejected]


def test_mac_has_the_frequencies_of_both_sides(rrd: Rrd) -> None:
    found = shown(peak=PEAK)
    names = rrd.static("/mac/names", "Points2D:labels")
    assert names == [f"{frequency:#.4g}" for frequency in (*found.columns, *found.rows)]


def lengths(rrd: Rrd, path: str) -> np.ndarray:
    """Return the signed lengths of the bars of a drawing."""
    strips = np.array(rrd.static(path, "LineStrips2D:strips"), float)
    every = strips[:, 1, 0] - strips[:, 0, 0]
    return np.asarray(every.reshape(-1, 8)[:, 0])  # of the lines that fill a bar


def test_bars_of_frequencies_are_proportional_to_the_values(rrd: Rrd) -> None:
    pairs = [mode for mode in shown().modes if mode.off_percent is not None]
    values = [*(mode.off_percent for mode in pairs), *(mode.off_percent_after for mode in pairs)]
    drawn = lengths(rrd, "/offsets/bars")
    np.testing.assert_allclose(drawn / drawn[0], np.array(values, float) / float(values[0] or 0), rtol=1e-4)
    assert rrd.static("/offsets/values", "Points2D:labels") == [f"{value:+.3f}" for value in values]
    assert rrd.static("/offsets/names", "Points2D:labels") == ["10.40 Hz", "37.20 Hz"]


def test_table_of_modes_names_the_states_and_has_the_digits_of_the_deviations() -> None:
    found = shown()
    head, _, first, *_ = modes_card(found).splitlines()
    assert head == "| model Hz | measured Hz | off by % | σ | MAC | with causes % |"
    mode = found.modes[0]
    assert f"| {rounded_text(mode.off_percent or 0.0, mode.std_percent or 0.0, sign=True)} |" in first
    assert modes_card(found.model_copy(update={"measured_before": True})).startswith(
        "| before Hz | now Hz | change % |"
    )


def test_shapes_before_and_now_are_drawn_on_one_scale(rrd: Rrd) -> None:
    before = lengths(rrd, "/state_shapes/before")
    points = np.array(rrd.static("/state_shapes/now", "Points2D:positions"))
    now = points[:, 0] - 50.0  # middle of the first column
    np.testing.assert_allclose(before / now, SHAPES.before / SHAPES.now, rtol=1e-4)
    (label,) = rrd.static("/state_shapes/mac", "Points2D:labels")
    macs = [
        (a @ SHAPES.now) ** 2 / ((a @ a) * (SHAPES.now @ SHAPES.now)) for a in (SHAPES.before, np.array([1.0, -0.31]))
    ]
    assert label == f"MAC {macs[0]:.4f} -> {macs[1]:.4f}"


def test_spectra_have_their_peaks_at_the_frequencies_before_and_now(rrd: Rrd) -> None:
    marks = np.array(rrd.static("/state_spectra/0/modes", "LineStrips2D:strips"), float)[:, 0, 0]
    curves = [np.array(curve) for curve in rrd.static("/state_spectra/0/curve", "LineStrips2D:strips")]
    peaks = [curve[np.argmin(curve[:, 1]), 0] for curve in curves]  # y grows downwards
    line = 100.0 / (1.12 * F_BEFORE) / 4  # one line of the spectrum of 4 s segments, on the axis
    np.testing.assert_allclose(peaks, marks, atol=line)
