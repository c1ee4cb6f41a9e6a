"""The geometry and the arithmetic of the drawings."""

import itertools
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq import FloatArray
from monitor.results.run_results import RunResults, thin
from monitor.results.windows import ProfilePoint, ReferenceResult
from monitor.views.geometry import FIELD_OF_VIEW, Geometry, screen
from monitor.views.member_axis import Unrolled, axis_of, label_rows, places, side_by_side, sigmas, ticks
from monitor.views.palette import heat, mode_colour
from monitor.views.viewer.layout.view_specs import best_grid
from monitor.views.viewer.primitives import Axes, readable_ticks
from monitor.views.viewer.scene import common_name, heated_members
from monitor.views.viewer.spectrum import spectrum_axes
from tests.support.monitor import results as made

SITE = made.Site()
REFERENCE = SITE.reference(made.START, 8)
BRIDGE = made.Site(text=made.BRIDGE, n_modes=3).reference(made.START, 8)
FLOATS = st.floats(-1e3, 1e3, allow_nan=False)


@pytest.mark.parametrize("reference", [REFERENCE, BRIDGE], ids=["t_frame", "footbridge"])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 2.0])
@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (24.0, 12.0), (38.0, 24.0), (-60.0, 70.0)])
def test_camera_is_as_close_as_all_points_allow(
    reference: ReferenceResult, aspect: float, azimuth: float, elevation: float
) -> None:
    geometry, fill = Geometry(reference), 0.9
    towards = geometry.side(azimuth, elevation)
    eye = geometry.eye(towards, geometry.nodes, aspect, fill)
    np.testing.assert_allclose(np.linalg.norm(towards), 1.0, rtol=1e-12)
    right, up = screen(towards)
    seen = geometry.nodes - eye.position
    depth = -(seen @ towards)
    share = np.abs(seen @ np.column_stack([right, up])) / depth[:, None] / np.tan(FIELD_OF_VIEW / 2) / [aspect, 1.0]
    assert depth.min() > 0
    assert share.max() == pytest.approx(fill, rel=1e-9)


def test_broad_side_of_a_structure_is_shown() -> None:
    along_x, along_y = Geometry(REFERENCE), Geometry(turned(REFERENCE))
    np.testing.assert_allclose(along_x.side(0, 0), [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(along_y.side(0, 0), [1, 0, 0], atol=1e-12)


def turned(reference: ReferenceResult) -> ReferenceResult:
    return reference.model_copy(update={"nodes": [(y, x, z) for x, y, z in reference.nodes]})


def test_supports_are_the_nodes_that_no_mode_moves() -> None:
    assert Geometry(REFERENCE).held.tolist() == [0]
    ends = Geometry(BRIDGE).nodes[Geometry(BRIDGE).held]
    np.testing.assert_allclose(sorted(ends.tolist()), [[0, 0, 3], [18, 6, 3]], atol=1e-9)


def test_lowest_node_is_the_support_if_all_nodes_move() -> None:
    free = [m.model_copy(update={"displacement": [(1.0, 0.0, 0.0)] * len(REFERENCE.nodes)}) for m in REFERENCE.modes]
    assert Geometry(REFERENCE.model_copy(update={"modes": free})).held.tolist() == [0]
    ends = Geometry(BRIDGE).held
    assert Geometry(BRIDGE.model_copy(update={"modes": []})).held.tolist() == ends.tolist()  # all as high: the ends
    assert Geometry(REFERENCE.model_copy(update={"modes": []})).held.tolist() == [0]


def test_position_text_uses_the_axis_parallel_to_the_member() -> None:
    assert Geometry(REFERENCE).place("column", np.array([0, 0, 0.521])) == "column z 0.521"
    assert Geometry(REFERENCE).place("crossbeam", np.array([0.25, 0, 1.48])) == "crossbeam x 0.250"
    half = float(np.hypot(9.0, 3.0))
    assert Geometry(BRIDGE).place("deck", np.array([9.0, 3.0, 3.0])) == f"deck, from its start {half:.3f}"


@pytest.mark.parametrize("std", [0.004, 0.05, 0.4])
def test_sigmas_of_a_gaussian_posterior_are_the_distance_in_its_standard_deviations(std: float) -> None:
    x, best = np.linspace(0, 1.5, 151), 0.52
    density = np.exp(-0.5 * ((x - best) / std) ** 2) / (std * np.sqrt(2 * np.pi))
    profile = [
        ProfilePoint(member="a", position=(0, 0, z), density=d, mass=1.0) for z, d in zip(x, density, strict=True)
    ]
    distance = np.abs(x - best) / std
    near = distance < 30
    np.testing.assert_allclose(sigmas(profile)[near], distance[near], atol=1e-6)
    assert np.all(sigmas(profile)[~near] >= 29.9)


def test_members_are_unrolled_one_after_another() -> None:
    answer = SITE.answer(SITE.mass * SITE.sensitivity[:, SITE.node(SITE.place)], 4)
    unrolled = Unrolled(places(answer))
    assert unrolled.length == pytest.approx({"column": 1.48, "crossbeam": 0.8}, abs=1e-9)
    assert unrolled.offset["column"] == 0
    assert unrolled.offset["crossbeam"] > 1.48
    end = unrolled.along("crossbeam", np.array([0.4, 0.0, 1.48]))
    assert float(end) == pytest.approx(unrolled.total, abs=1e-9)
    assert all(0 <= x <= unrolled.total for x, _ in unrolled.ticks())


def test_profile_near_the_best_place_is_drawn_on_whole_members() -> None:
    """Refined answers have a profile of some centimetres: distances are those from the start of the member."""
    whole = SITE.answer(SITE.mass * SITE.sensitivity[:, SITE.node(SITE.place)], 4)
    near = [p for p in whole.profile if p.member == "crossbeam" and abs(p.position[0] - 0.2) < 0.11]
    answer = whole.model_copy(update={"profile": near})
    unrolled = axis_of(answer, REFERENCE)
    assert unrolled.length == pytest.approx({"crossbeam": 0.8}, abs=1e-9)
    assert float(unrolled.along("crossbeam", np.array([0.2, 0.0, 1.48]))) == pytest.approx(0.6, abs=1e-9)
    assert axis_of(answer, None).length["crossbeam"] < 0.25
    for profile in (near, whole.profile):
        drawn, _ = heated_members(Geometry(REFERENCE), answer.model_copy(update={"profile": profile}))
        length = sum(float(np.linalg.norm(np.diff(part, axis=0), axis=1).sum()) for part in drawn)
        assert length == pytest.approx(1.48 + 0.8, abs=1e-9)


def test_synthetic_answer_lies_at_the_mass_or_its_mirror_image() -> None:
    answer = SITE.answer(SITE.mass * SITE.sensitivity[:, SITE.node(SITE.place)], 4)
    assert abs(answer.position[0]) == pytest.approx(0.25, abs=1e-9)
    assert answer.mass == pytest.approx(SITE.mass, rel=1e-9)


@settings(deadline=None)  # a busy machine is not an error
@given(low=FLOATS, length=st.floats(1e-3, 1e4), most=st.integers(2, 12))
def test_ticks_are_evenly_spaced_inside_and_few(low: float, length: float, most: int) -> None:
    found = ticks(low, low + length, most)
    assert 1 <= len(found) <= most + 1
    slack = 1e-6 * length + 1e-9 * abs(low)
    assert low - slack <= found[0]
    assert found[-1] <= low + length + slack
    assert np.ptp(np.diff(found)) <= slack if len(found) > 2 else True
    assert not np.signbit(found[found == 0]).any()


@settings(deadline=None)  # a busy machine is not an error
@given(places=st.lists(st.floats(0, 200), max_size=12), apart=st.floats(0.1, 10))
def test_labels_of_close_modes_do_not_overlap(places: list[float], apart: float) -> None:
    ascending = np.sort(np.array(places, float))
    moved = side_by_side(ascending, apart, end=200.0)
    assert np.all(np.diff(moved) >= apart - 1e-9)
    if np.all(np.diff(ascending) >= apart):
        np.testing.assert_allclose(moved, ascending, rtol=0, atol=1e-9)


@settings(deadline=None)  # a busy machine is not an error
@given(places=st.lists(st.floats(0, 200), max_size=14), length=st.integers(1, 30), most=st.integers(1, 3))
def test_labels_in_rows_do_not_overlap(places: list[float], length: int, most: int) -> None:
    """Neighbours in a row have room; a label is left out only where every row is occupied."""
    middle = np.sort(np.array(places, float))
    width = 2.0 * (length + 1)
    rows = label_rows(middle, ["m" * length] * len(middle), 2.0, most)
    for row in range(most):
        assert np.all(np.diff(middle[rows == row]) >= width - 1e-9)
    for left_out in middle[rows < 0]:
        for row in range(most):
            before = middle[(rows == row) & (middle <= left_out)]
            assert left_out - before.max() < width + 1e-9


def test_names_of_twelve_members_have_rows_of_their_own() -> None:
    """Four columns of 2 m and eight beams of a frame of two storeys, in a drawing of some 75 characters."""
    columns = {f"column {k}": 2.0 for k in range(1, 5)}
    beams = {f"{level} beam {k}": 1.2 - 0.4 * (k % 2) for level in ("middle", "top") for k in range(1, 5)}
    members = columns | beams
    unrolled = Unrolled((name, (0.0, 0.0, z)) for name, length in members.items() for z in (0.0, length))
    names = unrolled.names(unrolled.total / 75, 3)
    assert [name for name, _, _ in names] == list(members)
    assert {row for _, _, row in names} == {0, 1, 2}


def test_ticks_without_room_have_no_text() -> None:
    found = readable_ticks(axes(), [(0.0, "0"), (0.5, "0.5"), (0.55, "0"), (1.0, "0.5")], character=2.0)
    assert list(found.values()) == ["0", "0.5", "", "0.5"]


def axes() -> Axes:
    return Axes(left=0, top=0, width=100, height=50, x_range=(0.0, 1.0), y_range=(0.0, 10.0))


@pytest.mark.parametrize(
    ("y", "lengths"),
    [([1, 2, 3, 4, 5], [5]), ([20, 20, 5, 20, 20], [3]), ([5, 20, 20, 5, 5], [2, 3]), ([20, 20, 20, 20, 20], [])],
)
def test_curve_is_cut_at_the_frame(y: list[float], lengths: list[int]) -> None:
    runs = axes().runs(np.linspace(0, 1, 5), np.array(y, float))
    assert [len(run) for run in runs] == lengths
    assert all(run[:, 1].min() >= 0 and run[:, 1].max() <= 50 for run in runs)


def test_crossing_of_the_frame_is_interpolated() -> None:
    (run,) = axes().runs(np.array([0.0, 1.0]), np.array([0.0, 20.0]))
    np.testing.assert_allclose(run, [[0, 50], [50, 0]], atol=1e-9)


def test_flat_spectrum_has_a_valid_axis_range() -> None:
    window = SITE.window(0, "learning", np.zeros(SITE.n_modes))
    flat = window.spectrum.model_copy(update={"singular_values": [[-60.0] * 257]}) if window.spectrum else None
    run_results = RunResults(
        name="flat",
        reference=None,
        windows=(window.model_copy(update={"spectrum": flat}),),
        alarms=(),
        signals=None,
    )
    low, high = spectrum_axes(run_results).y_range
    assert low <= -60 < high


def test_each_mode_has_a_unique_colour() -> None:
    colours = [mode_colour(number) for number in range(1, 61)]
    assert len(set(colours)) == len(colours)
    assert all(0 <= c <= 255 for colour in colours for c in colour)


def test_heat_colours_change_from_steel_to_red() -> None:
    colours: FloatArray = heat(np.linspace(-0.5, 1.5, 21)).astype(float)
    assert np.all(np.diff(colours[:, 0] - colours[:, 2]) >= -30)
    np.testing.assert_array_equal(colours[0], colours[5])
    np.testing.assert_array_equal(colours[-1], colours[15])


@pytest.mark.parametrize(
    ("names", "expected"),
    [(["beam_left_y", "beam_left_z"], "beam_left"), (["a"], "a"), (["x", "y"], "x"), (["a1", "a1b"], "a1")],
)
def test_sensor_position_is_named_by_the_common_part_of_its_channels(names: list[str], expected: str) -> None:
    assert common_name(names) == expected


@settings(deadline=None)  # a busy machine is not an error
@given(n=st.integers(0, 2000), most=st.integers(1, 300))
def test_thinned_items_are_limited_evenly_spaced_and_include_the_last(n: int, most: int) -> None:
    kept = thin(list(range(n)), most)
    assert len(kept) <= most
    assert kept[-1:] == list(range(n))[-1:]
    assert len({b - a for a, b in itertools.pairwise(kept)}) <= 1


@settings(deadline=None)  # a busy machine is not an error
@given(n=st.integers(1, 40), aspect=st.floats(0.2, 8))
def test_best_grid_gives_the_largest_pictures(n: int, aspect: float) -> None:
    def size(columns: int) -> float:
        return min(2.1 / columns / aspect, 1 / -(-n // columns))

    columns, cell = best_grid(n, aspect)
    assert size(columns) == max(size(c) for c in range(1, min(n, 6) + 1))
    assert cell == pytest.approx(2.1 / columns * -(-n // columns), rel=1e-12)


def test_command_line_does_not_import_rerun() -> None:
    code = "import sys, monitor.cli.main; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
