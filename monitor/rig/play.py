"""A scenario played on emulated devices: a world that moves, ptys that stream, a timeline of what happens."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from daq import EmulatedEpson, HostClock, serve_all, unplugging
from monitor.rig.measured import make_sources, serial_number
from monitor.rig.scenario import Scenario
from monitor.rig.truth import World
from updater import Structure

_TICK = 0.004  # s of wall time between servings
_LEASH = 4 * _TICK, 0.06  # s of wall time that one serving may make up for: what a pty just holds; a third of a FIFO
_SMOOTHING = 0.1  # of the time between servings


@dataclass(frozen=True, kw_only=True)
class PlayReport:
    """What the rig did."""

    sent: int  #: frames handed to the ptys
    dropped: int  #: frames that found a full pty
    dropped_by_device: dict[str, int]  #: the same, one by one
    events: tuple[int, ...]  #: times of the scenario's events that came to pass [ns UTC]


class _LeashedClock:
    """A clock that catches up in steps after this process was held up.

    Without it, what became due meanwhile would overflow the ports, though no real device would have been held up; and
    one device would run far ahead of the others.
    """

    def __init__(self, clock: HostClock) -> None:
        self._clock = clock
        self.speed = clock.speed
        self._limit = clock.now()
        self._interval, self._last = _TICK, time.monotonic()

    def now(self) -> int:
        """Return the time [ns UTC]."""
        return min(self._clock.now(), self._limit)

    def lengthen(self) -> None:
        """Allow another step: twice what servings are apart lately, so that a busy machine is kept up with too."""
        wall = time.monotonic()
        self._interval += _SMOOTHING * (wall - self._last - self._interval)
        self._last = wall
        self._limit = self.now() + round(min(max(2 * self._interval, _LEASH[0]), _LEASH[1]) * 1e9 * self.speed)


def play(
    structure: Structure,
    scenario: Scenario,
    clock: HostClock,
    ready: Callable[[dict[str, str]], None],
    stop: threading.Event,
) -> PlayReport:
    """Play a scenario until its duration is over or `stop` is set.

    The structure moves from the beginning; devices sample from when they are told to. The timeline counts from the
    moment the last of them began; a device not asked for yet keeps everything waiting.

    Parameters
    ----------
    structure : nominal
    scenario : of the rig
    clock : of the world
    ready : called once with device -> port
    stop : ends it early
    """
    world, sources = make_sources(structure, scenario)
    leashed = _LeashedClock(clock)
    with unplugging([]) as devices:
        for device, source in zip(scenario.device, sources, strict=True):
            number, error = serial_number(device), device.clock_error
            devices.append(EmulatedEpson(source, leashed, serial_number=number, clock_error=error))
        names = [device.name for device in scenario.device]
        ready(dict(zip(names, (emulated.port for emulated in devices), strict=True)))
        events = _serve(devices, scenario.duration, world, leashed, stop)
        dropped = {name: emulated.dropped for name, emulated in zip(names, devices, strict=True)}
    sent = sum(emulated.sent for emulated in devices)
    return PlayReport(sent=sent, dropped=sum(dropped.values()), dropped_by_device=dropped, events=events)


def _serve(
    devices: list[EmulatedEpson], duration: float, world: World, clock: _LeashedClock, stop: threading.Event
) -> tuple[int, ...]:
    """Serve until the end; return the times of the events that happened [ns UTC]."""
    begun: int | None = None
    planned: tuple[int, ...] = ()
    turn = 0
    while not stop.wait(_TICK):
        turn += 1
        clock.lengthen()
        world.keep_up(clock.now())
        serve_all(devices, turn)
        if begun is None:
            begun = _last_begun(devices)
            planned = () if begun is None else world.begin(begun)
        elif duration and clock.now() - begun > duration * 1e9:
            break
    return tuple(time for time in planned if time <= clock.now())


def _last_begun(devices: list[EmulatedEpson]) -> int | None:
    """Return when the last device began to sample [ns UTC]; None if one has not."""
    times = [time for device in devices if (time := device.sampling_since) is not None]
    return max(times) if len(times) == len(devices) else None
