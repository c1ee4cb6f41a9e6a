"""Scenarios and worlds that the rig's tests share."""

from collections.abc import Iterator, Mapping

import numpy as np

from daq import Block, FloatArray
from daq.drivers import EPSON_SCALE
from monitor.cli.demo.rig_site import rig_site
from monitor.rig import T_DEVICES, RigDevice, RigEvent, Scenario, Truth
from monitor.rig.device_model import make_sources
from monitor.settings import Settings, parse_settings
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


_BLOCK_SECONDS = 0.2


def rig_blocks(scenario: Scenario, seconds: float, *, jitter: float = 1e-3) -> Iterator[Block]:
    """Yield the blocks of a rig's devices in the order of time, as fast as they can be computed.

    Parameters
    ----------
    scenario : of the shipped structure; its devices have clocks and gains of their own, its events happen
    seconds : of data [s]
    jitter : mean delay of a block's arrival, exponentially distributed [s]
    """
    random = np.random.default_rng((scenario.seed, 77))
    world, sources = make_sources(t_frame(), scenario)
    rates = [scenario.rate * (1 + device.clock_error) for device in scenario.device]
    for source, rate in zip(sources, rates, strict=True):
        source.start(ORIGIN, rate)
    world.begin(ORIGIN)
    n = round(_BLOCK_SECONDS * scenario.rate)
    for k in range(int(seconds / _BLOCK_SECONDS)):
        for source, device, rate in zip(sources, scenario.device, rates, strict=True):
            last = (k + 1) * n - 1
            yield Block(
                device=device.name,
                rate=scenario.rate,
                first_index=k * n,
                counts=source.read(k * n, n),
                scale=EPSON_SCALE,
                arrival_index=last,
                arrival_time=ORIGIN + round((last / rate + random.exponential(jitter)) * 1e9),
                temperature=20.0,
            )


def rig_settings(scenario: Scenario, *, window: float, baseline_windows: int) -> Settings:
    """Return the settings of a monitor of a rig of the shipped structure."""
    return parse_settings(rig_site_text(scenario, window=window, baseline_windows=baseline_windows))


def rig_site_text(scenario: Scenario, *, window: float, baseline_windows: int) -> str:
    """Return the text of these settings."""
    ports = {device.name: f"/dev/{device.name}" for device in scenario.device}
    ready = {"clock": {"speed": 1.0, "origin_wall": 0, "origin": 0}, "ports": ports}
    return rig_site("t_structure.toml", t_frame(), scenario, ready, window=window, baseline_windows=baseline_windows)
