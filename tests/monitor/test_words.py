"""Findings in words."""

import answers_helpers as answers
import pytest
import viewer_helpers as made

from monitor.viewer.cards import window_card
from monitor.words import number_text


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (10.7642, 0.0113, "10.764 ± 0.011"),
        (10.7642, 0.0313, "10.76 ± 0.03"),
        (173.4, 6.2, "173 ± 6"),
        (173.4, 12.4, "173 ± 12"),
        (254164.0, 10162.0, "254000 ± 10000"),
        (254164.0, 9162.0, "254000 ± 9000"),
        (0.5, 0.0, "0.5"),
        (0.5, float("nan"), "0.5"),
    ],
)
def test_a_value_is_rounded_by_its_standard_deviation(value: float, std: float, text: str) -> None:
    assert number_text(value, std) == text


@pytest.mark.parametrize("explained", [False, True])
def test_a_card_does_not_promise_a_place_once_the_change_is_explained(explained: bool) -> None:
    run = made.whole_run(made.Site())
    found = answers.diagnosis() if explained else None
    window = run["windows"][-1].model_copy(update={"answer": None, "diagnosis": found})
    card = window_card(window, made.story(run))
    assert ("Where, the next windows will tell" in card) == (not explained)
