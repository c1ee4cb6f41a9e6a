"""Upper end of the analysed band: 0.48 of the rate, unless the recording shows an anti-alias filter."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from oma import identify_all
from oma.preparation import PASS, TOP, usable_share
from tests.support.oma.structures import Structure, anti_aliased, frame_with_higher_modes, simulate
from tests.support.thorough import few_of

BUILDING = Structure(
    frequency=np.array([0.9, 2.6, 4.25]),
    damping=np.full(3, 0.01),
    shapes=np.array([[0.3, 0.6, 1.0], [0.8, 0.5, -0.7], [1.0, -0.9, 0.4]]),
    channels=("floor_1", "floor_2", "floor_3"),
)
RATE = 10.0  # Hz: the third mode lies at 0.425 of it


@pytest.mark.parametrize(("band", "modes"), [(None, [0, 1, 2]), ((4.05, 4.9), [2]), ((0.5, 4.0), [0, 1])])
def test_mode_above_0_4_of_sampling_rate_is_identified(band: tuple[float, float] | None, modes: list[int]) -> None:
    found = identify_all(simulate(BUILDING, 1200.0, RATE, 5, noise=0.2), band=band)
    assert found.band == pytest.approx((band[0], min(band[1], 4.8)) if band else (100 / 1200, 4.8))
    assert found.estimate.n_modes == len(modes)
    assert (abs(found.estimate.frequency - BUILDING.frequency[modes]) < 4 * found.estimate.frequency_std).all()


def test_band_above_usable_frequency_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected low < 4.8 Hz \(0.48 of the rate\), found 4.85 Hz"):
        identify_all(simulate(BUILDING, 60.0, RATE, 5), band=(4.85, 5.0))


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_anti_alias_filter_lowers_upper_end_of_band(seed: int) -> None:
    recording = anti_aliased(simulate(frame_with_higher_modes(), 20.0, 4000.0, seed), 4, 0.01, seed)
    assert usable_share(recording.data) == PASS
    assert identify_all(recording).band[1] == PASS * recording.rate


@pytest.mark.parametrize("seed", few_of(range(20)))
def test_usable_band_is_reduced_only_by_a_filter_slope(seed: int) -> None:
    # six segments, the fewest that are looked at: the floor of one channel scatters by some 2 dB, against 6 dB
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((6 * 256, 3))
    assert usable_share(white) == TOP
    assert usable_share(np.cumsum(np.cumsum(white, axis=0), axis=0)) == TOP  # 12 dB per octave
    steep = signal.sosfilt(signal.butter(8, 0.6, output="sos"), rng.standard_normal((4096, 3)), axis=0)
    assert usable_share(steep) == PASS
    gap = replace(simulate(BUILDING, 600.0, RATE, seed), data=np.full((6000, 3), np.nan))
    assert usable_share(gap.data) == TOP


def test_modes_near_nyquist_are_uncertain_unless_band_is_chosen() -> None:
    """A mode at 4.6 Hz of a 10 Hz record, where converters let aliases pass; a band that is chosen keeps it."""
    print("seed 14")
    high = replace(BUILDING, frequency=np.array([0.9, 2.6, 4.6]))
    recording = simulate(high, 1200.0, RATE, 14, noise=0.2)
    found = identify_all(recording)
    assert np.abs(found.estimate.frequency - 4.6).min() < 0.05
    assert np.abs(found.without_uncertain().estimate.frequency - 4.6).min() > 1
    chosen = identify_all(recording, band=(0.5, 4.79)).without_uncertain()
    assert np.abs(chosen.estimate.frequency - 4.6).min() < 0.05
