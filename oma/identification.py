"""The front of identification: a recording in, modes out, nothing to choose."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, Recording
from oma.alignment import aligned, device_delays
from oma.conditioning import PASS, Level, detrended, pyramid, usable
from oma.correlation import correlation_sums
from oma.errors import TooFewModes, TooShort
from oma.estimate import ComplexArray, ModalEstimate
from oma.mac import mac_matrix, normalise
from oma.selection import groups, uncertainty_law
from oma.ssi import CovarianceSSI, Realisation, realisations, subspace
from oma.stabilization import Stabilization, join, stabilization
from oma.uncertainty import Perturbation, PoleInfluence, block_std, perturbation, pole_influence


@dataclass(frozen=True, eq=False, kw_only=True)
class Mode:
    """One group of stable poles, summed up."""

    frequency: float  #: [Hz]
    frequency_std: float  #: [Hz]
    damping: float  #: [-]
    damping_std: float  #: [-]
    shape: ComplexArray  #: (n_channels,)
    shape_std: FloatArray  #: (n_channels,)
    support: float  #: [-]
    law_ratio: float  #: [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class Identification:
    """Modes, and the poles they were chosen from."""

    estimate: ModalEstimate  #: with the devices' `delays` removed
    poles: Stabilization
    harmonics: FloatArray  #: (n_harmonics,) frequencies of tones: machines, mains; no modes [Hz]
    delays: Mapping[str, float]  #: device -> how late it was, 0 if that does not matter (`device_delays`) [s]


def identify(
    recording: Recording, method: CovarianceSSI | None = None, band: tuple[float, float] | None = None
) -> ModalEstimate:
    """Identify the modes of a structure from its ambient vibration.

    Parameters
    ----------
    recording : Recording
    method : CovarianceSSI, optional
        Options of the method.
    band : (float, float), optional
        Frequencies in which modes are sought [Hz]; unless given, from 100 periods in the recording to 0.40 of the rate.

    Returns
    -------
    ModalEstimate
        Of the channels that carry a signal (`channel_faults` names the others), without their devices' delays
        (`device_delays`). Where gaps leave too little for the lowest frequencies, these are passed over.

    Raises
    ------
    TooFewChannels, TooShort, TooFewModes
        If the recording does not allow an estimate; all are `IdentificationError`.
    ValueError
        If the band is empty or beyond the recording's rate.

    References
    ----------
    Peeters, B., De Roeck, G. (1999). Reference-based stochastic subspace identification for output-only modal
    analysis. MSSP 13(6), 855-878.
    """
    return identify_all(recording, method, band).estimate


def identify_all(
    recording: Recording, method: CovarianceSSI | None = None, band: tuple[float, float] | None = None
) -> Identification:
    """Identify modes and keep the stabilization diagram; arguments and errors as for `identify`."""
    method = method or CovarianceSSI()
    band = _band(recording, method, band)
    delays = device_delays(recording)
    if any(delays.values()):
        recording = aligned(recording, delays)
    names, data = usable(recording)
    modes: list[Mode] = []
    poles = []
    for level in pyramid(detrended(data), recording.rate, band, method.decimation):
        if _long_enough(level, method):
            diagram, found = _identify_level(level, method)
            poles.append(diagram)
            modes.extend(found)
    if not poles:
        raise TooShort(recording.duration, 4 * method.lags(len(names), 1) / recording.rate)
    kept = _merged(_physical(modes, method), method)
    tones = [mode for mode in kept if mode.damping < method.selection.min_damping]
    kept = [mode for mode in kept if mode.damping >= method.selection.min_damping]
    diagram = join(poles)
    if not kept:
        raise TooFewModes(len(diagram))
    harmonics = np.array([tone.frequency for tone in tones])
    return Identification(estimate=_estimate(recording, names, kept), poles=diagram, harmonics=harmonics, delays=delays)


def _band(recording: Recording, method: CovarianceSSI, band: tuple[float, float] | None) -> tuple[float, float]:
    """Return the band to search, checked."""
    if recording.duration == 0:
        raise TooShort(0, method.min_cycles * method.decimation / PASS / recording.rate)
    if band is None:
        band = (method.min_cycles / recording.duration, PASS * recording.rate)
        if band[0] >= band[1] / method.decimation:
            raise TooShort(recording.duration, method.min_cycles * method.decimation / band[1])
    if not 0 < band[0] < band[1] <= 0.5 * recording.rate:
        raise ValueError(f"band: expected 0 < low < high <= {0.5 * recording.rate} Hz, found {band}")
    return band


def _long_enough(level: Level, method: CovarianceSSI) -> bool:
    """Tell whether gaps leave enough at this rate to be worth a look."""
    complete = np.count_nonzero(np.isfinite(level.data).all(axis=1))
    return int(complete) >= 4 * method.lags(level.data.shape[1], level.noise_lags + 1)


def _identify_level(level: Level, method: CovarianceSSI) -> tuple[Stabilization, list[Mode]]:
    """Identify the modes in the band of one rate."""
    first_lag = level.noise_lags + 1
    n_channels = level.data.shape[1]
    sums = correlation_sums(level.data, method.lags(n_channels, first_lag), method.n_blocks)
    duration = float(sums.counts[:, 0].sum()) / level.rate
    space = subspace(sums, level.rate, first_lag, method)
    models = realisations(space, method.orders)
    diagram = stabilization(models, level.band, method.selection)
    stable = diagram[diagram.stable]
    moved = perturbation(space, sums, first_lag, method.rows(n_channels))
    by_order = {model.order: model for model in models}
    modes = [
        _mode(stable[members], by_order, moved, duration)
        for members in groups(stable.frequency, stable.shape, method.selection.cut)
        if len(members) > 2
    ]
    return diagram, modes


def _mode(members: Stabilization, models: dict[int, Realisation], moved: Perturbation, duration: float) -> Mode:
    """Sum up a group: mean over the orders, and the scatter of the blocks' influences on this mean.

    The scatter of few blocks is itself uncertain; no standard deviation is claimed that lies under the law's.
    """
    members = _one_an_order(members)
    influences = [pole_influence(moved, models[o], c) for o, c in zip(members.order, members.column, strict=True)]
    weight = _weights(influences)
    turned = weight * np.sign(np.real(members.shape @ members.shape[-1].conj()))
    frequency, damping = float(weight @ members.frequency), float(weight @ members.damping)
    frequency_std = float(block_std(weight @ np.stack([i.frequency for i in influences])))
    damping_std = float(block_std(weight @ np.stack([i.damping for i in influences])))
    shape_move = np.tensordot(turned, np.stack([i.shape for i in influences]), axes=1)
    floor = uncertainty_law(frequency, damping, duration)
    return Mode(
        frequency=frequency,
        frequency_std=max(frequency_std, floor[0]),
        damping=damping,
        damping_std=max(damping_std, floor[1]),
        shape=normalise(turned @ members.shape),
        shape_std=block_std(shape_move.real),
        support=len(members) / len(models),
        law_ratio=frequency_std / floor[0],
    )


def _one_an_order(members: Stabilization) -> Stabilization:
    """Keep the pole nearest to the group's median where an order has several."""
    away = np.abs(members.frequency - np.median(members.frequency))
    best = {members.order[i]: i for i in np.argsort(-away, kind="stable")}
    return members[np.array([best[o] for o in sorted(best)])]


def _weights(influences: list[PoleInfluence]) -> FloatArray:
    """Weigh the orders by the variance of their poles."""
    variance = np.array([np.sum(i.frequency**2) for i in influences])
    result: FloatArray = 1 / variance / np.sum(1 / variance)
    return result


def _physical(modes: list[Mode], method: CovarianceSSI) -> list[Mode]:
    """Keep groups whose scatter is compatible with a resonance, the more so the fewer orders show them."""
    return [mode for mode in modes if mode.law_ratio < method.selection.max_law_ratio * mode.support]


def _merged(modes: list[Mode], method: CovarianceSSI) -> list[Mode]:
    """Keep the surer one of two modes that are the same one seen at two rates."""
    kept: list[Mode] = []
    for mode in sorted(modes, key=lambda m: m.frequency_std):
        twin = any(
            abs(other.frequency - mode.frequency) < method.selection.max_shift * mode.frequency
            and 1 - mac_matrix(other.shape[None], mode.shape[None])[0, 0] < method.selection.max_mac_loss
            for other in kept
        )
        if not twin:
            kept.append(mode)
    return sorted(kept, key=lambda m: m.frequency)


def _estimate(recording: Recording, names: tuple[str, ...], modes: list[Mode]) -> ModalEstimate:
    """Put modes into arrays."""
    return ModalEstimate(
        channels=names,
        frequency=np.array([m.frequency for m in modes]),
        frequency_std=np.array([m.frequency_std for m in modes]),
        damping=np.array([m.damping for m in modes]),
        damping_std=np.array([m.damping_std for m in modes]),
        shape=np.stack([m.shape for m in modes]),
        shape_std=np.stack([m.shape_std for m in modes]),
        support=np.array([m.support for m in modes]),
        law_ratio=np.array([m.law_ratio for m in modes]),
        start=recording.start,
        end=recording.end,
    )
