"""For an alarm that lasts years the history keeps the diagnoses with news, the first and the newest."""

import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from daq import Event
from monitor.outputs.history import HistoryStore, Reader, Span, Writer, schema
from monitor.outputs.history.retention import says_the_same, told_before
from monitor.results.comparison import DiagnosisAnswer
from monitor.results.windows import WindowResult, result_event
from tests.support.monitor import answers
from tests.support.monitor.history import HOUR, START, change, rows, run_events, sqlite_url, write_years

STEP = 600 * 10**9
FOUND = answers.diagnosis()
MASS, GAIN = FOUND.causes
TEXT = FOUND.model_dump_json()
NOTHING = FOUND.model_copy(update={"verdict": "unexplained", "causes": (), "gain": None})


def weighing(mass: float) -> DiagnosisAnswer:
    """Return the diagnosis with another mass [kg], stated ± 5 g."""
    value = MASS.parameters["mass"].model_copy(update={"value": mass})
    return FOUND.model_copy(update={"causes": (MASS.model_copy(update={"parameters": {"mass": value}}), GAIN)})


def window(number: int, diagnosis: DiagnosisAnswer) -> Event:
    end = START + number * STEP
    result = WindowResult(
        index=number, start=end - STEP, end=end, phase="alarm", channels=[], modes=[], diagnosis=diagnosis
    )
    return result_event(result)


def kept(url: str) -> list[int]:
    """Return the numbers of the windows whose diagnoses are stored."""
    return sorted((row["end"] - START) // STEP for row in rows(url, "diagnoses"))


@pytest.mark.thorough
def test_two_week_alarm_keeps_few_diagnoses(tmp_path: Path) -> None:
    """A mass of 302 ± 5 g, each time from the newest 100 windows; after ten days it is 330 g."""
    url, draw = sqlite_url(tmp_path), random.Random(1)
    single = [0.302 + 0.028 * (n >= 1540) + draw.gauss(0.0, 0.05) for n in range(2260)]
    masses = [sum(single[n : n + 100]) / 100 for n in range(len(single) - 100)]
    run_results = [change(START, "alarm"), *(window(n, weighing(mass)) for n, mass in enumerate(masses))]
    with HistoryStore(url) as store:
        for first in range(0, len(run_results), 48):
            store.write(run_results[first : first + 48])
            store.forget(1000)
        store.write(run_results[40:50])  # brought again: the same stays
        store.forget(1000)
    numbers = kept(url)
    assert (numbers[0], numbers[-1]) == (0, len(masses) - 1)
    assert 3 <= len(numbers) < 30
    assert any(1440 < number < 1540 for number in numbers)  # the change
    with Reader(url) as reader:
        assert reader.diagnosis(START) == weighing(masses[-1]).model_dump_json()


def test_each_alarm_keeps_its_first_and_newest_diagnosis(tmp_path: Path) -> None:
    """The first alarm has ended by itself; the second is accepted; the third is active."""
    url = sqlite_url(tmp_path)
    run_results: list[Event] = []
    for first, after in ((0, 5), (10, 15), (20, 25)):
        run_results += [change(START + first * STEP, "alarm"), *(window(n, FOUND) for n in range(first, after))]
        kind = "accepted" if first else "state"
        if first < 20:
            run_results.append(change(START + after * STEP, "normal", kind=kind, lasted=1.0))
    with HistoryStore(url) as store:
        store.write(run_results)
        store.forget(1000)
    assert kept(url) == [0, 4, 10, 14, 20, 24]


@pytest.mark.parametrize(
    ("now", "same"),
    [
        (FOUND, True),
        (weighing(0.311), True),
        (weighing(0.313), False),
        (FOUND.model_copy(update={"causes": (GAIN, MASS), "next_measurement": "", "rejected": ()}), True),
        (FOUND.model_copy(update={"verdict": "ambiguous"}), False),
        (FOUND.model_copy(update={"causes": (MASS,)}), False),
        (NOTHING, False),
        *(
            (FOUND.model_copy(update={"causes": (MASS.model_copy(update=changed), GAIN)}), same)
            for changed, same in (
                ({"cause": "distributed_mass"}, False),
                ({"cannot_be_told_from": ()}, False),
                ({"probability": 0.8}, True),
                ({"where": None}, False),
                ({"parameters": {}}, False),
                ({"where": MASS.where and MASS.where.model_copy(update={"member": "column"})}, False),
                ({"where": MASS.where and MASS.where.model_copy(update={"position": (0.257, 0.0, 1.48)})}, True),
                ({"where": MASS.where and MASS.where.model_copy(update={"position": (0.259, 0.0, 1.48)})}, False),
                ({"where": MASS.where and MASS.where.model_copy(update={"position": None})}, False),
            )
        ),
    ],
)
def test_equivalence_of_two_diagnoses(now: DiagnosisAnswer, same: bool) -> None:
    assert says_the_same(FOUND, now) is same
    assert says_the_same(now, FOUND) is same


def test_alternating_diagnoses_keep_few_rows_per_day() -> None:
    """Two verdicts in turn for three days: eight of each day, and the newest; of another version likewise."""
    for other in (NOTHING.model_dump_json(), '{"of": "a later version"}'):
        reported = [(START + n * STEP, (TEXT, other)[n % 2]) for n in range(3 * 144)]
        gone = set(told_before(reported, [START], []))
        stay = [end for end, _ in reported if end not in gone]
        assert [sum(end // schema.DAY == START // schema.DAY + day for end in stay) for day in range(3)] == [8, 8, 9]
        assert stay[-1] == reported[-1][0]


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # a busy machine is slow to draw
@given(
    masses=st.lists(st.sampled_from([0.302, 0.309, 0.316, 0.33]), min_size=1, max_size=60),
    raised=st.sets(st.integers(0, 60)),
    thinned=st.sets(st.integers(0, 60)),
)
def test_repeated_thinning_keeps_the_same_rows_as_a_single_one(
    masses: Sequence[float], raised: set[int], thinned: set[int]
) -> None:
    texts = {mass: weighing(mass).model_dump_json() for mass in set(masses)}
    reported = [(START + n * 20 * STEP, texts[mass]) for n, mass in enumerate(masses)]
    begun = [START + n * 20 * STEP for n in sorted(raised)]
    by_and_by: list[tuple[int, str]] = []
    for number, row in enumerate(reported):
        by_and_by.append(row)
        if number in thinned:
            gone = set(told_before(by_and_by, [t for t in begun if t <= row[0]], []))
            by_and_by = [row for row in by_and_by if row[0] not in gone]
    for rows_now in (by_and_by, reported):
        gone = set(told_before(rows_now, begun, []))
        rows_now[:] = [row for row in rows_now if row[0] not in gone]
    assert by_and_by == reported
    assert reported[0][1] == texts[masses[0]]


def test_old_windows_are_deleted_and_their_days_keep_their_figures(tmp_path: Path) -> None:
    """Of one site, a month at a time; a late window of such a day changes nothing."""
    url = sqlite_url(tmp_path)
    n = write_years(url, years=0.25, step=HOUR, n_modes=2)  # of site 1, which has no name yet
    whole = Span(start=START, end=START + n * HOUR)
    with HistoryStore(url, Writer(site="bridge")) as store, HistoryStore(url, Writer(site="tower")) as other:
        other.write([window_event(START + HOUR, 5.0)])
        with Reader(url, "bridge") as reader:
            days, trend = reader.days(whole), reader.trend(2, whole, "day")
        for _ in range(4):
            store.forget(10, keep_days=20)
        store.write([window_event(START + HOUR, 9.0)])
    with Reader(url, "bridge") as reader:
        assert (reader.days(whole), reader.trend(2, whole, "day")) == (days, trend)
        left = {window.end // schema.DAY for window in reader.windows(whole, n)} - {START // schema.DAY}
        assert left == {day.day for day in days[-20:]}
        assert {point.time // schema.DAY for point in reader.trend(2, whole, "window")} == left
        hours = {point.time // schema.DAY for point in reader.trend(2, whole, "hour")}
        assert hours == left - {START // schema.DAY}
        span = reader.span()
        assert span is not None
        assert span.days == whole.days
    with Reader(url, "tower") as reader:
        assert [window.t2 for window in reader.windows(whole)] == [5.0]


def window_event(end: int, t2: float) -> Event:
    """Return an evaluated window without modes."""
    event = next(e for e in run_events() if e.payload.get("novelty"))
    return replace(
        event,
        time=end,
        payload=event.payload
        | {"end": end, "modes": [], "diagnosis": None}
        | {"novelty": event.payload["novelty"] | {"t2": t2}},
    )
