"""Scenarios and worlds that the rig's tests share."""

from collections.abc import Mapping

import numpy as np

from daq import FloatArray
from monitor.rig import T_DEVICES, RigDevice, RigEvent, Scenario, Truth
from updater import Body, Structure, parse_structure, t_structure_toml

ORIGIN = 1_767_225_600_000_000_000  #: when the tests' devices begin [ns UTC]
QUIET: dict[str, object] = {"gain_scatter": 0.0, "noise_density": 0.0}


def t_frame() -> Structure:
    """Return the shipped structure, nominal."""
    return parse_structure(t_structure_toml())


def nominal(
    seed: int = 0, truth: Mapping[str, object] | None = None, bodies: tuple[tuple[float, Body], ...] = ()
) -> Scenario:
    """Return a scenario whose structure is nominal but for `truth`; bodies as (time [s], body)."""
    return Scenario(
        structure="t_structure",
        seed=seed,
        duration=0,
        device=tuple(RigDevice(name=name, at=at) for name, (at, _) in T_DEVICES.items()),
        truth=Truth.model_validate(truth or {}),
        event=tuple(RigEvent(at=at, body=body) for at, body in bodies),
    )


class SineWorld:
    """A world in which every axis of every device moves as sin(2 pi f t) [m/s2], t = 0 at ORIGIN."""

    def __init__(self, frequency: float, amplitude: float = 1.0, rate: float = 4000.0) -> None:
        self.frequency, self.amplitude, self.rate = frequency, amplitude, rate

    def sample(self, time: int) -> float:
        """Count simulated samples from one second before ORIGIN."""
        return self.rate * (1 + (time - ORIGIN) * 1e-9)

    def motion(self, first: int, last: int, device: int) -> FloatArray:
        """Return accelerations (last - first, 3) [m/s2]."""
        return np.repeat(self.at(np.arange(first, last) / self.rate - 1)[:, None], 3, axis=1)

    def at(self, time: FloatArray) -> FloatArray:
        """Return the acceleration at times [s]."""
        return np.asarray(self.amplitude * np.sin(2 * np.pi * self.frequency * time))
