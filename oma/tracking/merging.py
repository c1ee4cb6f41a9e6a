"""Set-ups measured one after the other, sensors moved between them, put together through those that stayed.

Each set-up is identified separately. Its shapes have their own scale, because the forces are not measured. The
references, which all set-ups have, determine the scales: for each mode, set-up s measured ``phi_s = c_s r + noise``
there.

References
----------
Döhler, M., Andersen, P., Mevel, L. (2010). Data merging for multi-setup operational modal analysis with data-driven
SSI. Proceedings of IMAC XXVIII: merging after identification (PoSER) among its peers.
Au, S.-K. (2011). Assembling mode shapes by least squares. MSSP 25(1), 163-179.
DerSimonian, R., Laird, N. (1986). Meta-analysis in clinical trials. Controlled Clinical Trials 7(3), 177-188: means of
estimates that differ by more than each states.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from daq import FloatArray, IndexArray
from oma.errors import InputError, NoCommonModes
from oma.mac import mac_matrix, normalise
from oma.tracking.pairing import assign
from oma.types import ComplexArray, ModalEstimate

_SIGMAS = 3.0  # standard deviations a frequency may differ between set-ups
_DRIFT = 0.01  # relative difference of frequencies always allowed for: set-ups are hours or days apart
_MAC_LOSS = 0.2  # loss of MAC at the references beyond that of noise
_SWEEPS = 50
_CLOSE = 1e-12  # of the scales, relative: two sweeps agree


def merge(estimates: Sequence[ModalEstimate], references: Sequence[str]) -> ModalEstimate:
    """Combine the modes of several set-ups.

    Frequencies and damping are means weighted by variances, to which the scatter between set-ups is added if it is
    larger than stated. Shapes are scaled to each other by least squares at the references, weighted by their variances;
    the uncertainty of the scales is included in the standard deviations.

    Parameters
    ----------
    estimates : sequence of ModalEstimate
        One per set-up; other channels than the references have names of their own in each. All of one kind
        (accelerations): see `daq.differentiated` for velocities.
    references : sequence of str
        Channels that every set-up has, at the same place, where the modes to be merged move.

    Returns
    -------
    ModalEstimate
        Of the modes that all set-ups show (`match_setups`), at the references and then at the moved channels in the
        order of the set-ups.

    Raises
    ------
    InputError
        If a set-up lacks a reference or two of them share another channel.
    NoCommonModes
        If no mode is identified in all set-ups.
    """
    _check(estimates, references)
    matched = match_setups(estimates, references)
    if not len(matched):
        raise NoCommonModes(len(estimates), [e.n_modes for e in estimates])
    moved = [[i for i, c in enumerate(e.channels) if c not in references] for e in estimates]
    names = (*references, *(e.channels[i] for e, places in zip(estimates, moved, strict=True) for i in places))
    shapes = [_merged_shape(estimates, modes, references, moved) for modes in matched]
    frequency, frequency_std = _means(*_picked(estimates, matched, "frequency"))
    damping, damping_std = _means(*_picked(estimates, matched, "damping"))
    order = np.argsort(frequency)
    return ModalEstimate(
        channels=names,
        frequency=frequency[order],
        frequency_std=frequency_std[order],
        damping=damping[order],
        damping_std=damping_std[order],
        shape=np.stack([shapes[i][0] for i in order]),
        shape_std=np.stack([shapes[i][1] for i in order]),
        support=_mean(estimates, matched[order], "support"),
        law_ratio=_mean(estimates, matched[order], "law_ratio"),
        start=min(e.start for e in estimates),
        end=max(e.end for e in estimates),
    )


def match_setups(estimates: Sequence[ModalEstimate], references: Sequence[str]) -> IndexArray:
    """Return which modes of the set-ups are the same.

    One to one with the set-up that has most modes, by frequency (three standard deviations, at least 1 % for changes in
    between) and by the MAC at the references as far as noise permits.

    Parameters
    ----------
    estimates, references : as for `merge`

    Returns
    -------
    (n_modes, n_setups) array of int
        Modes that all set-ups show, as indices into each estimate.
    """
    seed = max(estimates, key=lambda e: e.n_modes)
    columns = np.column_stack([_matched(seed, estimate, references) for estimate in estimates])
    return columns[(columns >= 0).all(axis=1)]


def _check(estimates: Sequence[ModalEstimate], references: Sequence[str]) -> None:
    """Refuse channels that do not fit."""
    if len(estimates) < 2 or not references:
        raise InputError(f"merge: expected two set-ups and a reference, found {len(estimates)} and {len(references)}")
    for k, estimate in enumerate(estimates):
        lacking = [name for name in references if name not in estimate.channels]
        if lacking:
            raise InputError(f"set-up {k + 1}: expected the references {', '.join(references)}, lacks {lacking[0]}")
    count = Counter(name for e in estimates for name in e.channels if name not in references)
    twice = [name for name, n in count.items() if n > 1]
    if twice:
        raise InputError(f"channel {twice[0]}: expected in one set-up, or among the references; found in more")


def _matched(seed: ModalEstimate, estimate: ModalEstimate, references: Sequence[str]) -> IndexArray:
    """Return the mode of a set-up that is each one of the seed (n_seed_modes,), or -1."""
    ours, our_noise = _at_references(seed, references)
    theirs, their_noise = _at_references(estimate, references)
    shift = np.abs(np.log(estimate.frequency / seed.frequency[:, None]))
    ours_std, theirs_std = (e.frequency_std / e.frequency for e in (seed, estimate))
    reach = np.maximum(_SIGMAS * np.hypot(ours_std[:, None], theirs_std), _DRIFT)
    loss = (1 - mac_matrix(ours, theirs)) / (_MAC_LOSS + _SIGMAS**2 * (our_noise[:, None] + their_noise))
    return assign((shift / reach) ** 2 + loss, (shift < reach) & (loss < 1))


def _at_references(estimate: ModalEstimate, references: Sequence[str]) -> tuple[ComplexArray, FloatArray]:
    """Return shapes at the references, and the 1 - MAC that their noise costs (n_modes,)."""
    place = [estimate.channels.index(name) for name in references]
    shape = estimate.shape[:, place]
    power = np.maximum(np.sum(np.abs(shape) ** 2, axis=1), 1e-30)
    return shape, np.sum(estimate.shape_std[:, place] ** 2, axis=1) / power


def _picked(estimates: Sequence[ModalEstimate], matched: IndexArray, name: str) -> tuple[FloatArray, FloatArray]:
    """Return a field and its standard deviation (n_modes, n_setups)."""
    value, std = (
        np.column_stack([getattr(e, field)[k] for e, k in zip(estimates, matched.T, strict=True)])
        for field in (name, f"{name}_std")
    )
    return value, std


def _mean(estimates: Sequence[ModalEstimate], matched: IndexArray, name: str) -> FloatArray:
    """Return the mean of a field over the set-ups (n_modes,)."""
    values = [getattr(e, name)[k] for e, k in zip(estimates, matched.T, strict=True)]
    return np.asarray(np.mean(values, axis=0))


def _means(value: FloatArray, std: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return weighted means over the set-ups and their standard deviations (n_modes,).

    The scatter of set-ups beyond their own variances, tau^2, is added to these (DerSimonian and Laird, eq. 9): a
    structure that changed between them has no single frequency, and the mean is correspondingly uncertain.
    """
    weight = std**-2
    total = weight.sum(axis=1)
    mean = np.sum(weight * value, axis=1) / total
    excess = np.sum(weight * (value - mean[:, None]) ** 2, axis=1) - (value.shape[1] - 1)
    between = np.maximum(0, excess / (total - np.sum(weight**2, axis=1) / total))
    weight = 1 / (std**2 + between[:, None])
    total = weight.sum(axis=1)
    return np.sum(weight * value, axis=1) / total, 1 / np.sqrt(total)


def _merged_shape(
    estimates: Sequence[ModalEstimate], modes: IndexArray, references: Sequence[str], moved: Sequence[Sequence[int]]
) -> tuple[ComplexArray, FloatArray]:
    """Return one merged shape of unit norm, and its standard deviation (n_channels,) each."""
    place = [[e.channels.index(name) for name in references] for e in estimates]
    seen = np.stack([e.shape[k, p] for e, k, p in zip(estimates, modes, place, strict=True)])
    std = np.stack([e.shape_std[k, p] for e, k, p in zip(estimates, modes, place, strict=True)])
    std = np.maximum(std, 1e-9)  # of a unit shape: a weight for a channel without noise
    common, scale = _scales(seen, std)
    pieces = [e.shape[k, m] / c for e, k, m, c in zip(estimates, modes, moved, scale, strict=True)]
    own = [e.shape_std[k, m] / abs(c) for e, k, m, c in zip(estimates, modes, moved, scale, strict=True)]
    setup = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
    merged = np.concatenate([common, *pieces])
    norm, shape = float(np.linalg.norm(merged)), normalise(merged)
    covariance = _covariance(norm * shape.real, setup, np.abs(scale), std)
    covariance[np.diag_indices(len(merged))] += np.concatenate([np.zeros(len(common)), *(o**2 for o in own)])
    beside = np.eye(len(merged)) - np.outer(shape.real, shape.real)  # unit norm: no error along the shape itself
    variance = np.einsum("ij,jk,ik->i", beside, covariance, beside)
    return shape, np.sqrt(np.maximum(variance, 0)) / norm


def _scales(seen: ComplexArray, std: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Split shapes at the references into one common shape and a scale for each set-up: seen = outer(scale, common).

    Least squares in both by turns, each a weighted mean given the other; begun from the set-up with the clearest
    references.

    Parameters
    ----------
    seen, std : (n_setups, n_references) arrays

    Returns
    -------
    common : (n_references,) array
        Of unit norm.
    scale : (n_setups,) array
    """
    weight = std**-2.0
    common = seen[np.argmax(np.sum(np.abs(seen) ** 2 * weight, axis=1))]
    common = common / np.linalg.norm(common)
    scale = np.zeros(len(seen), np.complex128)
    for _ in range(_SWEEPS):
        before = scale
        scale = (weight * seen) @ common.conj() / (weight @ np.abs(common) ** 2)
        common = (scale.conj() @ (weight * seen)) / (np.abs(scale) ** 2 @ weight)
        common = common / np.linalg.norm(common)
        if np.abs(scale - before).max() <= _CLOSE * np.abs(scale).max():
            break
    return common, scale


def _covariance(merged: FloatArray, setup: IndexArray, scale: FloatArray, std: FloatArray) -> FloatArray:
    """Return the covariance of a merged shape that comes from the references (n_channels, n_channels).

    To first order, of real parts: shapes are real but for small parts. Scales and common shape share one freedom,
    which the pseudoinverse leaves out and unit norm fixes afterwards.

    Parameters
    ----------
    merged : (n_channels,) array
        Real part of the shape, n_references of which come first, at unit norm there.
    setup : (n_channels - n_references,) array of int
        Where each moved channel was.
    scale : (n_setups,) array
        Absolute values.
    std : (n_setups, n_references) array
    """
    n_setups, n = std.shape
    of_setup = np.arange(n_setups)
    slope = np.zeros((n_setups, n, n + n_setups))  # of scale * common by the common shape and by ln(scale)
    slope[:, np.arange(n), np.arange(n)] = scale[:, None]
    slope[of_setup, :, n + of_setup] = scale[:, None] * merged[:n]
    whitened = (slope / std[:, :, None]).reshape(-1, n + n_setups)
    parameters = np.linalg.pinv(whitened.T @ whitened, rcond=1e-10, hermitian=True)
    spread = np.zeros((len(merged), n + n_setups))
    spread[np.arange(n), np.arange(n)] = 1
    spread[n + np.arange(len(setup)), n + setup] = -merged[n:]
    return np.asarray(spread @ parameters @ spread.T)
