"""Re-analysis in the reference's modes against the full eigenproblem; derivatives against differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eig, eigh

from daq import FloatArray
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Reference, build_model, learn_reference, stack_tracks
from updater.inference import Comparison, Tangent, compare, mixing_of, no_effect, picked, predict, reanalyse

TRACK = np.arange(8)


def compared(seed: int) -> tuple[Reference, Comparison]:
    random = np.random.default_rng(seed)
    bare = true_model(np.random.default_rng((seed, 1)))
    reference = learn_reference(t_frame(), [measure(bare, random, np.ones(12)) for _ in range(8)], [TRACK] * 8)
    event = stack_tracks([measure(bare, random, np.ones(12)) for _ in range(3)], [TRACK] * 3)
    return reference, compare(reference, reference.mean_of(event))


def in_modes_of(data: Comparison, frequency: FloatArray) -> Comparison:
    """The same comparison in the modes of another model; only the data used by re-analysis."""
    fields = vars(data) | {"frequency": frequency, "paired": TRACK, "at_channels": np.zeros((12, len(frequency)))}
    return Comparison(**fields)


@pytest.mark.parametrize(("n", "tolerance"), [(None, 1e-8), (30, 2e-4)])
def test_reanalysis_is_exact_in_all_modes_and_accurate_in_thirty(n: int | None, tolerance: float) -> None:
    """0.3 kg at (0.25, 0, 1.48): frequencies of the full eigenproblem; ALGORITHMS-size truncation error in thirty."""
    model = build_model(t_frame(), mass="consistent")
    k, m = model.stiffness.toarray(), model.mass.toarray()
    value, shape = eigh(k, m)
    rows = model.read(np.array([0.25, 0, 1.48]))[:3]
    expected = np.sqrt(eigh(k, m + 0.3 * rows.T @ rows, eigvals_only=True)) / (2 * np.pi)
    frequency, at = np.sqrt(value[:n]) / (2 * np.pi), rows @ shape[:, :n]
    _, data = compared(1)
    data = in_modes_of(data, frequency)
    none = no_effect(1, data)
    changed = reanalyse(data, replace(none, mass=0.3 * (at.T @ at)[None]))
    found = picked(changed)[0][0] ** -0.5 / (2 * np.pi)
    np.testing.assert_allclose(np.sort(found), expected[:8], rtol=tolerance)


@pytest.mark.parametrize("seed", few_of([2, 3]))
def test_derivatives_match_finite_differences(seed: int) -> None:
    """Mass and flexibility changed at once; second order left out is 1e-6 of the change squared."""
    random = np.random.default_rng(seed)
    _, data = compared(seed)
    n = len(data.frequency)
    mass, flexibility = (0.02 * (lambda a: a @ a.T)(random.standard_normal((n, 3))) for _ in range(2))
    root = np.diag((2 * np.pi * data.frequency) ** -1.0)
    flexibility = root @ flexibility @ root
    none = no_effect(1, data)

    def at(step: float) -> tuple[FloatArray, FloatArray]:
        effect = replace(none, mass=((1 + step) * mass)[None], compliance=((1 + step) * flexibility)[None])
        return picked(reanalyse(data, effect))

    h = 1e-5
    plus, minus = at(h), at(-h)
    effect = replace(none, mass=mass[None], compliance=flexibility[None])
    changed = reanalyse(data, effect)
    d_value, d_vector = Tangent(changed, effect).by(mass[None], flexibility[None])
    np.testing.assert_allclose(d_value, (plus[0] - minus[0]) / (2 * h), rtol=1e-5)
    signed = [v * np.sign((v * picked(changed)[1]).sum(1, keepdims=True)) for v in (plus[1], minus[1])]
    difference = (signed[0] - signed[1]) / (2 * h)
    np.testing.assert_allclose(d_vector, difference, atol=1e-5 * np.abs(difference).max())


def test_error_of_an_unmeasured_frequency_in_modes_that_a_change_mixes() -> None:
    """Frequencies and shapes of the compared modes, against a model of which one such frequency is 1e-5 higher."""
    random = np.random.default_rng(8)
    _, data = compared(2)
    root = random.standard_normal((len(data.frequency), 3)) / (2 * np.pi * data.frequency)[:, None]
    effect = replace(no_effect(1, data), compliance=(0.1 * root @ root.T)[None])
    found, h = mixing_of(data, effect, data.paired, 1.0), 1e-5
    others = np.setdiff1d(np.arange(len(data.frequency)), data.paired)
    assert len(found.log_frequency) == len(others)
    for number in (0, len(others) // 2):
        ends = []
        for step in (-h, h):
            frequency = data.frequency.copy()
            frequency[others[number]] *= np.exp(step)
            value, vector = picked(reanalyse(replace(data, frequency=frequency), effect))
            ends.append((-0.5 * np.log(value[0]), vector[0]))
        (low, before), (high, after) = ends
        np.testing.assert_allclose(found.log_frequency[number, data.paired], (high - low) / (2 * h), atol=1e-6)
        now = found.shape[:, data.paired]
        turned = (after * np.sign((after * now).sum(0)) - before * np.sign((before * now).sum(0))) / (2 * h)
        np.testing.assert_allclose(found.turned[number][:, data.paired], turned, atol=1e-5 * np.abs(turned).max())
    assert np.abs(found.log_frequency).max() > 0.01


def test_negative_flexibility_is_treated_as_very_stiff() -> None:
    """A trial step may take off more of a mode's flexibility than it has; the others answer as they would."""
    _, data = compared(5)
    own = (2 * np.pi * data.frequency) ** -2.0
    none = no_effect(2, data)
    flexibility = np.zeros((2, len(own), len(own)))
    flexibility[0, 0, 0] = -1.5 * own[0]
    mass = np.tile(0.01 * np.eye(len(own)), (2, 1, 1))
    value, vector = picked(reanalyse(data, replace(none, mass=mass, compliance=flexibility)))
    assert np.isfinite(value).all()
    assert np.isfinite(vector).all()
    np.testing.assert_allclose(value[0, 1:], 1.01 * own[data.paired[1:]], rtol=1e-6)
    np.testing.assert_allclose(value[1], 1.01 * own[data.paired], rtol=1e-6)


@pytest.mark.parametrize("own_damping", few_of([0.01, 0.001]))
def test_modal_damping_follows_the_energy_share_of_an_oscillator(own_damping: float) -> None:
    """Against complex modes where each part loses as much of the energy that it holds, tuned 4 % above a mode."""
    reference, data = compared(6)
    damping, mass, tuned = 0.004, 0.05, 1.04 * float(data.frequency[data.paired[3]])
    along = reference.model.read(np.array([0.25, 0, 1.48]))[2] @ reference.shape
    omega_o, omega = 2 * np.pi * tuned, 2 * np.pi * data.frequency
    effect = replace(
        no_effect(1, data),
        mass=mass * np.outer(along, along)[None],
        coupling=np.sqrt(mass) * along[None, :, None],
        own=np.array([[omega_o**-2.0]]),
        own_log_damping=np.log([[own_damping / damping]]),
        carried=np.zeros((1, len(data.channels), 1)),
    )
    changed = reanalyse(data, effect)
    value, vector = picked(changed)
    found = damping * np.exp(predict(data, value, vector, effect).log_damping[0])
    n = len(omega)
    whole = np.block([[np.eye(n) + effect.mass[0], effect.coupling[0]], [effect.coupling[0].T, np.eye(1)]])
    lossy = np.append(omega**2 * (1 + 2j * damping), omega_o**2 * (1 + 2j * own_damping))
    square = eig(np.diag(lossy), whole)[0]
    nearest = square[np.argmin(np.abs(square.real * value[0, : len(found), None] - 1), axis=1)]
    np.testing.assert_allclose(found, nearest.imag / nearest.real / 2, rtol=0.02)
