"""Dependence of modes on their amplitude: linear and nonlinear buildings, integrated over time."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.special
import scipy.stats

from daq import Recording
from oma import AmplitudeDependence, dependence_on_amplitude, identify
from tests.support.oma.nonlinear_building import (
    DAMPING,
    Building,
    Element,
    Modulation,
    blows,
    free_decay,
    gusts,
    steady,
    vibrations,
)
from tests.support.thorough import few_of

SEED = 4100
LEVEL = 1e-3
SLIP = Element("slip", 0.3, 0.7)


def found(recordings: list[Recording]) -> list[tuple[float, AmplitudeDependence]]:
    """Return frequency and dependence of all modes of all recordings."""
    of_all: list[tuple[float, AmplitudeDependence]] = []
    for recording in recordings:
        estimate = identify(recording)
        tested = zip(estimate.frequency.tolist(), dependence_on_amplitude(recording, estimate), strict=True)
        of_all.extend((frequency, one) for frequency, one in tested if one)
    return of_all


def pooled(recordings: list[Recording], low: float, high: float) -> AmplitudeDependence:
    """Return the dependence of the mode in a band, over all recordings."""
    return AmplitudeDependence.pooled([one for frequency, one in found(recordings) if low < frequency < high])


@pytest.mark.parametrize(("modulation", "n"), few_of([(gusts, 3), (gusts, 25), (steady, 25)]))
def test_p_values_of_a_linear_building_are_uniform(modulation: Modulation, n: int) -> None:
    """Small p values are as frequent as they state, and no more frequent than a binomial at 0.1 % allows."""
    print(f"seeds from {SEED}")
    recordings = vibrations(Element("linear", 0), 900, range(SEED, SEED + n), modulation=modulation)
    modes = [one for _, one in found(recordings)]
    assert len(modes) > 2 * n
    for p_values in ([one.frequency.p_value for one in modes], [one.damping.p_value for one in modes]):
        for level in (0.05, 0.001):
            assert np.count_nonzero(np.array(p_values) < level) <= scipy.stats.binom.ppf(0.999, len(modes), level)


@pytest.mark.parametrize(
    ("element", "sign", "n"),
    few_of([(SLIP, -1, 4), (SLIP, -1, 8), (Element("contact", 0.2), 1, 8), (Element("stiffening", 0.03), 1, 8)]),
    ids=["slip", "slip for longer", "contact", "stiffening"],
)
def test_frequency_rises_or_falls_as_the_element_makes_it(element: Element, sign: int, n: int) -> None:
    """It is found in both low modes in one or two hours, without a change of damping against its sign."""
    recordings = vibrations(element, 900, range(SEED, SEED + n), noise=0.02)
    for band in ((1.5, 2.5), (5.0, 7.0)):
        mode = pooled(recordings, *band)
        assert mode.frequency.p_value < LEVEL
        assert np.sign(mode.frequency.value) == sign
        assert mode.damping.p_value > LEVEL or mode.damping.value * sign < 0  # what slips has the larger damping


def test_damping_rises_with_drag() -> None:
    """It is found in the second mode in three hours; the frequency does not change."""
    second = pooled(vibrations(Element("drag", 0.0003), 900, range(SEED, SEED + 12)), 5, 7)
    assert second.damping.p_value < LEVEL
    assert second.damping.value > 0
    assert second.frequency.p_value > LEVEL


@pytest.mark.parametrize("n", few_of([4, 12]))
def test_slope_agrees_with_a_free_decay(n: int) -> None:
    """One mode that stiffens with a cube of the drift: f = f0 + c a^2, from a free decay and from random forces."""
    element = Element("stiffening", 0.02)
    amplitude, frequency, _ = free_decay(element, 0, 2.0, 30)
    curvature = np.polyfit(amplitude**2, frequency, 1)[0]
    building = Building(element)
    shares = building.shape[0] ** 2 / building.frequency**3 / DAMPING  # of the variance of the drift
    power = 2 * shares[0] / shares.sum()  # mean square of the drift's amplitude, which is 2 in the linear building
    # slope of a^2 over a, for a Rayleigh distribution weighted by a^2: the nodes are those of a^2 over its mean
    nodes, weights = scipy.special.roots_genlaguerre(40, 1)
    centred = np.sqrt(nodes) - weights @ np.sqrt(nodes)
    expected = curvature * power * (weights @ (centred * nodes)) / (weights @ centred**2)
    mode = pooled(vibrations(element, 900, range(SEED, SEED + n), only=0), 1.5, 2.5)
    of_first_order = 0.1 * expected  # the method's
    error = np.hypot(mode.frequency.std * frequency.mean(), of_first_order)
    assert mode.frequency.value * frequency.mean() == pytest.approx(expected, abs=3 * error)


def test_not_tested() -> None:
    """Blows, a short record, gaps everywhere, a channel less, and zeros give no result."""
    (blown,) = vibrations(Element("linear", 0), 400, range(SEED, SEED + 1), modulation=blows)
    estimate = identify(blown)
    assert dependence_on_amplitude(blown, estimate) == (None,) * estimate.n_modes
    (recording,) = vibrations(Element("linear", 0), 400, range(SEED, SEED + 1))
    estimate = identify(recording)
    assert any(dependence_on_amplitude(recording, estimate))
    short = replace(recording, data=recording.data[:3000])
    assert dependence_on_amplitude(short, estimate) == (None,) * estimate.n_modes
    holed = recording.data.copy()
    holed[::100, 0] = np.nan
    assert dependence_on_amplitude(replace(recording, data=holed), estimate) == (None,) * estimate.n_modes
    fewer = replace(recording, channels=recording.channels[1:], data=recording.data[:, 1:])
    still = replace(recording, data=np.zeros_like(recording.data))
    for other in (fewer, still):
        assert dependence_on_amplitude(other, estimate) == (None,) * estimate.n_modes


def test_slip_of_an_element_begins_anew_with_each_building() -> None:
    """An element may be given to other numbers of buildings, one after the other."""
    element = Element("slip", 0.3, 0.3)
    first, second = (vibrations(element, 20, range(SEED, SEED + 1))[0].data for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert len(vibrations(element, 1, range(SEED, SEED + 2))) == 2
