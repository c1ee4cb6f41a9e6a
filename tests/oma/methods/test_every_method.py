"""Contract of every identification method."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from daq import Recording
from oma import METHODS, IdentificationError, identify, identify_all
from tests.support.oma.structures import chain, simulate


@cache
def window() -> Recording:
    return simulate(chain(4), 240.0, 40.0, 11)


@pytest.mark.parametrize("name", METHODS)
def test_chain_modes_are_identified_with_gap_and_constant_channel(name: str) -> None:
    recording = replace(window(), data=window().data.copy())
    recording.data[1000:1200, 1] = np.nan
    recording.data[:, 2] = 0.5
    method = METHODS[name]()
    assert method.name == name
    found = identify(recording, method)
    assert found.channels == ("mass_1", "mass_2", "mass_4")
    truth = chain(4).frequency
    assert found.n_modes == 4
    # five standard deviations as stated; the simulation's chance is that of one seed
    assert np.all(np.abs(found.frequency - truth) < 5 * found.frequency_std)
    assert np.all(np.abs(found.damping - 0.01) < 5 * found.damping_std)


@pytest.mark.parametrize("name", METHODS)
def test_results_are_independent_of_data_unit(name: str) -> None:
    """A power of two is exact in floating point."""
    first = identify_all(window(), METHODS[name]())
    again = identify_all(replace(window(), data=window().data / 1024), METHODS[name]())
    # solutions are iterated or ridged relative to the data's size: rounding only
    assert np.allclose(first.estimate.frequency, again.estimate.frequency, rtol=1e-9)
    assert np.allclose(first.estimate.frequency_std, again.estimate.frequency_std, rtol=1e-5)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("n", [2, 40, 400])
def test_too_short_recording_is_refused(name: str, n: int) -> None:
    with pytest.raises(IdentificationError):
        identify(replace(window(), data=window().data[:n]), METHODS[name]())


@pytest.mark.parametrize("name", ["fsdd", "plscf"])
def test_tone_is_not_reported_as_mode(name: str) -> None:
    recording = simulate(chain(), 300.0, 50.0, 5)
    tone = np.sin(2 * np.pi * 7.3 * np.arange(len(recording.data)) / 50.0)
    recording.data[:] += np.outer(tone, np.linspace(1, 2, 6)) * recording.data.std()
    found = identify_all(recording, METHODS[name]())
    assert found.estimate.n_modes == 6
    assert found.harmonics == pytest.approx([7.3], abs=0.01)
