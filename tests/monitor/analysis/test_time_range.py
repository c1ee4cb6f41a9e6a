"""Ranges of time: one grammar for all commands, one clear error, and the same answer as from a log of that range."""

import json
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq import Channel, LogExcerpt, Recording, read_attachments, write_recording
from daq.log import log_span
from monitor.analysis.logs import log_recordings
from monitor.analysis.observation import Observation
from monitor.analysis.time_range import time_range
from monitor.errors import ArgumentError, StateError
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.oma.structures import chain, simulate

START = 1_767_225_600_000_000_000  # 2026-01-01T00:00:00Z
SECOND = 10**9
RATE = 40.0  # Hz
CHAIN = chain(4, first=2.0, damping=0.01)
REPLAY = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"


@pytest.fixture(scope="module")
def ambient() -> Recording:
    channels = tuple(Channel(name=name, device="d", axis=i) for i, name in enumerate(CHAIN.channels))
    return replace(simulate(CHAIN, 600.0, RATE, seed=5), channels=channels, start=START)


@pytest.fixture(scope="module")
def log(ambient: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("range") / "chain.mcap"
    write_recording(path, ambient)
    return path


def part(ambient: Recording, first: float, last: float) -> Recording:
    start, stop = round(first * RATE), round(last * RATE)
    return replace(ambient, data=ambient.data[start:stop], start=ambient.start + round(first * SECOND))


@pytest.mark.parametrize(
    ("start", "stop", "seconds"),
    [
        ("90", None, (90, 600)),
        ("1m30s", "2m", (90, 120)),
        ("1.5m", "0h2m0.5s", (90, 120.5)),
        (None, "-10", (0, 590)),
        ("-5m", "-4m", (300, 360)),
        ("2026-01-01T00:01:30Z", "2026-01-01 00:02", (90, 120)),
        ("2026-01-01T01:01:30+01:00", None, (90, 600)),
        ("2025-12-31", "1d", (0, 600)),
        ("-2h", "120", (0, 120)),
    ],
)
def test_range_selects_the_exact_samples(
    log: Path, ambient: Recording, start: str | None, stop: str | None, seconds: tuple[float, float]
) -> None:
    (found,) = log_recordings(time_range(start, stop).of_log(log))
    expected = part(ambient, *seconds)
    assert found.start == expected.start
    np.testing.assert_allclose(found.data, expected.data, rtol=0, atol=1e-8 * np.abs(ambient.data).max())  # of counts


@pytest.mark.parametrize(
    ("start", "stop", "says"),
    [
        ("700", None, "--from: 700 is outside the log: {log} holds 0 to 600 s, 2026-01-01T00:00:00Z to 2026-01-01T00:"),
        ("9" * 400, None, "--from: 9999999"),
        ("600", None, "--from: 600 is outside the log"),
        (None, "0", "--to: 0 is outside the log"),
        (None, "-11m", "--to: -11m is outside the log"),
        ("2027-01-01", None, "--from: 2027-01-01 is outside the log"),
        ("100", "50", "--from, --to: expected a start before the end, found 100 and 50; {log} holds 0 to 600 s"),
        ("100", "100", "--from, --to: expected a start before the end, found 100 and 100"),
        ("100", "101.5", "--from, --to: expected at least 2 s of samples, found 1.5 s in 100 to 101.5 s"),
        ("-1", None, "--from: expected at least 2 s of samples, found 1 s"),
        ("noon", None, "--from: expected seconds from the start of the log (90, 1h30m; -10m from its end) or a time"),
        (None, "", "--to: expected seconds"),
        ("1e3", None, "--from: expected seconds"),
        ("5m1h", None, "--from: expected seconds"),
        ("1h30", None, "--from: expected seconds"),  # minutes or seconds?
    ],
)
def test_invalid_range_is_refused(
    modalwatch: Commands, log: Path, start: str | None, stop: str | None, says: str
) -> None:
    given = [text for pair in (("--from", start), ("--to", stop)) if pair[1] is not None for text in pair]
    assert_refused(modalwatch("identify", log, *given), says.format(log=log))


def test_range_applies_across_several_logs(tmp_path: Path, ambient: Recording) -> None:
    paths = [tmp_path / f"{k}.mcap" for k in range(3)]
    for k, path in enumerate(paths):
        write_recording(path, part(ambient, 200 * k, 200 * k + 100))  # pauses of 100 s
    found = time_range("50", "250").of_logs(paths)
    assert [log.log for log in found if isinstance(log, LogExcerpt)] == paths[:2]
    spans = [((r.start - START) / SECOND, (r.end - START) / SECOND) for log in found for r in log_recordings(log)]
    assert spans == [(50, 100), (200, 250)]
    with pytest.raises(ArgumentError, match="expected at least 2 s of samples, found 0 s in 110 to 190 s"):
        time_range("110", "190").of_logs(paths)


def test_identify_with_a_range_equals_identify_of_a_cut_log(
    modalwatch: Commands, log: Path, ambient: Recording, tmp_path: Path
) -> None:
    write_recording(tmp_path / "part.mcap", part(ambient, 100, 400))
    done = modalwatch("identify", log, "--from", 100, "--to", 400, "--window", 150, "--json", tmp_path / "a.json")
    assert (done.code, done.err) == (0, "")
    assert "range: 100 to 400 s of 600 s, 2026-01-01T00:01:40Z to 2026-01-01T00:06:40Z" in done.out
    assert "chain.mcap (100 to 400 s): 2 windows of 150 s" in done.out
    assert modalwatch("identify", tmp_path / "part.mcap", "--window", 150, "--json", tmp_path / "b.json").code == 0
    a, b = (json.loads((tmp_path / name).read_text()) for name in ("a.json", "b.json"))
    assert a["window"]["start"] == b["window"]["start"] == START + 100 * SECOND
    for x, y in zip(a["modes"], b["modes"], strict=True):
        assert x["frequency"]["value"] == pytest.approx(y["frequency"]["value"], rel=1e-6)
        assert x["damping"]["value"] == pytest.approx(y["damping"]["value"], rel=1e-3)


@pytest.mark.thorough
def test_reported_time_of_change_is_valid_as_range_limit(
    modalwatch: Commands, ambient: Recording, tmp_path: Path
) -> None:
    other = simulate(chain(4, first=2.04, damping=0.01), 600.0, RATE, seed=6)
    changed = np.concatenate([part(ambient, 0, 300).data, other.data[: round(300 * RATE)]])
    write_recording(tmp_path / "log.mcap", replace(ambient, data=changed))
    text = modalwatch("identify", tmp_path / "log.mcap").out
    found = re.search(r"changed within the record, at (\S+) ± (\S+) s.*with --to and --from", text)
    assert found
    done = modalwatch("identify", tmp_path / "log.mcap", "--to", found[1])
    assert (done.code, done.err) == (0, "")
    assert "changed within the record" not in done.out


@pytest.fixture
def structure(tmp_path: Path) -> Path:
    path = tmp_path / "structure.toml"
    path.write_text(read_attachments(REPLAY)["structure.toml"], encoding="utf-8")
    return path


def test_diagnose_takes_both_states_from_one_log(
    modalwatch: Commands, structure: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    observed: list[tuple[float, float]] = []

    def observe(recordings: Iterable[Recording], *_: object) -> Observation:
        windows = list(recordings)
        observed.append((windows[0].start * 1e-9, windows[-1].end * 1e-9))
        return Observation(
            windows=None,  # type: ignore[arg-type]
            estimates=(),
            tracks=(),
            temperature=np.empty(0),
            rms=np.empty(0),
        )

    def explain(*_: object, **__: object) -> None:
        raise StateError("current", "enough is known")

    monkeypatch.setattr("monitor.cli.data.log_observation.observe", observe)
    monkeypatch.setattr("monitor.cli.data.diagnose.diagnosis.explain_record", explain)
    monkeypatch.setattr("monitor.analysis.selection.Selection.of_observation", lambda _, observation: observation)
    states = ("--from", "2m18s", "--reference", REPLAY, "--reference-to", "2m5s", "--window", 15)
    assert_refused(modalwatch("diagnose", structure, REPLAY, *states), "enough is known")
    assert_refused(
        modalwatch("diagnose", structure, REPLAY, *states, "--held-out", REPLAY),
        f"--held-out: {REPLAY} has samples that the fit uses too ({REPLAY} (138 to ",
    )
    span = log_span(REPLAY)
    assert span
    begin, end = (1e-9 * time for time in span)
    before, after = observed
    assert begin + 138 <= after[0] < after[1] <= end
    assert begin <= before[0] < before[1] <= begin + 125


def test_range_is_refused_for_a_table_or_a_missing_reference(
    modalwatch: Commands, structure: Path, tmp_path: Path
) -> None:
    table = tmp_path / "modes.csv"
    table.write_text("frequency\n10.5\n38\n67\n", encoding="utf-8")
    done = modalwatch("diagnose", structure, table, "--from", 5)
    assert_refused(done, "--from, --to: expected a log, found a table of modes")
    done = modalwatch("diagnose", structure, REPLAY, "--reference-to", 5)
    assert_refused(done, "--reference-from, --reference-to: expected --reference LOG, found none")
    done = modalwatch("diagnose", structure, REPLAY, "--held-out-from", 5)
    assert_refused(done, "--held-out-from, --held-out-to: expected --held-out LOG, found none")
    done = modalwatch("diagnose", structure, REPLAY, "--to", 100, "--held-out", REPLAY, "--held-out-from", 90)
    assert_refused(done, "has samples that the fit uses too")
