"""A replay compared with the live results: identical, within rounding, or different, with the position."""

import math

from monitor.results.replay_comparison import ROUNDING, ReplayComparison, compare_results
from monitor.results.windows import AlarmResult, Result, WindowResult
from tests.support.monitor import results as made

SITE = made.Site()
RUN = made.whole_run(SITE, n_learning=3, n_before=1, n_after=3)
LIVE = [r for r in RUN["windows"] if isinstance(r, WindowResult)]


def with_frequency(factor: float, window: int = 4) -> ReplayComparison:
    """Return the comparison of a run in which one frequency differs by a factor."""
    found: list[Result] = [*LIVE]
    result = LIVE[window]
    modes = list(result.modes)
    modes[2] = modes[2].model_copy(update={"frequency": factor * modes[2].frequency})
    found[window] = result.model_copy(update={"modes": modes})
    return compare_results(found, LIVE)


def test_same_results_are_identical() -> None:
    found = compare_results(LIVE, LIVE)
    assert found.kind == "identical"
    assert found.text == "the same as live, to the last digit"
    assert found.payload() == {"kind": "identical", "relative_difference": 0.0, "at": None}


def test_rounding_difference_is_reported_with_its_position() -> None:
    """Relative to the largest frequency of the window: a little less than the change of the third."""
    found = with_frequency(1 + 1e-9)
    assert found.kind == "rounding"
    assert found.largest is not None
    assert 1e-10 < found.largest.relative < 1e-9
    assert found.largest.value == "modes.2.frequency"
    assert found.text.startswith("the same as live, within rounding: largest relative difference ")
    assert found.text.endswith(f"modes.2.frequency of window {LIVE[4].index}")


def test_first_difference_is_reported() -> None:
    found = with_frequency(1 + 100 * ROUNDING)
    assert found.kind == "different"
    assert found.text.startswith(f"NOT the same as live from window {LIVE[4].index} on: modes.2.frequency is ")
    assert found.payload()["at"] == {"result": f"window {LIVE[4].index}", "value": "modes.2.frequency"}


def test_sentences_are_not_compared() -> None:
    """Their numbers are stored separately."""
    alarm = AlarmResult(time=1, state="alarm", text="novelty 50.31", window=3)
    assert compare_results([alarm.model_copy(update={"text": "novelty 50.32"})], [alarm]).kind == "identical"
    assert compare_results([alarm.model_copy(update={"state": "watch"})], [alarm]).kind == "different"


def test_integer_differences_and_missing_results_are_not_rounding() -> None:
    last = LIVE[-1]
    moved = last.model_copy(update={"start": last.start + 1})
    assert compare_results([*LIVE[:-1], moved], LIVE).kind == "different"
    short = compare_results(LIVE[:-1], LIVE)
    assert short.kind == "different"
    assert short.payload()["relative_difference"] is None
    assert short.first is not None
    assert math.isinf(short.first.relative)


def test_lists_of_different_length_differ() -> None:
    last = LIVE[-1]
    found = compare_results([*LIVE[:-1], last.model_copy(update={"modes": last.modes[:-1]})], LIVE)
    assert found.first is not None
    assert found.first.value == "modes.length"


def test_values_in_place_of_one_are_named_so() -> None:
    """An answer where the live run had none, and none where it had one."""
    last = LIVE[-1]
    assert last.answer
    without = last.model_copy(update={"answer": None})
    more = compare_results(LIVE, [*LIVE[:-1], without])
    assert more.text.endswith("answer is several values, live None")
    fewer = compare_results([*LIVE[:-1], without], LIVE)
    assert "answer.member is absent, live " in fewer.text
