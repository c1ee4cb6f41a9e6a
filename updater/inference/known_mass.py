"""Comparison of records with a known mass with the record before it.

A known mass m lowers the frequency of mode i by a share of m |u_i|^2 / 2, with the mode's mass-normalised displacement
u_i there. It thus scales the modes, and distinguishes causes with the same frequencies and shapes: a softer structure
from a heavier one, and places that the sensors cannot distinguish.

References
----------
Parloo, E., Verboven, P., Guillaume, P., Van Overmeire, M. (2002). Sensitivity-based operational mode shape
normalisation. Mechanical Systems and Signal Processing 16(5), 757-767.
"""

import numpy as np

from daq import FloatArray, IndexArray
from updater.inference.comparison import LEAST_VARIANCE, MassTest, frequencies_with_mass
from updater.modal_data import KnownMass, ModalMean
from updater.reference import Reference

DRIFT = 2e-4  #: of log frequencies, common to all: 1 K between two records that follow each other, 0.018 %/K of steel


def mass_tests(
    reference: Reference, tracks: IndexArray, event: ModalMean, error: FloatArray, tests: tuple[KnownMass, ...]
) -> tuple[MassTest, ...]:
    """Return the data of records with a known mass.

    Parameters
    ----------
    tracks : (n,) of the reference that are compared
    event : (n,) modes without the mass
    error : (n,) of the reference at any point, relative to a mode's typical displacement
    tests : with the modes (n_tracks,) in the order of the reference's

    Raises
    ------
    ModelError
        If a mass is on no member.
    """
    found = []
    for test in tests:
        modes = test.modes.only(tracks)
        rows = np.flatnonzero(np.isfinite(modes.log_frequency))
        ratio = modes.log_frequency[rows] - event.log_frequency[rows]
        by_model = (2 * error[rows]) ** 2 * np.abs(ratio) * np.abs(ratio).mean() if len(rows) else np.empty(0)
        noise = event.log_frequency_std[rows] ** 2
        measured = np.maximum(modes.log_frequency_std[rows] ** 2, LEAST_VARIANCE) + noise
        translation = np.sqrt(test.mass) * (reference.model.read(np.array(test.position)) @ reference.shape)[:3]
        # all modes of the reference move with the mass; of a hypothesis, the compared ones are known
        value, vector = (2 * np.pi * reference.frequency) ** -2.0, np.eye(len(reference.frequency))
        paired = reference.paired[tracks]
        whole = frequencies_with_mass(value[None], (translation @ vector)[None])[0, paired]
        part = frequencies_with_mass(value[None, paired], translation[None][:, :, paired])[0]
        found.append(
            MassTest(
                mass=test.mass,
                position=test.position,
                rows=rows,
                log_ratio=ratio,
                covariance=np.diag(measured + by_model) + DRIFT**2,
                noise=noise,
                translation=translation,
                correction=(whole - part)[rows],
                is_evidence=test.is_evidence,
            )
        )
    return tuple(found)
