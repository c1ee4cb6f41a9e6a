"""Texts on sensor health: gain, polarity and delay of every channel."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from daq.notebook import number_text
from monitor.results.comparison import ChannelHealth, SensorComparison

if TYPE_CHECKING:
    from updater.modal_data import Asynchrony
    from updater.validation import SensorHealth

_SURE = 4.0  # standard deviations from which a channel is named
_WIDE = 2.0  # standard deviations that a bound holds
_GAIN = 0.03  # from which a change of gain matters [-]
_NOTHING = 0.1  # gain under which a channel is as good as dead [-]
_FINEST = 0.1  # % of a gain: smallest stated difference
_DELAY = 1e-4  # from which a delay matters [s]
_STANDS_OUT = 3.0  # times the noise, above which the residual of a sensor is named
_MAX_NAMED = 8  # channels that are not synchronous


def health_result(health: "SensorHealth") -> dict[str, ChannelHealth]:
    """Return plain values, channel by channel."""
    columns = zip(health.channels, health.gain, health.gain_std, health.delay, health.delay_std, strict=True)
    return {
        channel: ChannelHealth(
            gain=float(gain),
            gain_std=float(gain_std),
            delay=float(delay) if np.isfinite(delay) else None,
            delay_std=float(delay_std) if np.isfinite(delay_std) else None,
        )
        for channel, gain, gain_std, delay, delay_std in columns
    }


def health_text(sensors: Mapping[str, ChannelHealth], *, explained: bool = True) -> str:
    """Name the faulty channels; if there are none, state the accuracy.

    Parameters
    ----------
    explained : whether the modes are: an unexplained change of the structure looks like sensor faults
    """
    if not sensors:
        return ""
    wrong = [f"{channel}: {fault}" for channel, own in sensors.items() if (fault := fault_text(own))]
    if wrong:
        return (
            "sensors: " if explained else "sensors (assuming that the unexplained part is a sensor fault): "
        ) + "; ".join(wrong)
    bounds = [100 * (abs(s.gain - 1) + _WIDE * s.gain_std) for s in sensors.values()]
    name, largest = max(sensors.items(), key=lambda item: abs(item[1].gain - 1))
    found = number_text(100 * (largest.gain - 1), 100 * largest.gain_std, sign=True)
    text = f"sensors: no gain error over {max(_FINEST, *bounds):.1f} % (95 %; largest found: {name}, {found} %)"
    delays = [abs(s.delay) + _WIDE * (s.delay_std or 0.0) for s in sensors.values() if s.delay is not None]
    return f"{text}, no delay over {1e3 * max(delays):.3f} ms (95 %)" if delays else text


def worst_sensor_text(sensors: Sequence[SensorComparison]) -> str:
    """Return the sensor with the largest residual from the shapes compared, if any is significant; empty for none.

    The residual is that of the report's figure; it is significant from three times the residual expected from noise.
    """
    significant = [s for s in sensors if s.residual >= _STANDS_OUT * s.noise]
    if not significant:
        return ""
    worst = max(significant, key=lambda s: s.residual)
    after = "" if worst.residual_after is None else f", {100 * worst.residual_after:.1f} % with the causes"
    return (
        f"largest deviation from the shapes without the causes: {worst.channel}, {100 * worst.residual:.1f} % of "
        f"a typical component{after} (expected from noise: {100 * worst.noise:.1f} %)"
    )


def asynchrony_text(found: "Asynchrony") -> str:
    """Return the delays between channels that are not synchronous."""
    largest = sorted(found.delays.items(), key=lambda item: -abs(item[1][0]))
    late = [f"{name} {1e3 * value:+.3f} ± {1e3 * std:.3f} ms" for name, (value, std) in largest[:_MAX_NAMED]]
    more = f" and {len(largest) - _MAX_NAMED} more" if len(largest) > _MAX_NAMED else ""
    return (
        f"channels are not synchronous: {', '.join(late)}{more} (against the median channel, + is late); "
        f"without these delays the median MPC is {found.mpc_synchronous:.2f} instead of {found.mpc:.2f}"
    )


def fault_text(own: ChannelHealth) -> str:
    """Return the fault of a channel, empty if it is not certain or not relevant."""
    found = []
    if abs(own.gain) < max(_NOTHING, _SURE * own.gain_std):
        return "no signal"
    if own.gain < -_SURE * own.gain_std:
        found.append("polarity turned")
    if abs(abs(own.gain) - 1) > max(_GAIN, _SURE * own.gain_std):
        found.append(f"gain {gain_text(own)}")
    if own.delay is not None and own.delay_std is not None and abs(own.delay) > max(_DELAY, _SURE * own.delay_std):
        found.append(f"{delay_text(own)} ms {'late' if own.delay > 0 else 'early'}")
    return ", ".join(found)


def gain_text(own: ChannelHealth) -> str:
    """Return a gain with its deviation."""
    return number_text(own.gain, own.gain_std)


def delay_text(own: ChannelHealth) -> str:
    """Return a delay with its deviation [ms]."""
    if own.delay is None or own.delay_std is None:
        return "not known"
    return f"{1e3 * own.delay:+.3f} ± {1e3 * own.delay_std:.3f}"


def health_rows(sensors: Mapping[str, ChannelHealth]) -> list[dict[str, str]]:
    """Return the rows of a table."""
    return [
        {"channel": channel, "gain": gain_text(own), "delay": delay_text(own), "fault": fault_text(own)}
        for channel, own in sensors.items()
    ]
