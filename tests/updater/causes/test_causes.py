"""One contract for all causes: the prediction in the reference's modes agrees with the extended structure."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from daq import FloatArray
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Circumstances,
    Reference,
    build_model,
    dump_structure,
    learn_reference,
    parse_structure,
    stack_tracks,
)
from updater.causes import CATALOGUE, Cause, SelectedCause, prediction
from updater.inference import Comparison, compare, fit
from updater.modal_data import Trend
from updater.reference import channel_rows

TRACK = np.arange(8)
OF_FILES = ("mesh_error", "model_parameters")  # asked where nothing was learned: they have tests of their own


@pytest.fixture(scope="module")
def compared() -> tuple[Reference, Comparison]:
    """A reference whose one-step update changed nothing: the model's own modes, so that the two must agree."""
    random = np.random.default_rng(1)
    bare = true_model(np.random.default_rng(2))
    learnt = learn_reference(t_frame(), [measure(bare, random, np.ones(12)) for _ in range(8)], [TRACK] * 8)
    modes = learnt.calibration.modes
    reference = Reference(**(vars(learnt) | {"frequency": modes.frequency, "shape": modes.shape}))
    event = stack_tracks([measure(bare, random, np.ones(12)) for _ in range(3)], [TRACK] * 3)
    everything = np.ones(len(TRACK))
    trend = Trend(
        slope=-0.01 * everything,
        slope_std=1e-4 * everything,
        usual=0 * everything,
        usual_std=1e-4 * everything,
        damping_slope=everything,
        damping_slope_std=everything,
        spread=0.1,
        excess=0.02,
    )
    seen = reference.mean_of(event)
    extra = replace(seen.only(TRACK[2:3]), log_frequency=np.log([25.0]))  # of the third mode's shape, far below it
    data = compare(reference, seen, circumstances=Circumstances(trend=trend, extra=extra))
    return reference, Comparison(
        **(vars(data) | {"base": data.model_base, "baseline_imaginary": np.zeros(data.base.shape)})
    )


def drawn(cause: Cause, random: np.random.Generator) -> SelectedCause:
    """Some alternative, half as strong as the prior expects: the axes of a spring that the data can show."""
    row = int(random.integers(len(cause.lower)))
    theta = np.maximum(0.5 * cause.prior_std * random.uniform(0.1, 0.3, len(cause.prior_std)), cause.lower[row])
    return SelectedCause(cause, row, theta)


def in_full(reference: Reference, chosen: SelectedCause, channels: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Frequencies and complex shapes of the extended structure, written to TOML and read back."""
    extended = chosen.cause.extend(reference.structure, chosen.row, chosen.theta)
    extended = parse_structure(dump_structure(extended))
    model = build_model(extended, shear_flexible=True, mass="consistent")
    modes = model.modes(12)
    late = np.array([extended.delays[c] for c in channels])
    turned = (channel_rows(model, channels) @ modes.shape).T * np.exp(-2j * np.pi * modes.frequency[:, None] * late)
    return modes.frequency, turned


@pytest.mark.parametrize("name", [name for name in CATALOGUE if name not in OF_FILES])
@pytest.mark.parametrize("seed", few_of(range(3)))
def test_prediction_matches_the_extended_structure(
    compared: tuple[Reference, Comparison], name: str, seed: int
) -> None:
    """Thirty modes miss a full solution by under 3e-4 of frequency and 2e-3 of a unit shape, for such changes."""
    reference, data = compared
    cause = CATALOGUE[name].propose(reference, data)
    assert cause is not None
    assert cause.name == name
    chosen = drawn(cause, np.random.default_rng(seed))
    predicted = prediction(data, [chosen])
    log_ratio, shape = predicted.log_ratio, predicted.shape
    frequency, late = in_full(reference, chosen, data.channels)
    # a mode's own phase is no one's: turned so that the imaginary part is least, as an estimate's is
    late = late * np.exp(-0.5j * np.angle((late**2).sum(1)))[:, None]
    expected, imaginary = late.real, late.imag
    found = np.append(data.frequency[data.paired] * np.exp(log_ratio[0]), predicted.new_frequency[0])
    both = np.concatenate([shape[0], predicted.new_shape[0]])
    unit = both / np.linalg.norm(both, axis=1, keepdims=True)
    size = np.maximum(np.linalg.norm(expected, axis=1, keepdims=True), 1e-12)
    expected, imaginary = expected / size, imaginary / size
    partner = [
        int(np.argmax(np.abs(expected @ u) - 5 * np.abs(np.log(frequency / f))))
        for u, f in zip(unit, found, strict=True)
    ]
    np.testing.assert_allclose(found, frequency[partner], rtol=3e-4)
    sign = np.sign((unit * expected[partner]).sum(1, keepdims=True))
    np.testing.assert_allclose(unit, sign * expected[partner], atol=2e-3)
    found = predicted.imaginary[0]
    np.testing.assert_allclose(found, (sign * imaginary[partner])[: len(found)], atol=2e-3)


@pytest.mark.parametrize("name", [name for name in CATALOGUE if name not in OF_FILES])
def test_alternatives_share_the_prior_and_fit_gives_location_and_parameters(
    compared: tuple[Reference, Comparison], name: str
) -> None:
    reference, data = compared
    cause = CATALOGUE[name].propose(reference, data)
    assert cause is not None
    some = name == "attached_oscillator"  # of its places only the likely ones are fitted
    assert np.exp(cause.log_prior).sum() < 1 if some else np.exp(cause.log_prior).sum() == pytest.approx(1)
    found: Any = fit(data, cause)
    assert found.probability.sum() == pytest.approx(1)
    where, parameters = found.hypotheses.where(found), found.hypotheses.parameters(found)
    assert (where is None) == cause.place_free
    for quantity in parameters.values():
        assert np.isfinite(quantity.value)
        assert quantity.std > 0
    for channel in where.channels if where else ():
        assert channel in data.channels
