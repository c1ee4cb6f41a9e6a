import numpy as np
import pytest

from daq.notebook import number_text, rounded_text
from monitor.text.quantities import aligned_numbers, last_value, scatter, two_digits


def test_numbers_with_deviations_have_their_points_in_one_column() -> None:
    assert aligned_numbers([(10.6187, 0.0221), (180.93, 0.2396), (1430.4, 51.0), (7.0, 0.0)]) == [
        "  10.619 ±  0.022",
        " 180.93  ±  0.24 ",
        "1430     ± 50    ",
        "   7    ",
    ]
    assert aligned_numbers([(240.2, 4.1), (38.0, 12.0)]) == ["240 ±  4", " 38 ± 12"]
    assert aligned_numbers([]) == []


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [(-0.12345, 0.012, "-0.123"), (2.0345, 0.4, "+2.0"), (-0.0001, 0.01, "+0.000"), (12.3456, 0.0, "+12.35")],
)
def test_value_alone_has_the_digits_of_its_deviation(value: float, std: float, text: str) -> None:
    assert rounded_text(value, std, sign=True) == text
    assert number_text(value, std, sign=True).split(" ± ")[0] == text


@pytest.mark.parametrize(("value", "text"), [(0.0123, "0.012"), (3.0, "3"), (152.0, "150"), (9876.0, "9900")])
def test_two_digits_have_no_exponent(value: float, text: str) -> None:
    assert two_digits(value) == text


def test_last_value_of_a_course_has_the_digits_of_its_deviation() -> None:
    assert last_value([10.123456, 10.234567], 0.02) == "10.235"
    assert last_value([1.0, -3.0214, None], 0.15, sign=True) == "-3.02"
    assert last_value([None]) == last_value([]) == "-"
    assert last_value([10.123456]) == "10.12"


def test_scatter_of_a_course_is_that_of_single_values_and_ignores_one_jump() -> None:
    values = np.random.default_rng(3).normal(5.0, 0.2, 4000)
    values[2000:] += 50.0
    assert abs(scatter(list(values)) - 0.2) < 0.2 * 0.05  # the median of 4000 dependent steps: about 2 % of std
