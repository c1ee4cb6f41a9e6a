"""Gain, polarity and delay of all channels against the baseline, fitted together before any cause is sought.

Every channel is predicted from all others through the modes: unit shapes give its relative size, and their imaginary
parts its delay. Only ratios and differences are determined, and for channels that no mode moves together (along x and
along y, on a symmetric frame) not even these. Most channels are therefore assumed to have the usual accuracy of
sensors, and a few any error: Student's t, by reweighting. The effect of a structural change on shapes is in the errors
(`updater.inference.shape_covariance`), as far as the frequencies show a change.

References
----------
Kammer, "Estimation of structural response using remote sensor locations", J. Guidance, Control, and Dynamics 20 (1997)
501-508; Friswell & Inman, "Sensor validation for smart structures", J. Intelligent Material Systems and Structures 10
(1999) 973-982; Lange, Little & Taylor, "Robust statistical modeling using the t distribution", J. American Statistical
Association 84 (1989) 881-896.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes import Discrete, begin_at
from updater.inference import Comparison, Effect, compare, fit, no_effect
from updater.modal_data import NOTHING_KNOWN, Circumstances, ModalMean, match_modes
from updater.reference import Reference
from updater.structure import Correction, Structure
from updater.validation.modal_correlation import modes_with_causes

_WIDE = (2.0, 5e-3)  # of a gain about one, and of a delay [s]: while the data speak for themselves
_USUAL = (0.02, 5e-5)  # the same, of most channels
_FREEDOM = 4.0  # of Student's t: how easily a channel is one of the few
_REWEIGHTED = 30  # times


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorHealth:
    """Of each channel, relative to the baseline and to most others."""

    channels: tuple[str, ...]
    gain: FloatArray  #: (n_channels,) relative to the previous gain; negative: reversed polarity [-]
    gain_std: FloatArray  #: (n_channels,) [-]
    delay: FloatArray  #: (n_channels,) later than it was [s]; NaN where phases are not known, as of a further sensor
    delay_std: FloatArray  #: (n_channels,) [s]

    @property
    def reversed(self) -> tuple[str, ...]:
        """Channels with reversed polarity: their gain is below zero by four deviations."""
        return tuple(c for c, g, s in zip(self.channels, self.gain, self.gain_std, strict=True) if g < -4 * s)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Channels(Discrete):
    """One alternative: every channel has a gain (less one) and a delay [s] of its own."""

    comparison: Comparison
    begin: FloatArray  #: (1, 2 n_channels)

    @property
    def start(self) -> FloatArray:
        """Turned channels turned, and delays where phases, which repeat, put them."""
        return self.begin

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return gains and delays."""
        none, n = no_effect(len(rows), self.comparison), len(self.comparison.channels)
        return replace(none, chain=(1 + theta[:, :n, None]) * none.chain, imaginary=theta[:, n:])


def sensor_health(reference: Reference, event: ModalMean, circumstances: Circumstances = NOTHING_KNOWN) -> SensorHealth:
    """Return gain and delay of every channel against the baseline.

    Parameters
    ----------
    reference : learned before
    event : (n_tracks,) mean of windows since, devices' delays beyond the baseline's left in
    circumstances : devices of the channels, with the known variation of their clocks

    Raises
    ------
    ModalDataError
        If fewer than three modes or two channels can be compared.
    """
    data = compare(reference, event, circumstances=circumstances)
    n = len(data.channels)
    sign, late = begin_at(reference, data)
    found = fit(
        data,
        _Channels(
            prior_std=np.repeat(_WIDE, n),
            lower=np.full((1, 2 * n), -np.inf),
            drifting=True,
            comparison=data,
            begin=np.r_[sign - 1, late][None],
        ),
    )
    theta, std = _beside_most(found.theta[0], found.covariance[0], np.repeat(_WIDE, n), np.repeat(_USUAL, n))
    phased = data.phased.any() & (reference.of_file | ~reference.unmeasured(data.channels))
    known = np.where(phased, 1.0, np.nan)
    return SensorHealth(
        channels=data.channels,
        gain=1 + theta[:n],
        gain_std=std[:n],
        delay=known * theta[n:],
        delay_std=known * std[n:],
    )


def _beside_most(
    theta: FloatArray, covariance: FloatArray, wide: FloatArray, usual: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return parameters and their deviations with most of them near zero, and a few anywhere.

    Parameters
    ----------
    theta, covariance : (n,), (n, n) fitted with a wide prior
    wide, usual : (n,) standard deviations of that prior, and of most parameters
    """
    precision = np.linalg.inv(covariance)
    pull = precision @ theta
    data = precision - np.diag(wide**-2)
    weight = usual**-2
    for _ in range(_REWEIGHTED):
        posterior = np.linalg.inv(data + np.diag(weight))
        value = posterior @ pull
        spread = value**2 + np.diag(posterior)  # unknown values may be large
        weight = (_FREEDOM + 1) / (_FREEDOM * usual**2 + spread)
    return value, np.sqrt(np.diag(posterior))


# parts of a structure that belong to the measuring chain, in addition to `sensors`
_OF_THE_CHAIN = ("sensor", "recorder")


def with_acting(reference: Reference, extended: Structure) -> Reference:
    """Return a reference whose baseline has the shapes expected with the causes in the structure.

    Frequencies are unchanged: their shift measures how much of a change is unknown. Effects of causes on the measuring
    chain are left out, except exchanged channels: each is evaluated with its actual sensor, or both would appear
    faulty.

    Parameters
    ----------
    reference : that was diagnosed
    extended : its structure with the causes written in
    """
    own, base = reference.structure, reference.baseline
    kept: dict[str, object] = {name: getattr(own, name) for name in _OF_THE_CHAIN}
    carriers = {name: correction.channel for name, correction in extended.sensors.items()}
    kept["sensors"] = {
        sensor.channel: own.sensors.get(sensor.channel, Correction()).model_copy(
            update={"channel": carriers.get(sensor.channel)}
        )
        for sensor in own.sensor
    }
    acted = extended.model_copy(update=kept)
    after = modes_with_causes(reference, acted, base)
    partner = match_modes(base, after)
    shape = np.where((partner >= 0)[:, None], after.shape[partner], base.shape)
    return replace(reference, baseline=replace(base, shape=shape))
