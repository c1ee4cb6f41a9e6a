import pytest

from daq.notebook import number_text, rounded_text
from monitor.text.quantities import aligned_numbers


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
