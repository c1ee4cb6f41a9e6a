"""The place of the one-step update in words: claimed with its region, or the reason why none is."""

import pytest

from monitor.results.windows import IncrementPlace, Interval
from monitor.text.causes import increment_text
from tests.support.monitor import answers
from tests.support.monitor import results as made

FOUND = answers.increments(made.Site())
N = len({f.node for f in FOUND.flagged})


def text(**changes: object) -> str:
    assert FOUND.place is not None
    return increment_text(FOUND.model_copy(update={"place": FOUND.place.model_copy(update=changes)}))


def test_located_mass_is_stated_with_its_region() -> None:
    assert (
        text()
        == f"one-step update flags {N} nodes, consistent with one mass at (0.25, 0.00, 1.48) m, 95 % within 0.03 m"
    )


@pytest.mark.parametrize(("p", "words"), [(2.3e-3, "p = 0.0023"), (0.0, "p < 1e-12")])
def test_increments_not_fitting_one_mass_are_not_located(p: float, words: str) -> None:
    reported = text(fits=False, located=False, p_value=p)
    assert reported == (f"one-step update flags {N} nodes, not located: the increments do not fit one mass ({words})")


def test_wide_region_is_reported_as_not_located() -> None:
    region = [
        Interval(member="crossbeam", start=(-0.4, 0, 1.48), end=(-0.2, 0, 1.48)),
        Interval(member="column", start=(0, 0, 1.2), end=(0, 0, 1.35)),
    ]
    assert text(located=False, region=region).endswith(
        "not located by these alone: one mass fits anywhere within 0.35 m of crossbeam, column"
    )


def test_text_without_flagged_nodes_or_without_position() -> None:
    assert increment_text(FOUND.model_copy(update={"flagged": [], "place": None})) == "one-step update flags no node"
    assert increment_text(FOUND.model_copy(update={"place": None})) == f"one-step update flags {N} nodes"


def test_position_is_unchanged_by_json_round_trip() -> None:
    assert FOUND.place is not None
    assert IncrementPlace.model_validate_json(FOUND.place.model_dump_json()) == FOUND.place
