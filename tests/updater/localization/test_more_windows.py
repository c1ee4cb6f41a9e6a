"""Evidence accumulates over windows: as their square root, until the baseline or the model decides."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.text.causes import forecast_text
from oma import ModalEstimate
from tests.support.updater.frames import Truth, t_frame, t_truth, unmoved
from updater import Body, ModalMean, Reference, learn_reference, locate_mass, stack_tracks
from updater.fe import Modes
from updater.localization import sharpening

BODY = Body(at=(0.2, 0, 1.48), mass=0.1)
NOISE = 3.0  # 0.3 % at 10 Hz and 0.9 % of a shape in each window


class Rig:
    """A truth bare and loaded, with a long baseline."""

    def __init__(self) -> None:
        self.truth: Truth = t_truth(11)
        bare, loaded = self.truth.model(), self.truth.model(BODY)
        self.rows, self.loaded = bare.sensor_rows, loaded.modes(8)
        self.reference: Reference = learn_reference(t_frame(), self.windows(bare.modes(8), 64, 1), unmoved(64))

    def windows(self, modes: Modes, n: int, seed: int) -> list[ModalEstimate]:
        return self.truth.windows(modes, self.rows, n, seed, NOISE)

    def event(self, n: int, seed: int = 2) -> ModalMean:
        return self.reference.mean_of(stack_tracks(self.windows(self.loaded, n, seed), unmoved(n)))


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig()


def test_deviation_falls_with_square_root_of_windows_then_levels_off(rig: Rig) -> None:
    """Variances add, so d ln std / d ln n = -(1 - least^2 / std^2) / 2; the priors of offset, inertia and drift bend it
    as the noise falls: 0.1 of an exponent of 0.5.
    """
    found = sharpening(rig.reference, rig.event(2))
    log_std, log_n = np.log(found.distance_std), np.log(found.n)
    exponent = np.diff(log_std) / np.diff(log_n)
    noisy = 1 - (found.least_distance_std / found.distance_std) ** 2
    np.testing.assert_allclose(exponent, -0.25 * (noisy[1:] + noisy[:-1]), atol=0.1)
    assert exponent[0] < -0.35
    assert exponent[-1] > -0.25


def test_forecast_reports_the_useful_number_of_windows(rig: Rig) -> None:
    found = sharpening(rig.reference, rig.event(2))
    twice = found.distance_std**2 > 2 * found.least_distance_std**2
    np.testing.assert_array_equal(twice, found.n < found.enough)
    assert (found.windows, found.limited_by) == (2, "windows")
    assert f"up to about {found.enough}" in forecast_text(found, 2e-3)
    later = sharpening(rig.reference, rig.event(4 * found.enough))
    assert later.limited_by != "windows"
    assert "more windows will not reduce the deviation" in forecast_text(later, 2e-3)


def test_short_baseline_limits_the_accuracy_before_the_model(rig: Rig) -> None:
    """Ten times the deviation is a hundredth of the windows."""
    baseline = rig.reference.baseline
    noisy = replace(baseline, log_frequency_std=10 * baseline.log_frequency_std, shape_std=10 * baseline.shape_std)
    found = sharpening(replace(rig.reference, baseline=noisy), rig.event(16))
    assert found.limited_by == "baseline"
    assert "a longer baseline would" in forecast_text(found, 2e-3)


def test_forecast_accuracy_matches_the_result_of_more_windows(rig: Rig) -> None:
    """To 30 %: the grid's posterior is no Gaussian, and its deviation is of one realisation."""
    found = sharpening(rig.reference, rig.event(2))
    change = locate_mass(rig.reference, rig.event(32, seed=3))
    at = int(np.flatnonzero(found.n == 32)[0])
    assert change.distance_std == pytest.approx(found.distance_std[at], rel=0.3)
    assert change.mass_std == pytest.approx(found.mass_std[at], rel=0.3)
    assert abs(change.distance - 0.6) < 4 * change.distance_std
