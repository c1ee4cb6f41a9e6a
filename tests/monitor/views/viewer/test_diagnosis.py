"""A diagnosis without a run, read back from its file."""

import numpy as np
import pytest

from monitor.results.convert import bare_reference
from monitor.views.viewer import write_diagnosis
from monitor.views.viewer.diagnosis.evidence import bar_lengths
from tests.support.monitor import answers
from tests.support.monitor.comparison import NODES, STRUCTURE, shown
from tests.support.monitor.rrd_reader import Rrd

PEAK = 7


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> Rrd:
    path = tmp_path_factory.mktemp("diagnosed") / "diagnosis.rrd"
    write_diagnosis(path, answers.diagnosis(), shown(peak=PEAK), bare_reference(STRUCTURE))
    return Rrd(path)


def test_every_view_has_data(rrd: Rrd) -> None:
    origins = {view.origin for view in rrd.views}
    assert origins == {
        "/structure", "/diagnosis", "/evidence", "/modes", "/offsets", "/mac", "/sensors", "/signals/beam_left_z",
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
    (place,) = rrd.static("/structure/causes", "Points3D:positions")
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
    assert names == [f"{frequency:.4g}" for frequency in (*found.columns, *found.rows)]
