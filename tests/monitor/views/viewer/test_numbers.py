"""Increments, likelihood and region as numbers, and the pictures made of them, read back from the file."""

from typing import Any

import numpy as np
import pytest

from daq import FloatArray
from monitor.results.windows import MassAnswer, OtherPlace, WindowResult
from monitor.views.member_axis import axis_of, sigmas
from monitor.views.viewer import write_recording
from tests.support.monitor import answers
from tests.support.monitor import results as made
from tests.support.monitor.rrd_reader import Rrd

SITE = made.Site()
OTHER = OtherPlace(
    member="crossbeam", position=(0.25, 0.0, 1.48), position_std=0.02, mass=0.2, mass_std=0.03, probability=0.31
)


def two_places(window: WindowResult) -> WindowResult:
    """Return the window with a second place left open, if it locates a mass."""
    if window.answer is None:
        return window
    return window.model_copy(update={"answer": window.answer.model_copy(update={"others": [OTHER]})})


FOUND = answers.with_findings(SITE, made.whole_run(SITE, n_learning=5, n_before=1, n_after=4))
RUN = FOUND | {"windows": [*FOUND["windows"][:-1], two_places(FOUND["windows"][-1])]}
ANSWERED = [w for w in RUN["windows"] if w.answer]
LAST: MassAnswer = ANSWERED[-1].answer


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> Rrd:
    path = tmp_path_factory.mktemp("numbers") / "run.rrd"
    write_recording(path, made.run_results(RUN))
    return Rrd(path)


def points(rrd: Rrd, entity: str, what: str, name: str) -> list[FloatArray]:
    """Return the points (n, 3) of each row."""
    columns = [rrd.rows(entity, f"modalwatch.{what}:{name}_{axis}")[1] for axis in "xyz"]
    return [np.array(row, float).T for row in zip(*columns, strict=True)]


def test_likelihood_along_the_members_is_read_back_exactly(rrd: Rrd) -> None:
    times, density = rrd.rows("/posterior/numbers", "modalwatch.Posterior:density")
    assert times.tolist() == [w.end for w in ANSWERED]
    _, mass = rrd.rows("/posterior/numbers", "modalwatch.Posterior:mass")
    _, member = rrd.rows("/posterior/numbers", "modalwatch.Posterior:member")
    at = points(rrd, "/posterior/numbers", "Posterior", "at")
    for k, window in enumerate(ANSWERED):
        profile = window.answer.profile
        assert density[k] == [p.density for p in profile]
        assert mass[k] == [p.mass for p in profile]
        assert member[k] == [p.member for p in profile]
        np.testing.assert_array_equal(at[k], [p.position for p in profile])


def test_credible_region_is_read_back(rrd: Rrd) -> None:
    _, member = rrd.rows("/posterior/region/numbers", "modalwatch.Region:member")
    start, end = (points(rrd, "/posterior/region/numbers", "Region", name) for name in ("from", "to"))
    for k, window in enumerate(ANSWERED):
        region = window.answer.region
        assert member[k] == [r.member for r in region]
        np.testing.assert_array_equal(start[k], [r.start for r in region])
        np.testing.assert_array_equal(end[k], [r.end for r in region])


def test_drawn_region_agrees_with_the_numbers(rrd: Rrd) -> None:
    """The drawing is 200 wide; members lie one after another."""
    unrolled = axis_of(LAST, RUN["reference"])
    _, strips = rrd.rows("/posterior/region", "LineStrips2D:strips")
    drawn = [[float(p[0]) for p in strip] for strip in strips[-1]]
    reported = [
        [200 * float(unrolled.along(r.member, np.array(p))) / unrolled.total for p in (r.start, r.end)]
        for r in LAST.region
    ]
    np.testing.assert_allclose(drawn, reported, atol=1e-4)  # single precision of some hundreds


def test_drawn_likelihood_agrees_with_the_numbers(rrd: Rrd) -> None:
    """The upper panel is 70 high, the best place at its top, the worst that is drawn at its bottom."""
    far = [sigmas(w.answer.profile) for w in ANSWERED]
    worst = min(30.0, max(3.0, *(float(f.max()) for f in far)))
    _, strips = rrd.rows("/posterior/place/curves", "LineStrips2D:strips")
    drawn = np.concatenate([np.array(strip, float) for strip in strips[-1]])
    unrolled = axis_of(LAST, RUN["reference"])
    inside = [k for k, f in enumerate(far[-1]) if f < worst]
    assert len(inside) > 1
    for k in inside:
        point = LAST.profile[k]
        x = 200 * float(unrolled.along(point.member, np.array(point.position))) / unrolled.total
        nearest = np.linalg.norm(drawn - (x, 70 * far[-1][k] / worst), axis=1).min()
        assert nearest < 1e-3


def test_answer_contains_each_alternative_location(rrd: Rrd) -> None:
    _, mass = rrd.rows("/answer/numbers", "modalwatch.Answer:mass")
    _, std = rrd.rows("/answer/numbers", "modalwatch.Answer:position_std")
    at = points(rrd, "/answer/numbers", "Answer", "at")
    assert [len(row) for row in mass] == [1] * (len(ANSWERED) - 1) + [2]
    assert mass[-1] == [LAST.mass, OTHER.mass]
    assert std[-1] == [LAST.position_std, OTHER.position_std]
    np.testing.assert_array_equal(at[-1], [LAST.position, OTHER.position])


def test_alternative_location_has_a_sphere_and_label_only_while_present(rrd: Rrd) -> None:
    _, balls = rrd.rows("/structure/mass/others", "Points3D:positions")
    assert [len(row) for row in balls] == [0] * (len(ANSWERED) - 1) + [1]
    np.testing.assert_allclose(balls[-1][0], OTHER.position, atol=1e-6)
    _, labels = rrd.rows("/structure/mass/others/names", "Points3D:labels")
    assert labels[-1] == ["or +200 g here (31.0 %)"]
    _, texts = rrd.rows("/now", "TextDocument:text")
    assert "or 200 ± 30 g added on the crossbeam at (0.250, 0.000, 1.480) m ± 20 mm (31.0 %)" in texts[-1][0]


@pytest.mark.parametrize("direction", ["x", "y", "z"])
def test_increments_and_their_deviations_are_read_back_exactly(direction: str, rrd: Rrd) -> None:
    found, column = ANSWERED[-1].increments, "xyz".index(direction)
    for name in ("increment", "increment_std", "normalised", "normalised_std"):
        times, rows = rrd.rows(f"/increment_curves/{direction}/numbers", f"modalwatch.Increments:{name}")
        assert times.tolist() == [w.end for w in ANSWERED]
        reported: list[Any] = [row[column] for row in getattr(found, name)]
        np.testing.assert_array_equal(np.array(rows[-1], float), np.array(reported, float))  # None is not-a-number
    _, limit = rrd.rows(f"/increment_curves/{direction}/numbers", "modalwatch.Increments:z_limit")
    assert limit[-1] == [found.z_limit]


def test_drawn_limits_are_the_deviations_times_the_limit(rrd: Rrd) -> None:
    """Both limits of y, in units of the largest normalised increment, from the middle of a panel 34 high."""
    found = ANSWERED[-1].increments
    largest = max(abs(v) for row in found.normalised for v in row if v is not None)
    unit = 34 / 2 / (1.15 * largest)
    for name, sign in (("over", -1), ("under", 1)):
        _, strips = rrd.rows(f"/increment_curves/y/{name}", "LineStrips2D:strips")
        heights = np.array([p[1] for strip in strips[-1] for p in strip]) - (46 + 17)
        np.testing.assert_allclose(heights, sign * unit * found.z_limit * 2e-3, rtol=1e-4)
