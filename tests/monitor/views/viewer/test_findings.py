"""Results of the one-step update and of the diagnosis, read back from the file."""

from pathlib import Path

import numpy as np
import pytest

from monitor.views.palette import signed_heat
from monitor.views.viewer import write_recording
from tests.support.monitor import answers
from tests.support.monitor import results as made
from tests.support.monitor.rrd_reader import Rrd

SITE = made.Site()
RUN = answers.with_findings(SITE, made.whole_run(SITE, n_learning=5, n_before=1, n_after=3))
INCREMENTS = answers.increments(SITE)
DIRECTIONS = ("x", "y", "z")


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> Rrd:
    path = tmp_path_factory.mktemp("findings") / "run.rrd"
    write_recording(path, made.run_results(RUN))
    return Rrd(path)


def test_members_are_red_at_the_added_mass_and_steel_without_data(rrd: Rrd) -> None:
    _, strips = rrd.rows("/increments/z/members", "LineStrips3D:strips")
    _, colours = rrd.rows("/increments/z/members", "LineStrips3D:colors")
    green = np.array([c >> 16 & 0xFF for c in colours[-1]])
    middle = np.mean(np.array(strips[-1]), axis=1)
    assert np.linalg.norm(middle[np.argmin(green)] - SITE.place) < 0.05  # one element
    assert set(green[middle[:, 2] < 0.98]) == {118}  # steel: z says nothing there


def test_members_without_a_significant_increment_are_thin(rrd: Rrd) -> None:
    _, radii = rrd.rows("/increments/y/members", "LineStrips3D:radii")
    _, strips = rrd.rows("/increments/y/members", "LineStrips3D:strips")
    flagged = {f.node for f in INCREMENTS.flagged if f.direction == "y"}
    places = np.array([RUN["reference"].nodes[node] for node in flagged])
    thick = np.array(radii[-1]) > 1.5 * min(radii[-1])
    ends_flagged = np.linalg.norm(np.array(strips[-1])[:, :, None] - places, axis=3).min(axis=2) < 1e-6
    np.testing.assert_array_equal(thick, ends_flagged.any(axis=1))
    assert 0 < thick.sum() < len(thick)


def test_flagged_nodes_are_marked_with_the_location_text(rrd: Rrd) -> None:
    for direction in DIRECTIONS:
        flagged = [f for f in INCREMENTS.flagged if f.direction == direction]
        _, places = rrd.rows(f"/increments/{direction}/flagged", "Points3D:positions")
        assert len(places[-1]) == len(flagged)
        _, labels = rrd.rows(f"/increments/{direction}/flagged/names", "Points3D:labels")
        assert [label.replace("\n", " ") for label in labels[-1]] == (
            ["consistent with one mass at (0.25, 0.00, 1.48) m, 95 % within 0.03 m"] if flagged else []
        )


def test_curve_heights_are_proportional_to_the_increments(rrd: Rrd) -> None:
    """Raw over normalised is a half in y, as the helper makes them; heights are from the panel's middle."""
    _, raw = rrd.rows("/increment_curves/y/raw", "LineStrips2D:strips")
    _, normalised = rrd.rows("/increment_curves/y/normalised", "LineStrips2D:strips")
    base = 46.0 + 34.0 / 2  # of the second panel
    low, high = (base - min(p[1] for strip in rows[-1] for p in strip) for rows in (raw, normalised))
    assert low / high == pytest.approx(0.5, rel=1e-5)


def test_removed_mass_is_blue() -> None:
    red, _, blue = signed_heat(np.array([-1.0]))[0]
    assert blue > red
    red, _, blue = signed_heat(np.array([1.0]))[0]
    assert red > blue
    np.testing.assert_array_equal(signed_heat(np.array([np.nan])), signed_heat(np.array([0.0])))


def test_diagnosis_is_shown_as_a_text_card(rrd: Rrd) -> None:
    times, texts = rrd.rows("/diagnosis", "TextDocument:text")
    assert times.tolist() == [w.end for w in RUN["windows"] if w.diagnosis]
    card = texts[-1][0]
    assert card.startswith("# Explained")
    for words in ("302 ± 5 g added on the crossbeam", "97.3 %", "global stiffness", "1.920 % without, 0.040 % with"):
        assert words in card
    _, now = rrd.rows("/now", "TextDocument:text")
    assert "Explained: 302 ± 5 g added" in now[-1][0]


def test_run_without_findings_has_no_views_for_them(tmp_path: Path) -> None:
    write_recording(tmp_path / "run.rrd", made.run_results(made.whole_run(SITE, n_learning=5, n_before=1, n_after=3)))
    rrd = Rrd(tmp_path / "run.rrd")
    assert not rrd.entities("/increments") | rrd.entities("/diagnosis") | rrd.entities("/increment_curves")
    assert not [v for v in rrd.views if "One-step" in v.name or v.name == "Diagnosis"]
