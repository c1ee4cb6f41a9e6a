"""The file is read back as any reader of .rrd files would."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from monitor.results.windows import WindowResult
from monitor.views.viewer import scene, write_recording
from monitor.views.viewer.primitives import clock
from monitor.views.viewer.state_lanes import event_list
from tests.support.monitor import answers
from tests.support.monitor import results as made
from tests.support.monitor.rrd_reader import Rrd

SITE = made.Site()
RUN = made.whole_run(SITE)
WINDOWS = RUN["windows"]
ENDS = [w.end for w in WINDOWS]
N_LEARNING, N_BEFORE = 8, 4
WATCHED = WINDOWS[N_LEARNING:]


def written(folder: Path, run: dict[str, Any]) -> Rrd:
    path = folder / "run.rrd"
    write_recording(path, made.run_results(run))
    assert [p.name for p in folder.iterdir()] == ["run.rrd"]
    return Rrd(path)


def shortened(**changes: Any) -> dict[str, Any]:
    return RUN | changes


def footbridge() -> dict[str, Any]:
    return made.whole_run(made.Site(text=made.BRIDGE, n_modes=14, place=(6.0, 2.0, 3.0), mass=-60.0))


def with_places(window: WindowResult, n: int) -> WindowResult:
    if window.answer is None:
        return window
    ends = [window.answer.profile[0], window.answer.profile[-1]]  # on two members
    return window.model_copy(update={"answer": window.answer.model_copy(update={"profile": ends[:n]})})


def all_failed() -> list[Any]:
    return [made.without_modes(w, "every channel is flat") for w in WINDOWS[:3]]


CASES = {
    "whole": RUN,
    "learning": made.learning_run(SITE),
    "learning, nothing identified": made.learning_run(SITE) | {"windows": all_failed()},
    "no alarms": shortened(alarms=[]),
    "no answers": shortened(windows=[w.model_copy(update={"answer": None}) for w in WINDOWS]),
    "no profiles": shortened(
        windows=[
            w.model_copy(update={"answer": w.answer and w.answer.model_copy(update={"profile": [], "region": []})})
            for w in WINDOWS
        ]
    ),
    "one place in the profile": shortened(windows=[with_places(w, 1) for w in WINDOWS]),
    "two places in the profile": shortened(windows=[with_places(w, 2) for w in WINDOWS]),
    "no spectra": shortened(windows=[w.model_copy(update={"spectrum": None}) for w in WINDOWS]),
    "watching, nothing identified": shortened(windows=[made.without_modes(w, "flat") for w in WATCHED], alarms=[]),
    "reference without watched windows": shortened(windows=WINDOWS[:N_LEARNING], alarms=[]),
    "one window": shortened(windows=WINDOWS[-1:]),
    "one mode": made.whole_run(made.Site(n_modes=1)),
    "footbridge": footbridge(),
    "increments and diagnosis": answers.with_findings(SITE, RUN),
    "signals": RUN | {"signals": made.signals(SITE, ENDS[-1])},
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Rrd]:
    """Return the recording of a case, each of which is written once."""
    return cache(lambda name: written(tmp_path_factory.mktemp("case"), CASES[name]))


@pytest.fixture(scope="module")
def rrd(recorded: Callable[[str], Rrd]) -> Rrd:
    return recorded("signals")


@pytest.mark.parametrize("name", CASES)
def test_every_view_has_data(name: str, recorded: Callable[[str], Rrd]) -> None:
    rrd = recorded(name)
    assert rrd.views
    for view in rrd.views:
        assert rrd.entities(view.origin), f"{view.name} looks at {view.origin}, where nothing is"


@pytest.mark.parametrize(
    ("name", "there", "not_there"),
    [
        ("whole", {"/structure", "/modes/mode_1", "/posterior", "/answer/mass", "/novelty"}, {"/signal/col_037_x"}),
        ("learning", {"/now", "/state", "/event_list", "/trend/found", "/spectrum"}, {"/structure", "/novelty"}),
        ("learning, nothing identified", {"/now", "/state", "/event_list"}, {"/spectrum", "/trend/found"}),
        ("no answers", {"/structure"}, {"/posterior", "/answer/mass"}),
        ("one place in the profile", {"/answer/mass"}, {"/posterior"}),
        ("two places in the profile", {"/answer/mass"}, {"/posterior"}),
        ("no spectra", {"/structure"}, {"/spectrum"}),
        ("footbridge", {"/modes/mode_14", "/trend/frequency/mode_14"}, {"/modes/mode_15"}),
        ("signals", {"/signal/col_037_x", "/signal/beam_right_z"}, set()),
    ],
)
def test_only_available_results_have_a_view(
    name: str, there: set[str], not_there: set[str], recorded: Callable[[str], Rrd]
) -> None:
    origins = {view.origin for view in recorded(name).views}
    assert there <= origins
    assert not not_there & origins


def test_recording_has_the_name_of_the_run(rrd: Rrd) -> None:
    (store,) = rrd.recordings
    assert store.application_id == "modalwatch"
    assert store.recording_id == f"{RUN['name']}-{WINDOWS[0].start}"


def test_card_of_each_window_begins_with_the_verdict(rrd: Rrd) -> None:
    times, cards = rrd.rows("/now", "TextDocument:text")
    assert times.tolist() == ENDS
    verdicts = [card[0].splitlines()[0] for card in cards]
    first_alarm = N_LEARNING + N_BEFORE + 1
    assert verdicts[0] == "# Learning the baseline"
    assert verdicts[N_LEARNING] == "# Normal"
    assert verdicts[first_alarm - 1] == "# Watch: over the limit"
    assert set(verdicts[first_alarm:]) == {"# ALARM since 00:09:20"}
    assert "channel mid is flat" in cards[first_alarm - 2][0]
    assert "| **2** | not identified |" in cards[N_LEARNING + 1][0]
    assert "added on the crossbeam" in cards[-1][0]


@pytest.mark.parametrize("number", range(1, SITE.n_modes + 1))
def test_shift_trend_has_gaps_for_unidentified_modes(rrd: Rrd, number: int) -> None:
    times, values = rrd.scalars(f"/trend/shift/mode_{number}")
    found = [[m.shift_percent / m.shift_std_percent for m in w.modes if m.id == number] for w in WATCHED]
    expected = [f[0] if f else np.nan for f in found]
    assert times.tolist() == [w.end for w in WATCHED]
    np.testing.assert_array_equal(values, expected)
    assert np.isnan(values).sum() == (2 if number == 2 else 1)  # the window without modes, and the one without mode 2


def test_frequency_has_a_band_of_two_standard_deviations(rrd: Rrd) -> None:
    _, values = rrd.rows("/trend/frequency/mode_3/measured", "Measurements:values")
    _, variances = rrd.rows("/trend/frequency/mode_3/measured", "Measurements:variances")
    mode = next(m for m in WATCHED[-1].modes if m.id == 3)
    assert values[-1] == [mode.frequency]
    assert variances[-1][0] == pytest.approx((2 * mode.frequency_std) ** 2, rel=1e-12)


def test_mode_identified_between_two_gaps_is_a_point(rrd: Rrd) -> None:
    times, values = rrd.scalars("/trend/frequency/mode_2/seen")
    assert times.tolist() == [w.end for w in WATCHED]
    assert np.isnan(values).tolist()[:4] == [False, True, False, True]


def test_frequencies_during_learning_have_no_mode_number(rrd: Rrd) -> None:
    times, values = rrd.scalars("/trend/found")
    learning = WINDOWS[:N_LEARNING]
    assert sorted(zip(times.tolist(), values, strict=True)) == sorted(
        (w.end, m.frequency) for w in learning for m in w.modes
    )


def test_novelty_is_the_logarithm_of_its_ratio_to_the_limit(rrd: Rrd) -> None:
    times, values = rrd.scalars("/novelty/index")
    expected = [np.log10(w.novelty.t2 / w.novelty.limit) if w.novelty else np.nan for w in WATCHED]
    assert times.tolist() == [w.end for w in WATCHED]
    np.testing.assert_allclose(values, expected, rtol=1e-12)
    assert values[0] < 0 < values[-1]
    assert rrd.scalars("/novelty/limit")[1].tolist() == [0.0, 0.0]


def test_state_lanes_follow_the_states(rrd: Rrd) -> None:
    times, states = rrd.rows("/state/daemon", "StateChange:state")
    troubled = WINDOWS[N_LEARNING + N_BEFORE - 1]
    assert [s[0] for s in states] == ["learning", "watching", "problem", "watching"]
    assert times.tolist() == [WINDOWS[0].start, WATCHED[0].start, troubled.start, troubled.end]
    times, states = rrd.rows("/state/structure", "StateChange:state")
    assert [s[0] for s in states] == ["unknown", "normal", "watch", "alarm"]
    assert times.tolist() == [WINDOWS[0].start, *(a.time for a in RUN["alarms"])]


def test_reference_of_an_earlier_run_leaves_no_unknown_state(tmp_path: Path) -> None:
    earlier = RUN["reference"].model_copy(update={"time": WATCHED[0].start - 10**9})
    rrd = written(tmp_path, shortened(reference=earlier, windows=WATCHED, alarms=[]))
    times, states = rrd.rows("/state/structure", "StateChange:state")
    assert (times.tolist(), [s[0] for s in states]) == ([WATCHED[0].start], ["normal"])


def test_each_event_is_one_row_and_all_are_listed_newest_first(rrd: Rrd) -> None:
    _, bodies = rrd.rows("/events", "TextLog:text")
    texts = [body[0] for body in bodies]
    assert texts[0] == "00:00:00  started: 12 channels"
    assert any("window 12 gave no modes: channel mid is flat" in t for t in texts)
    alarm = RUN["alarms"][-1]
    assert texts.count(f"00:09:20  {alarm.text}") == 1
    times, lists = rrd.rows("/event_list", "TextDocument:text")
    assert times[-1] == alarm.time
    listed = lists[-1][0].replace("\u00a0", " ").split("\n\n")
    assert [entry.replace("**", "") for entry in listed] == [t.replace("  ", " ", 1) for t in reversed(texts)]


def test_mass_is_drawn_with_position_and_value_of_the_answer(rrd: Rrd) -> None:
    times, places = rrd.rows("/structure/mass/body", "Points3D:positions")
    answers = [(w.end, w.answer) for w in WINDOWS if w.answer]
    assert times.tolist() == [end for end, _ in answers]
    np.testing.assert_allclose([p[0] for p in places], [a.position for _, a in answers], atol=1e-6)  # single precision
    _, labels = rrd.rows("/structure/mass/label", "Points3D:labels")
    answer = answers[-1][1]
    mass, place = labels[-1][0].split("\n")
    assert float(mass.split()[0]) == pytest.approx(1000 * answer.mass, abs=0.05)
    assert place == f"at crossbeam x {answer.position[0]:.3f} ± {answer.position_std:.3f} m"


def test_places_of_causes_are_drawn_until_the_alarm_ends(tmp_path: Path) -> None:
    """Of windows without a located mass, such as those of a crack."""
    windows = [w.model_copy(update={"answer": None}) for w in answers.with_findings(SITE, RUN)["windows"]]
    start, end = ENDS[-1], ENDS[-1] + made.WINDOW
    later = {"index": len(WINDOWS), "start": start, "end": end, "phase": "watching", "diagnosis": None}
    rrd = written(tmp_path, shortened(windows=[*windows, windows[-1].model_copy(update=later)]))
    explained = [w for w in windows if w.diagnosis]
    assert explained
    times, places = rrd.rows("/structure/causes/places", "Points3D:positions")
    assert times.tolist() == [w.end for w in explained]
    for found, window in zip(places, explained, strict=True):
        own = [c.where.position for c in window.diagnosis.causes if c.where and c.where.position]
        np.testing.assert_allclose(found, own, atol=1e-6)  # single precision
    cleared, recursive = rrd.rows("/structure/causes", "Clear:is_recursive")
    assert (cleared[-1], recursive[-1]) == (end, [True])


def test_sphere_radius_is_proportional_to_the_cube_root_of_the_mass() -> None:
    assert scene.sphere_radius(0.8) == pytest.approx(2 * scene.sphere_radius(0.1), rel=1e-12)
    assert scene.sphere_radius(-0.1) == scene.sphere_radius(0.1)


def test_answer_is_shown_until_the_alarm_ends(tmp_path: Path) -> None:
    """A window of the alarm without an answer changes neither the mass nor the card; the first one after it does."""
    later = []
    for k, phase in enumerate(["alarm", "watching"]):
        start = ENDS[-1] + k * made.WINDOW
        place = {"index": len(WINDOWS) + k, "start": start, "end": start + made.WINDOW, "answer": None}
        later.append(WINDOWS[-1].model_copy(update=place | {"phase": phase}))
    rrd = written(tmp_path, shortened(windows=[*WINDOWS, *later]))
    cleared, recursive = rrd.rows("/structure/mass", "Clear:is_recursive")
    assert (cleared[-1], recursive[-1]) == (later[1].end, [True])
    assert later[0].end not in cleared
    _, strips = rrd.rows("/structure/members", "LineStrips3D:strips")
    assert len(strips[-1]) == len(RUN["reference"].lines)
    _, cards = rrd.rows("/now", "TextDocument:text")
    shown = [f"*By window {WINDOWS[-1].index + 1}.*" in card[0] for card in cards[-3:]]
    assert shown == [False, True, False]


def test_member_colour_is_hottest_at_the_mass(rrd: Rrd) -> None:
    _, strips = rrd.rows("/structure/members", "LineStrips3D:strips")
    _, colours = rrd.rows("/structure/members", "LineStrips3D:colors")
    middle = np.mean(np.array(strips[-1]), axis=1)
    red = np.array([c >> 24 for c in colours[-1]])
    blue = np.array([c >> 8 & 0xFF for c in colours[-1]])
    hottest = middle[np.argmax(red.astype(int) - blue)]
    half_element = 0.025
    assert abs(abs(hottest[0]) - 0.25) <= half_element + 1e-6
    assert hottest[2] == pytest.approx(1.48, abs=1e-6)


def test_answer_trends_equal_the_results(rrd: Rrd) -> None:
    answers = [w.answer for w in WINDOWS if w.answer]
    _, place = rrd.scalars("/answer/place")
    np.testing.assert_allclose(place, [1000 * a.position_std for a in answers], rtol=1e-12)
    _, mass = rrd.rows("/answer/mass", "Measurements:values")
    np.testing.assert_allclose([m[0] for m in mass], [1000 * a.mass for a in answers], rtol=1e-12)


def test_identified_modes_are_marked_on_the_spectrum(rrd: Rrd) -> None:
    times, names = rrd.rows("/spectrum/modes/names", "Points2D:labels")
    drawn = dict(zip(times.tolist(), names, strict=True))
    assert drawn[ENDS[-1]] == ["1", "2", "3", "4", "5", "6"]
    assert drawn[ENDS[N_LEARNING + 1]] == ["1", "3", "4", "5", "6"]
    assert drawn.get(ENDS[0], []) == []


def test_stable_poles_are_drawn_separately(rrd: Rrd) -> None:
    spectrum = WINDOWS[-1].spectrum
    _, stable = rrd.rows("/spectrum/poles/stable", "Points2D:positions")
    assert len(stable[-1]) == sum(spectrum.pole_stable)


def test_mode_shape_is_static_over_time_and_animated_over_phase(rrd: Rrd) -> None:
    entity, component = "/modes/mode_4/shape", "LineStrips3D:strips"
    times, still = rrd.rows(entity, component)
    assert times.tolist() == [WINDOWS[0].start]
    phases, frames = rrd.rows(entity, component, "phase")
    assert len(frames) == len(set(phases.tolist())) == 48
    np.testing.assert_allclose(np.concatenate(frames[0]), np.concatenate(still[0]), atol=1e-6)
    rest = np.concatenate(rrd.static("/modes/mode_4/rest", component))
    opposite = 2 * rest - np.concatenate(still[0])
    np.testing.assert_allclose(np.concatenate(frames[24]), opposite, atol=1e-6)


def test_mode_shape_is_labelled_with_frequency_and_damping(rrd: Rrd) -> None:
    mode = RUN["reference"].modes[2]
    label = rrd.static("/modes/mode_3/name", "Points3D:labels")
    assert label == [f"mode 3: {mode.frequency:.2f} Hz, {100 * mode.damping:.2f} %"]


def test_signals_are_the_last_ten_seconds_with_their_gap(rrd: Rrd) -> None:
    signals = made.signals(SITE, ENDS[-1])
    times, values = rrd.scalars("/signal/col_037_x")
    n = round(10 * signals.rate)
    np.testing.assert_array_equal(values, signals.data[-n:, 0])
    assert np.isnan(values).sum() == round(0.5 * signals.rate)
    assert times[0] == ENDS[-1] - 10_000_000_000
    assert set(np.diff(times)) == {round(1e9 / signals.rate)}


def test_channel_with_special_characters_has_a_view(tmp_path: Path) -> None:
    signals = made.signals(SITE, ENDS[-1])
    odd = replace(signals.channels[0], name="beam left/z #1 °")
    signals = replace(signals, channels=(odd,), data=signals.data[:, :1])
    rrd = written(tmp_path, CASES["learning"] | {"signals": signals})
    (view,) = [v for v in rrd.views if v.name.startswith("beam left/z #1 ° [m/s²], scale ±")]
    assert rrd.entities(view.origin) == {view.origin}


@pytest.mark.parametrize("std", [0.0, float("inf"), float("nan")])
def test_mass_with_unknown_deviation_is_drawn(std: float, tmp_path: Path) -> None:
    answer = WINDOWS[-1].answer.model_copy(update={"mass_std": std})
    rrd = written(tmp_path, shortened(windows=[WINDOWS[-1].model_copy(update={"answer": answer})]))
    _, labels = rrd.rows("/structure/mass/label", "Points3D:labels")
    assert labels[0][0].startswith(f"{1000 * answer.mass:+.1f} ± {std:.1f} g\n")


def test_run_without_windows_is_refused() -> None:
    with pytest.raises(ValueError, match="windows: expected at least one, found none"):
        made.run_results(CASES["learning"] | {"windows": []})


def test_missing_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_recording(tmp_path / "missing" / "run.rrd", made.run_results(CASES["learning"]))


def test_failed_writing_keeps_the_older_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise MemoryError

    path = tmp_path / "run.rrd"
    path.write_bytes(b"older")
    monkeypatch.setattr("monitor.views.viewer.draw_states", fail)
    with pytest.raises(MemoryError):
        write_recording(path, made.run_results(CASES["learning"]))
    assert path.read_bytes() == b"older"
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]


def test_no_global_recording_is_left(rrd: Rrd) -> None:
    assert rrd.chunks
    assert rr.get_global_data_recording() is None
    assert rr.get_thread_local_data_recording() is None


def test_same_results_give_the_same_rows(rrd: Rrd, tmp_path: Path) -> None:
    again = written(tmp_path, RUN | {"signals": made.signals(SITE, ENDS[-1])})
    assert again.entities() == rrd.entities()
    assert {(v.kind, v.name, v.origin) for v in again.views} == {(v.kind, v.name, v.origin) for v in rrd.views}
    for entity in ("/structure/members", "/modes/mode_2/shape"):
        assert again.rows(entity, "LineStrips3D:strips")[1] == rrd.rows(entity, "LineStrips3D:strips")[1]


def test_long_run_keeps_complete_trends_and_thinned_drawings(tmp_path: Path) -> None:
    n = 320
    base = WINDOWS[-1]
    windows = [
        base.model_copy(update={"index": i, "start": base.start + i * made.WINDOW, "end": base.end + i * made.WINDOW})
        for i in range(n)
    ]
    rrd = written(tmp_path, shortened(windows=windows))
    assert len(rrd.scalars("/trend/shift/mode_1")[0]) == n
    drawn, _ = rrd.rows("/spectrum/singular_values", "LineStrips2D:strips")
    assert n // 4 <= len(drawn) <= 300 < n
    assert drawn[-1] == windows[-1].end


def test_recurring_event_is_one_line_at_its_last_time() -> None:
    lost, back = ("WARN", "Device a is lost"), ("WARN", "Device a samples again")
    happened = [(k * 10**9, *event) for k, event in enumerate([("INFO", "started"), lost, back, lost, back])]
    lines = event_list(happened).split("\n\n")
    assert lines == [
        f"**{clock(4 * 10**9)}** Device a samples again (2 times since {clock(2 * 10**9)})",
        f"**{clock(3 * 10**9)}** Device a is lost (2 times since {clock(10**9)})",
        f"**{clock(0)}** started",
    ]
