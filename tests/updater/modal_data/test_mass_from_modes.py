"""Mass from mass-normalised modes: of a chain with known masses, and how sure."""

import numpy as np
import pytest
from scipy.linalg import eigh

from updater import ModalDataError
from updater.modal_data import mass_of_modes

MASS = np.diag([5.0, 4.0, 3.0])
STIFFNESS = np.array([[9.0, -4.0, 0.0], [-4.0, 7.0, -3.0], [0.0, -3.0, 3.0]])


def modes() -> np.ndarray:
    return np.asarray(eigh(STIFFNESS, MASS)[1].T)


def test_all_modes_of_a_chain_give_its_masses() -> None:
    found = mass_of_modes(modes(), np.zeros((3, 3, 3)))
    np.testing.assert_allclose(found.value, MASS, atol=1e-12)
    assert not found.std.any()


def test_stated_deviations_match_the_scatter_of_repeated_measurements() -> None:
    random = np.random.default_rng(11)
    root = 0.01 * np.abs(modes()).max() * random.standard_normal((3, 3, 3))  # errors of a mode's components together
    covariance = root @ root.transpose(0, 2, 1)
    drawn = np.array(
        [
            mass_of_modes(modes() + np.einsum("mcd,md->mc", root, random.standard_normal((3, 3))), covariance).value
            for _ in range(2000)
        ]
    )
    stated = mass_of_modes(modes(), covariance).std
    # 2000 draws tell a deviation to 1.6 %, and first order is right to a few per cent at errors of some per cent
    np.testing.assert_allclose(drawn.std(axis=0), stated, rtol=0.1)


def test_identical_modes_are_refused() -> None:
    doubled = modes()[[0, 0, 1]]
    with pytest.raises(ModalDataError, match="same shape"):
        mass_of_modes(doubled, np.zeros((3, 3, 3)))


def test_too_few_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="as many as channels"):
        mass_of_modes(modes()[:2], np.zeros((2, 3, 3)))
