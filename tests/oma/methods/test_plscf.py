"""Poly-reference least squares complex frequency, tested with structures of known modes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

from daq import FloatArray, Recording
from oma import PLSCF, IdentificationError, ModalEstimate, identify, mac_matrix
from oma.mac import normalise
from oma.methods.fraction_poles import FractionModel, Windowed, continuous, fraction_model, pole_influences
from oma.methods.matrix_fraction import half_spectrum, matrix_fractions
from oma.methods.plscf import shape_moves
from oma.selection import normalised_move, uncertainty_law
from tests.support.oma.correlations import correlation_sums
from tests.support.oma.structures import chain, frame, simulate
from tests.support.thorough import few_of

SEEDS = range(6)
BAND = (0.058, 0.46)


@cache
def window(seed: int) -> Recording:
    return simulate(chain(), 300.0, 50.0, seed)


@cache
def estimate(seed: int) -> ModalEstimate:
    return identify(window(seed), PLSCF())


@pytest.mark.parametrize("seed", few_of(SEEDS, 3))
def test_all_chain_modes_are_identified_without_false_modes(seed: int) -> None:
    found, truth = estimate(seed), chain()
    assert found.n_modes == 6, found.frequency
    assert np.all(np.diag(mac_matrix(found.shape, truth.shapes)) > 0.99)
    assert np.all(np.abs(found.frequency - truth.frequency) < 5 * found.frequency_std)


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_all_frame_modes_with_a_close_pair_are_identified(seed: int) -> None:
    found = identify(simulate(frame(), 60.0, 1000.0, seed), PLSCF())
    assert found.n_modes == 8, found.frequency
    assert np.all(np.diag(mac_matrix(found.shape, frame().shapes)) > 0.9)


@pytest.mark.parametrize("seeds", few_of([SEEDS[:3], SEEDS]), ids=len)
def test_stated_deviations_cover_errors_near_the_uncertainty_law(seeds: range) -> None:
    """Chance 1e-4 each; measured on 40 windows: 1.05 times the law for frequencies, 1.2 for damping."""
    truth = chain()
    pairs = zip(truth.frequency, truth.damping, strict=True)
    limits = np.array([uncertainty_law(f, zeta, 300.0) for f, zeta in pairs]).T
    found = [estimate(seed) for seed in seeds]
    frequency = np.array([f.frequency - truth.frequency for f in found])
    damping = np.array([f.damping - truth.damping for f in found])
    largest = np.sqrt(stats.chi2.ppf(1 - 1e-4, frequency.size) / frequency.size)
    assert np.sqrt(np.mean((frequency / limits[0]) ** 2)) < 1.05 * largest
    assert np.sqrt(np.mean((damping / limits[1]) ** 2)) < 1.2 * largest
    for error, std in ((frequency, [f.frequency_std for f in found]), (damping, [f.damping_std for f in found])):
        # 93 % are covered at least
        assert np.sum(np.abs(error) < 2 * np.array(std)) >= stats.binom.ppf(1e-4, error.size, 0.93)


@pytest.mark.parametrize("seed", few_of(range(2)))
def test_no_modes_are_identified_in_noise(seed: int) -> None:
    quiet = np.random.default_rng(seed).standard_normal(window(0).data.shape)
    with pytest.raises(IdentificationError, match="no resonance"):
        identify(replace(window(0), data=quiet), PLSCF())


def test_modes_are_identified_from_two_channels_with_gaps() -> None:
    recording = simulate(chain(), 400.0, 50.0, 2)
    recording.data[5000:7000, 2] = np.nan
    few = replace(recording, channels=recording.channels[2::3], data=recording.data[:, 2::3])
    found = identify(few, PLSCF())
    near = np.abs(found.frequency[:, None] / chain().frequency - 1).min(axis=1)
    assert np.all(near < 0.005)
    assert found.n_modes >= 5


def free_decays(n_lags: int) -> tuple[FloatArray, FloatArray]:
    """Return correlations of three modes exactly, (n_lags, 4, 2), and their poles a sample."""
    rng = np.random.default_rng(4)
    pole = np.array([-0.004 + 0.6j, -0.01 + 1.1j, -0.006 + 2.2j])
    residue = (
        rng.standard_normal((3, 4, 1)) * rng.standard_normal((3, 1, 2)) * np.exp(1j * rng.uniform(0, 6, (3, 1, 1)))
    )
    return np.einsum("tm,mij->tij", np.exp(np.outer(np.arange(n_lags), pole)), residue).real, pole


def test_poles_of_free_decays_are_exact_after_window_correction() -> None:
    correlation, pole = free_decays(400)
    decay = -np.log(1e-6) / 400  # what is cut off at the end is a millionth
    spectrum = half_spectrum(correlation * np.exp(-decay * np.arange(400))[:, None, None], BAND)
    (fraction,) = matrix_fractions(spectrum, [3])
    found = continuous(fraction.root, decay, 1.0)
    for expected in pole:
        assert np.abs(found - expected).min() < 1e-4  # the ridge of the normal equations, where there is no noise


def test_poles_of_an_order_are_independent_of_other_requested_orders() -> None:
    """An order is the same whether others are requested with it or not."""
    correlation = correlation_sums(window(0).data, 80, 1).mean[1:]
    spectrum = half_spectrum(correlation, BAND)
    alone = matrix_fractions(spectrum, [5])[0]
    among = matrix_fractions(spectrum, [3, 4, 5, 8])[2]
    assert np.allclose(np.sort(np.abs(alone.root)), np.sort(np.abs(among.root)), rtol=1e-6)


def test_block_influences_are_derivatives_of_poles_and_shapes() -> None:
    sums = correlation_sums(window(1).data / window(1).data.std(axis=0), 81, 6)
    decay = -np.log(0.01) / 80
    tapered = np.exp(-decay * np.arange(80))[:, None, None]
    moves = np.stack([tapered * block[1:] for block in sums.influences()])
    seen = Windowed(values=tapered * sums.mean[1:], moves=moves, decay=decay, rate=50.0)
    spectrum = half_spectrum(seen.values, BAND)

    def moved(sign: int) -> FractionModel:
        values = seen.values + sign * 1e-3 * moves[2]
        again = replace(spectrum, values=half_spectrum(values, BAND).values)  # weights as they were
        return fraction_model(matrix_fractions(again, [5])[0], again, replace(seen, values=values))

    def near(model: FractionModel, pole: complex) -> int:
        return int(np.argmin(np.abs(model.continuous - pole)))

    model = fraction_model(matrix_fractions(spectrum, [5])[0], spectrum, seen)
    up, down = moved(1), moved(-1)
    poles, shapes = pole_influences(model, spectrum, seen)[2], shape_moves(model, spectrum, seen)[2]
    sure = [k for k, c in enumerate(model.taking_part) if (model.continuous[c] / abs(model.continuous[c])).real > -0.05]
    assert len(sure) >= 5  # the lowest mode lies on the edge of the lines
    for k in sure:
        column = model.taking_part[k]
        pole = model.continuous[column]
        change = (up.continuous[near(up, pole)] - down.continuous[near(down, pole)]) / 2e-3
        assert abs(poles[k] - change) < 0.01 * abs(change)
        both = [normalise(m.shape[near(m, pole)]) for m in (up, down)]
        slope = (both[0] - both[1]) / 2e-3
        stated = normalised_move(model.shape[column], shapes[None, k])[0]
        stated = stated * np.sign(np.real(normalise(model.shape[column]) @ both[0].conj()))
        # what the residuals of the shapes' equations add is of second order: the noise times the noise
        assert np.linalg.norm(stated.real - slope.real) < 0.2 * np.linalg.norm(slope.real)


@pytest.mark.thorough
def test_stated_shape_deviations_cover_the_errors() -> None:
    inside = []
    for seed in SEEDS:
        shape = estimate(seed).shape.real
        shape = shape * np.sign(np.sum(shape * chain().shapes, axis=1, keepdims=True))
        inside.append(np.abs(shape - chain().shapes) < 2 * estimate(seed).shape_std)
    # components of one shape share their errors: 36 modes count, of which 93 % are covered but for a chance of 1e-4
    assert np.mean(inside) >= 28 / 36


@pytest.mark.parametrize(
    "options",
    [{"n_lags": 5}, {"n_references": 0}, {"n_orders": 2}, {"n_blocks": 2}, {"decimation": 1}, {"window": 2.0}],
)
def test_invalid_options_are_refused(options: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="expected"):
        PLSCF(**options)  # type: ignore[arg-type]
