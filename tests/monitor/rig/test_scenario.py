from pathlib import Path

import numpy as np
import pytest

from monitor.cli.demo.rig import SCENARIOS
from monitor.cli.demo.rig_output import _event_text
from monitor.errors import SettingsError
from monitor.rig import Scenario, draw_t_frame, dump_scenario, load_scenario, shipped_scenarios
from monitor.rig.process import load_rig_structure
from tests.support.monitor.rig import nominal
from updater import Body

BETWEEN = (30.0, 50.0)


def drawn(n: int) -> list[Scenario]:
    return [draw_t_frame("t_structure", seed, duration=100, between=BETWEEN) for seed in range(n)]


def within(values: list[float], low: float, high: float) -> None:
    """Fill the range, and stay in it: 200 uniform draws miss an end tenth with probability 0.9^200 < 1e-9."""
    assert low <= min(values) <= low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) <= max(values) <= high


@pytest.fixture(scope="module")
def scenarios() -> list[Scenario]:
    return drawn(200)


def added(scenarios: list[Scenario]) -> list[Body]:
    """Return the body of the event of each scenario."""
    bodies = [scenario.event[0].body for scenario in scenarios]
    return [body for body in bodies if body]


def test_drawn_parameters_cover_their_ranges(scenarios: list[Scenario]) -> None:
    within([s.truth.stiffness_factor for s in scenarios], 0.98, 1.02)
    within([s.truth.density_factor for s in scenarios], 0.99, 1.01)
    within([c for s in scenarios for c in s.truth.foot_flexibility], 0.002, 0.01)
    within([c for s in scenarios for c in s.truth.joint_flexibility], 0.002, 0.01)
    within([d for s in scenarios for d in s.truth.damping], 0.002, 0.01)
    within([d.clock_error for s in scenarios for d in s.device], -20e-6, 20e-6)
    within([s.event[0].at for s in scenarios], *BETWEEN)
    bodies = added(scenarios)
    within([body.mass for body in bodies], 0.150, 0.300)
    within([float(np.linalg.norm(body.offset)) for body in bodies], 0.01, 0.02)
    assert {len(s.truth.damping) for s in scenarios} == {24}


def test_bodies_are_spread_over_crossbeam_and_upper_column(scenarios: list[Scenario]) -> None:
    places = np.array([body.at for body in added(scenarios)])
    on_beam = places[:, 2] == 1.48
    np.testing.assert_array_equal(places[:, 1], 0)
    np.testing.assert_array_equal(places[~on_beam, 0], 0)
    within(places[on_beam, 0].tolist(), -0.40, 0.40)
    within(places[~on_beam, 2].tolist(), 0.50, 1.48)
    share = 0.80 / 1.78  # by length; four standard deviations of a binomial share
    assert abs(on_beam.mean() - share) < 4 * np.sqrt(share * (1 - share) / len(places))


def test_offsets_are_transverse_and_inertia_is_physical(scenarios: list[Scenario]) -> None:
    for body in added(scenarios):
        along = 0 if body.at[2] == 1.48 else 2
        assert body.offset[along] == pytest.approx(0, abs=1e-15)
        a, b, c = sorted(body.inertia)
        assert 0 < a < b < c < a + b  # the triangle inequality of principal moments
        assert c < body.mass * 0.04**2 / 3  # a steel block of 300 g is 3.4 cm wide, or up to 4 cm drawn out


def test_scenario_is_determined_by_its_seed(scenarios: list[Scenario]) -> None:
    assert drawn(3) == scenarios[:3]
    assert len({body.at for body in added(scenarios)}) == 200


def test_scenario_without_interval_has_no_event() -> None:
    assert draw_t_frame("t_structure", 1, duration=10, between=None).event == ()


@pytest.mark.parametrize("between", [(50.0, 30.0), (1.0, 5.0), (30.0, 200.0)])
def test_an_impossible_interval_is_refused(between: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="between: expected two ascending times from 2 s to 100 s, found"):
        draw_t_frame("t_structure", 1, duration=100, between=between)


@pytest.mark.parametrize("seed", range(5))
def test_scenario_is_unchanged_by_saving_and_loading(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "scenario.toml"
    scenario = draw_t_frame('odd "name\\ of ünicode.toml', seed, duration=0, between=BETWEEN)
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(path) == scenario


GOOD = """
structure = "t_structure"
seed = 1
duration = 10

[[device]]
name = "top"
at = [0, 0, 1.48]

[[event]]
at = 5
body = {at = [0.2, 0, 1.48], mass = 0.2}
"""


def test_minimal_scenario_file_is_loaded(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(GOOD, encoding="utf-8")
    scenario = load_scenario(path)
    assert scenario.event[0].body == Body(at=(0.2, 0, 1.48), mass=0.2)
    assert load_rig_structure(path, scenario).name == "T-shaped steel frame"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("at = 5", 'at = 5\nkind = "crack"', r"event\.0: .*expected crack for kind 'crack', found body"),
        ("seed = 1", "", "seed: Field required"),
        ("seed = 1", "seed = -1", "seed: .*, found -1"),
        ("seed = 1", "seed = 1\nsped = 2", "sped: Extra inputs.*, found 2"),
        ("duration = 10", "duration = nan", "duration: .*expected a number from .*, found nan"),
        ("at = [0, 0, 1.48]", "at = [0, 0]", r"device\.0\.at\.2: Field required"),
        ("at = 5", "at = 0.5", r"event\.0\.at: .*, found 0\.5"),
        (
            "body = {at = [0.2, 0, 1.48], mass = 0.2}",
            'kind = "crack"\ncrack = {member = "column", distance = 0, axis = "y", flexibility = 0.01, closed = 0.02, '
            'moment = 1, opens = "slips"}',
            r"event\.0\.crack: .*expected closed <= flexibility, found 0\.02, 0\.01",
        ),
        ("at = 5", 'at = 5\nkind = "earthquake"', r"event\.0\.kind: .*'add_body' or 'crack', found 'earthquake'"),
        ("[[event]]", '[[device]]\nname = "top"\nat = [0, 0, 1]\n[[event]]', "the name 'top' is given twice"),
        ("[[event]]", "[truth]\ndamping = [0.01]\n[[event]]", r"truth\.damping: .*at least 8"),
        ("seed = 1", "seed = ", "Invalid value .*line 3"),
    ],
)
def test_error_names_file_key_and_found_value(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(SettingsError, match=message) as caught:
        load_scenario(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"none\.toml: cannot be read: No such file"):
        load_scenario(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("at = [0, 0, 1.48]", "at = [0, 0.1, 1.48]", r"device\.0\.at"),
        ("at = [0.2, 0, 1.48]", "at = [0.41, 0, 1.48]", r"event\.0\.body\.at"),
    ],
)
def test_points_off_the_structure_are_reported(tmp_path: Path, old: str, new: str, key: str) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(SettingsError, match=rf"{key}: expected a point on a member of T-shaped .*, found \["):
        load_rig_structure(path, load_scenario(path))


def test_events_default_to_none() -> None:
    assert nominal().event == ()


def test_shipped_scenarios_are_those_of_the_command_and_can_be_played() -> None:
    assert tuple(shipped_scenarios()) == SCENARIOS
    for path in shipped_scenarios().values():
        scenario = load_scenario(path)
        assert load_rig_structure(path, scenario).sensor
    assert [len(load_scenario(shipped_scenarios()[name]).event) for name in SCENARIOS] == [1, 1, 1, 1, 0, 2]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("breathing-crack", "the column has a crack that opens above 0 N m, 0.3 m from its start, about local y"),
        ("play-in-foot", "the column has play within 0.006 N m on both sides, 0 m from its start, about local y"),
    ],
)
def test_cracks_and_play_are_announced_by_their_law(name: str, text: str) -> None:
    (event,) = load_scenario(shipped_scenarios()[name]).event
    assert _event_text(event) == text
