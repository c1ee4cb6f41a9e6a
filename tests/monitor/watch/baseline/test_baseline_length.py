"""A baseline that is too short is continued, or used with a message where its length was set."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from daq import FloatArray, Recording
from monitor.results.windows import AlarmResult, Result
from monitor.settings import parse_settings
from monitor.watch.baseline.learning import shortcomings
from monitor.watch.memory import memory_text, parse_memory
from tests.examiner.sites import KINDS, SimulatedSites, SiteKind
from tests.support.monitor.played_windows import BASELINE, Played, run, site_text, without_answers
from tests.support.updater.reference_frame import measure, true_model
from updater import Body, TrackedModes, stack_tracks

HOURLY = next(kind for kind in KINDS if kind.name == "bridge, hourly")
BRIDGE = replace(HOURLY, wind=2.0, correlated=0.5, thermometer="badly placed", slope=(-1.2e-3, 6e-4))
INDOORS = SiteKind(name="indoors", slope=(0.0, 0.0), thermometer="absent")
PUMP = Body(at=(0.0, 0.0, 0.9), mass=0.25)
N_SITES, SEED = 12, 21


def tracked(log_frequency: FloatArray) -> TrackedModes:
    """Return modes of these log frequencies (n_windows, n_tracks); nothing else of them is looked at."""
    return replace(_one_window(), log_frequency=log_frequency)


@cache
def _one_window() -> TrackedModes:
    random = np.random.default_rng(1)
    return stack_tracks([measure(true_model(np.random.default_rng(1), None), random, np.ones(12))], [np.arange(3)])


def lacking(kind: SiteKind, n: int) -> list[tuple[str, int]]:
    """Return the shortcomings of the baselines of simulated sites, and the windows that they need."""
    w = SimulatedSites(kind, N_SITES, SEED).windows(n)
    found = []
    for i in range(N_SITES):
        short = shortcomings(tracked(np.log(w.frequency[i])), w.time, w.temperature[i], kind.step)
        found.append(("; ".join(s.text for s in short), max((s.needed for s in short), default=n)))
    return found


def test_required_baseline_length_of_a_bridge_and_an_indoor_site() -> None:
    """A bridge with wind, autocorrelated errors and a thermometer in the sun: 24 windows raise 21 alarms per year."""
    day, week, hall = lacking(BRIDGE, 24), lacking(BRIDGE, 144), lacking(INDOORS, 24)
    print(
        f"seed {SEED}: {day[0]}; median {np.median([n for _, n in day])} and {np.median([n for _, n in week])} needed"
    )
    assert sum("independent ones where 4 modes need 15" in text for text, _ in day) >= 0.9 * N_SITES
    assert np.median([n for _, n in day]) > 72
    assert np.median([n for _, n in week]) < 432
    assert sum(not text for text, _ in hall) >= 0.9 * N_SITES


def test_four_hours_of_baseline_with_temperature_change_are_too_short() -> None:
    found = [text for text, needed in lacking(KINDS[0], 24) if "of a daily cycle" in text and needed >= 144]
    print(found[0])
    assert len(found) >= 0.7 * N_SITES
    assert not any("of a daily cycle" in text for text, _ in lacking(KINDS[0], 144))


def test_missing_temperature_readings_do_not_change_the_required_length() -> None:
    """Every eighth reading is missing."""
    n = 24
    y = 1e-3 * np.random.default_rng(1).standard_normal((n, 4))
    seconds, celsius = np.linspace(0.0, 600.0 * (n - 1), n), np.linspace(5.0, 17.0, n)
    whole = shortcomings(tracked(y), seconds, celsius, 600.0)
    celsius[4::8] = np.nan
    assert whole == shortcomings(tracked(y), seconds, celsius, 600.0)
    assert whole[0].needed == 144
    celsius[::2] = np.nan
    assert not shortcomings(tracked(y), seconds, celsius, 600.0)


def warmed(windows: Iterator[Recording], celsius: FloatArray) -> Iterator[Recording]:
    for window, temperature in zip(windows, celsius, strict=True):
        yield replace(window, temperature=float(temperature))


def texts(results: list[Result]) -> list[str]:
    return [r.text for r in results if isinstance(r, AlarmResult)]


def played(monkeypatch: pytest.MonkeyPatch) -> Played:
    """Return windows of a site of at most 48 windows of baseline, whose number is not set."""
    without_answers(monkeypatch)
    site = Played(5, monkeypatch)
    text = site_text().replace(f"baseline_windows = {BASELINE}", "baseline_windows_max = 48")
    site.settings = parse_settings(text)
    return site


def test_extended_learning_is_reported_once_and_continues_after_a_restart(monkeypatch: pytest.MonkeyPatch) -> None:
    site = played(monkeypatch)
    celsius = np.linspace(10.0, 16.0, 48)
    pipeline = site.pipeline()
    (first,) = texts(run(pipeline, warmed(site.windows(24), celsius[:24])))
    print(first)
    assert first == (
        "the baseline of 24 windows is too short: it covers 4 h of a daily cycle (the temperature moved by 2.9 K); "
        "learning is extended to 48 windows (at most 48, analysis.baseline_windows_max)"
    )
    pipeline = site.pipeline(parse_memory(memory_text(pipeline.memory)))
    assert not texts(run(pipeline, warmed(site.windows(23), celsius[24:47])))
    (last,) = texts(run(pipeline, warmed(site.windows(1), celsius[47:])))
    assert last == (
        "baseline learned from 48 windows; too short: it covers 8 h of a daily cycle (the temperature moved by 6.0 K)"
    )


def test_change_during_extended_learning_is_not_learnt(monkeypatch: pytest.MonkeyPatch) -> None:
    site = played(monkeypatch)
    celsius = np.linspace(10.0, 16.0, 48)
    pipeline = site.pipeline()
    run(pipeline, warmed(site.windows(34), celsius[:34]))
    site.put(PUMP)
    (text,) = texts(run(pipeline, warmed(site.windows(14), celsius[34:])))
    print(text)
    assert "the structure changed within the baseline" in text
    assert "learning begins anew with the 14 windows since" in text


def test_configured_baseline_length_is_kept_and_its_shortcoming_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    without_answers(monkeypatch)
    site = Played(6, monkeypatch)
    (text,) = texts(run(site.pipeline(), warmed(site.windows(BASELINE), np.linspace(10.0, 13.0, BASELINE))))
    assert text == (
        "baseline learned from 12 windows; too short: it covers 2 h of a daily cycle (the temperature moved by 3.0 K)"
    )
