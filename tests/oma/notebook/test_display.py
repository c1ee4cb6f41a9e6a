"""Short descriptions and tables of recordings and estimates in a notebook."""

from dataclasses import replace

import numpy as np
import pytest

from daq import Channel, Recording
from daq.notebook import html_table, number_text
from oma import identify_all
from tests.support.oma.structures import chain, simulate

START = 1767225600_000000000  # 2026-01-01


@pytest.fixture(scope="module")
def recording() -> Recording:
    return replace(simulate(chain(3, first=2.0, damping=0.01), 200.0, 40.0, seed=5), start=START)


def test_recording_is_described_by_channels_and_length(recording: Recording) -> None:
    data = np.array([[1.0, 3.0], [-1.0, np.nan], [np.nan, 5.0], [np.nan, 4.0]])
    channels = (Channel(name="a<b", device="d", axis=0), Channel(name="c", device="d", axis=1))
    small = Recording(channels=channels, data=data, rate=2.0, start=START)
    assert repr(small) == "Recording(2 channels, 2 s at 2 Hz)"
    shown = small._repr_html_()
    assert "<td>a&lt;b</td><td>d</td><td>1</td><td>50</td>" in shown
    assert "<td>c</td><td>d</td><td>0.816</td><td>25</td>" in shown
    assert "2 s at 2 Hz from 2026-01-01 00:00:00 UTC" in shown
    assert replace(small, data=np.empty((0, 2)))._repr_html_().count("<tr>") == 3
    assert len(repr(recording)) < 80


def test_estimate_is_described_by_frequencies_with_deviations(recording: Recording) -> None:
    found = identify_all(recording)
    estimate = found.estimate
    assert (
        repr(estimate)
        == f"ModalEstimate(3 modes at {', '.join(f'{f:.4g}' for f in estimate.frequency)} Hz, 3 channels)"
    )
    assert repr(found).startswith(f"Identification({estimate!r}, ")
    shown = estimate._repr_html_()
    for k in range(3):
        frequency = number_text(estimate.frequency[k], estimate.frequency_std[k])
        damping = number_text(100 * estimate.damping[k], 100 * estimate.damping_std[k])
        assert f"<td>{k + 1}</td><td>{frequency}</td><td>{damping}</td>" in shown
    assert found._repr_html_() == shown
    many = estimate[np.zeros(9, int)]
    assert ", ..." in repr(many)
    assert "..." not in repr(many[np.arange(8)])


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (10.69409, 0.0381, "10.69 ± 0.04"),
        (10.69409, 0.0181, "10.694 ± 0.018"),
        (1234.5, 31.0, "1230 ± 30"),
        (3.14159, 0.0, "3.142"),
        (3.14159, np.nan, "3.142"),
    ],
)
def test_digits_follow_the_deviation(value: float, std: float, text: str) -> None:
    assert number_text(value, std) == text


def test_texts_of_a_table_are_escaped() -> None:
    assert "<script>" not in html_table("<script>", ("<script>",), [("<script>",)])
