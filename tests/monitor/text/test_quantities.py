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
