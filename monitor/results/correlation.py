"""Comparison of measured and simulated modes, with and without the diagnosed causes."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
import scipy  # its parts at their first use

from daq import FloatArray, Recording
from monitor.results.comparison import (
    BalanceResult,
    ChannelHealth,
    DiscrepancyResult,
    FrequencyTrend,
    ModeComparison,
    PlaceDensity,
    SensorComparison,
    SignalComparison,
)
from updater import (
    DiagnosisResult,
    ModalDataError,
    ModalMean,
    Reference,
    Structure,
    correlate_modes,
    force_balance,
    virtual_sensing,
)
from updater.diagnosis import Density, densities
from updater.reference import matched_surely
from updater.validation import (
    ForceBalance,
    ModalCorrelation,
    VirtualSensing,
    as_written,
    modes_before,
    modes_with_causes,
)

_WORST = 3  # sensors whose signals are drawn
_PERIODS = 16  # of a sensor's signal that are drawn
_POINTS = 10  # a period of the highest frequency
_FAULTY = "Residual forces are not drawn: they are caused by the sensors, not by the structure."
_FREQUENCIES_ONLY = "No mode shapes were measured: no MAC, sensors or residual forces."
BoolArray = npt.NDArray[np.bool_]
_ALL = 1e9  # Hz
_UNKNOWN: Mapping[str, ChannelHealth] = MappingProxyType({})


def discrepancy_result(
    reference: Reference,
    measured: ModalMean,
    explained: DiagnosisResult,
    recording: Recording | None = None,
    trends: tuple[FrequencyTrend, ...] = (),
    health: Mapping[str, ChannelHealth] = _UNKNOWN,
    *,
    shaped: bool = True,
) -> DiscrepancyResult:
    """Return the comparison of measured and simulated values.

    Parameters
    ----------
    reference : that was diagnosed
    measured : (n_modes,) all measured modes, in any order
    explained : diagnosis, whose extended structure gives the simulation with the causes
    recording : signals to predict from each other, without the devices' delays; None to leave that out
    trends : of the windows
    health : of each channel
    shaped : whether the shapes were measured. Frequencies alone are paired by the model's own shapes, from which no
        MAC, sensor residual or residual force follows

    Raises
    ------
    ModalDataError
        If fewer than three modes or two channels can be compared.
    """
    extended = explained.extended
    expected = modes_before(reference, float(np.exp(np.nanmax(measured.log_frequency))))
    before = _correlation(expected, measured, shaped=shaped)
    after = (
        _correlation(modes_with_causes(reference, extended, expected), measured, shaped=shaped) if extended else None
    )
    written = _correlation(as_written(extended, expected), measured, shaped=shaped) if extended else None
    sensing, note = _sensing(reference, measured, extended, recording) if recording else (None, "")
    causes = explained.diagnosis.causes  # of sensors only: residual forces are then theirs, not the structure's
    faulty = bool(causes) and all(c.where is not None and c.where.channels and not c.where.position for c in causes)
    matched = matched_surely(reference, measured)
    return DiscrepancyResult(
        modes=_modes(before, written, _compared(reference, expected, matched, before)),
        rows=_plain(before.simulated),
        columns=_plain(before.measured),
        mac=tuple(_numbers(row) for row in before.mac) if shaped else (),
        sensors=_sensors(before, after, sensing, health) if shaped else (),
        balance=None if faulty or not shaped else _balance(force_balance(reference, matched)),
        signals=_signals(*sensing) if sensing else (),
        trends=trends,
        places=_places(densities(reference.structure, explained.parts)),
        gain_std=explained.gained.std if explained.gained and explained.gained.significant else None,
        measured_before=reference.measured,
        note=" ".join(filter(None, [note, _FAULTY if faulty else "", "" if shaped else _FREQUENCIES_ONLY])),
    )


def _correlation(simulated: ModalMean, measured: ModalMean, *, shaped: bool) -> ModalCorrelation:
    """Return modes paired; without MAC where the shapes are not measured but the model's own."""
    paired = correlate_modes(simulated, measured)
    return paired if shaped else replace(paired, mac=np.full_like(paired.mac, np.nan))


def _places(found: tuple[Density, ...]) -> tuple[PlaceDensity, ...]:
    return tuple(
        PlaceDensity(
            cause=one.cause,
            member=one.member,
            position=tuple((float(x), float(y), float(z)) for x, y, z in one.position),
            density=_plain(one.density),
        )
        for one in found
    )


Sensing = tuple[VirtualSensing, VirtualSensing | None]


def _sensing(
    reference: Reference, measured: ModalMean, extended: Structure | None, recording: Recording
) -> tuple[Sensing | None, str]:
    """Return signals predicted without and with the causes, or why they cannot be."""
    expected = modes_before(reference, _ALL)
    try:
        if extended is None:
            return (virtual_sensing(recording, expected, measured), None), ""
        after = modes_with_causes(reference, extended, expected)
        return (
            virtual_sensing(recording, expected, measured, [after]),
            virtual_sensing(recording, after, measured, [expected]),
        ), ""
    except ModalDataError as error:
        return None, f"sensors are not predicted from each other: {error}"


def _plain(values: FloatArray) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _numbers(values: FloatArray) -> tuple[float | None, ...]:
    return tuple(_number(v) for v in values)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _compared(reference: Reference, expected: ModalMean, matched: ModalMean, before: ModalCorrelation) -> BoolArray:
    """Return which of the expected modes (n_simulated,) are used in the search for causes.

    Those of the baseline with a certain match; those that were not measured are not uncertain.
    """
    base = reference.baseline.log_frequency
    known, sure = (np.isin(expected.log_frequency, f) for f in (base, base[np.isfinite(matched.log_frequency)]))
    return np.where(before.partner >= 0, sure, known)


def _modes(before: ModalCorrelation, after: ModalCorrelation | None, compared: BoolArray) -> tuple[ModeComparison, ...]:
    pairs = [_mode(before, after, i, compared=bool(compared[i])) for i in range(len(before.simulated))]
    extra = before.extra if after is None else np.array([k for k in before.extra if k in after.extra], np.intp)
    explained = [] if after is None else [_fresh(after, before, int(k)) for k in before.extra if k not in after.extra]
    lone = [
        ModeComparison(simulated=None, measured=float(before.measured[k]), off_percent=None, std_percent=None, mac=None)
        for k in extra
    ]
    return (*pairs, *explained, *lone)


def _mode(before: ModalCorrelation, after: ModalCorrelation | None, row: int, *, compared: bool) -> ModeComparison:
    """Return a simulated mode with its partner, and how the partner fits the extended model."""
    column = int(before.partner[row])
    if column < 0:
        return ModeComparison(
            simulated=float(before.simulated[row]),
            measured=None,
            off_percent=None,
            std_percent=None,
            mac=None,
            compared=compared,
        )
    off, mac = _fit(after, column) if after else (None, None)
    return ModeComparison(
        simulated=float(before.simulated[row]),
        measured=float(before.measured[column]),
        off_percent=100 * float(np.expm1(before.off[row])),
        std_percent=100 * float(before.off_std[row] * np.exp(before.off[row])),
        mac=_number(before.mac[row, column]),
        off_percent_after=off,
        mac_after=mac,
        compared=compared,
    )


def _fresh(after: ModalCorrelation, before: ModalCorrelation, column: int) -> ModeComparison:
    """Return a measured mode that only the extended model has."""
    off, mac = _fit(after, column)
    frequency = float(before.measured[column])
    return ModeComparison(
        simulated=None, measured=frequency, off_percent=None, std_percent=None, mac=None,
        off_percent_after=off, mac_after=mac,
    )  # fmt: skip


def _fit(after: ModalCorrelation, column: int) -> tuple[float | None, float | None]:
    row = np.flatnonzero(after.partner == column)
    if not len(row):
        return None, None
    return 100 * float(np.expm1(after.off[row[0]])), _number(after.mac[row[0], column])


def _sensors(
    before: ModalCorrelation,
    after: ModalCorrelation | None,
    sensing: Sensing | None,
    health: Mapping[str, ChannelHealth],
) -> tuple[SensorComparison, ...]:
    missed: Mapping[str, dict[str, float]] = _missed(sensing) if sensing else {}
    return tuple(
        SensorComparison(
            channel=channel,
            comac=float(before.comac[i]),
            residual=float(before.residual[i]),
            noise=float(before.residual_std[i]),
            comac_after=float(after.comac[i]) if after else None,
            residual_after=float(after.residual[i]) if after else None,
            health=health.get(channel),
            **missed.get(channel, {}),
        )
        for i, channel in enumerate(before.channels)
    )


def _missed(sensing: Sensing) -> dict[str, dict[str, float]]:
    before, after = sensing
    found = {
        channel: {"missed": float(before.error[i]), "missed_least": float(before.expected[i])}
        for i, channel in enumerate(before.channels)
    }
    if after:
        for channel, error in zip(after.channels, after.error, strict=True):
            found[channel]["missed_after"] = float(error)
    return found


def _balance(found: ForceBalance) -> BalanceResult:
    return BalanceResult(
        loss=_numbers(found.loss),
        loss_std=_numbers(found.loss_std),
        added=_numbers(found.added),
        added_std=_numbers(found.added_std),
        log_odds=found.log_odds,
    )


def _signals(before: VirtualSensing, after: VirtualSensing | None) -> tuple[SignalComparison, ...]:
    """Return the sensors with the largest prediction errors beyond the unavoidable ones."""
    excess = np.sqrt(np.maximum(before.error**2 - before.expected**2, 0))
    return tuple(_signal(before, after or before, int(c)) for c in np.argsort(-excess, kind="stable")[:_WORST])


def _signal(before: VirtualSensing, after: VirtualSensing, channel: int) -> SignalComparison:
    """Return a few periods in the middle, drawn finely (they are limited to the band), and the spectra."""
    power = before.spectrum[:, channel]
    typical = float(np.sqrt(np.nansum(before.frequency**2 * power) / np.nansum(power)))  # of zero crossings (Rice 1945)
    n = min(max(16, round(_PERIODS / typical * before.rate)), len(before.measured))
    first = (len(before.measured) - n) // 2
    over = max(1, round(_POINTS * float(np.nanmax(before.frequency)) / before.rate))
    whole = slice(max(0, first - n), min(len(before.measured), first + 2 * n))  # beyond its ends a part is not periodic
    drawn = slice((first - whole.start) * over, (first - whole.start + n) * over)

    def fine(values: FloatArray) -> tuple[float, ...]:
        part = values[whole, channel]
        return _plain(np.asarray(scipy.signal.resample(part, over * len(part)))[drawn])

    return SignalComparison(
        channel=before.channels[channel],
        start=first / before.rate,
        step=1 / (before.rate * over),
        measured=fine(before.measured),
        predicted=fine(after.predicted),
        frequency=_numbers(before.frequency),
        spectrum=_numbers(before.spectrum[:, channel]),
        missed=_numbers(before.missed[:, channel]),
        missed_after=_numbers(after.missed[:, channel]),
    )
