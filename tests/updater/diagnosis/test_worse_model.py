"""A written model that contradicts the measured modes is no explanation."""

from dataclasses import replace

import pytest

from updater.diagnosis.gain import Gained
from updater.diagnosis.schema import Gain, Pair

GAIN = Gain(
    heldout=False,
    frequency_error_percent=Pair(before=0.42, after=4.7),
    one_minus_mac=Pair(before=0.05, after=0.27),
    log_likelihood=Pair(before=10.0, after=-800.0),
    change_error_percent=Pair(before=1.8, after=0.7),
    n_modes=10,
    n_measured=11,
)
STD = GAIN.model_copy(update={"frequency_error_percent": Pair(before=0.017, after=0.1)})


@pytest.mark.parametrize(
    ("error", "likelihood", "worse"),
    [
        pytest.param((0.42, 4.7), (10.0, -800.0), True, id="a mast whose bending modes mix"),
        pytest.param((0.42, 0.8), (10.0, -80.0), False, id="less than double"),
        pytest.param((0.42, 4.7), (10.0, 20.0), False, id="shapes agree better by more"),
        pytest.param((0.05, 0.3), (10.0, -1.0), False, id="within the noise"),
        pytest.param((None, 0.3), (10.0, -1.0), False, id="not compared"),
    ],
)
def test_doubled_error_contradicts(
    error: tuple[float | None, float], likelihood: tuple[float, float], *, worse: bool
) -> None:
    changed = {
        "frequency_error_percent": Pair(before=error[0], after=error[1]),
        "log_likelihood": Pair(before=likelihood[0], after=likelihood[1]),
    }
    gained = Gained(gain=GAIN.model_copy(update=changed), std=STD, significant=True)
    assert gained.is_worse == worse
    assert not replace(
        gained, gain=GAIN.model_copy(update={"frequency_error_percent": Pair(before=4.7, after=0.4)})
    ).is_worse
