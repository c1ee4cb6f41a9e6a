"""Player of a scenario on emulated devices: true structure, streaming ptys, timeline of events."""

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from daq import CanAddress, HostClock
from daq.emulator import EmulatedEpson, EmulatedEpsonCan, EmulatedPort, EmulatedSlcan, serve_all, unplugging
from daq.timing import SharedTime
from monitor.rig.device_model import DeviceSource, make_sources, serial_number, serial_word
from monitor.rig.scenario import RigDevice, RigEvent, Scenario
from monitor.rig.world import World
from updater import Structure

_TICK = 0.004  # s of wall time between servings
_LEASH = 4 * _TICK, 0.06  # s of wall time that one serving may catch up: the capacity of a pty; a third of a FIFO
_SMOOTHING = 0.1  # of the time between servings
_ROOM = (
    3000  # bytes in a port at which an accelerated world waits: a pty shows 4 kB to its reader, and holds 64 kB more
)
_PATIENCE = 1.0  # s of wall time that it waits for a reader: a port that nobody reads does not hold up the others

Place = str | CanAddress  #: serial port or CAN node
Emulated = EmulatedEpson | EmulatedEpsonCan


@dataclass(frozen=True, kw_only=True)
class PlayReport:
    """Actions of the rig."""

    sent: int  #: scans handed to the ptys
    dropped: int  #: scans that found a full pty
    dropped_by_device: dict[str, int]  #: the same, one by one
    events: tuple[int, ...]  #: times of the scenario's events that came to pass [ns UTC]


class _LeashedClock:
    """A clock that moves from one serving to the next, in steps that the ports can take.

    After this process was held up it catches up in several steps, and it waits for readers that were held up. Without
    that, data due after a delay would overflow the ports, although no real device would have been delayed; and one
    device would run far ahead of the others. Faster than real time, a serving waits while a port is almost full: a pty
    that a busy machine does not read at once would keep scans for some seconds of data. It waits, too, while a reader
    holds the shared time, and does not catch up afterwards.

    Parameters
    ----------
    clock : of the world
    shared : gets the time of each serving, before its scans are sent: no scan arrives before it was sampled
    """

    def __init__(self, clock: HostClock, shared: SharedTime) -> None:
        self._clock, self._shared = clock, shared
        self.speed = clock.speed
        self._now = clock.now()
        self._interval, self._last = _TICK, time.monotonic()
        self._waited = 0.0  # for readers [s of wall time]
        self._lag = 0  # after holds, which is not caught up [ns]

    def now(self, _: int = 0) -> int:
        """Return the time of the present serving [ns UTC]."""
        return self._now

    def step(self, unread: int) -> None:
        """Move on: at most twice the recent interval of servings, so that a busy machine keeps up.

        Parameters
        ----------
        unread : bytes in the fullest port
        """
        wall = time.monotonic()
        elapsed, self._last = wall - self._last, wall
        self._interval += _SMOOTHING * (elapsed - self._interval)
        self._waited = self._waited + elapsed if unread > _ROOM else 0.0
        if self.speed > 1 and self._shared.held:
            self._lag = self._clock.now() - self._now
            return
        if self.speed > 1 and 0 < self._waited < _PATIENCE:
            return
        leash = min(max(2 * self._interval, _LEASH[0]), _LEASH[1])
        self._now = min(self._clock.now() - self._lag, self._now + round(leash * 1e9 * self.speed))
        self._shared.step(self._now)


def play(
    structure: Structure,
    scenario: Scenario,
    clock: HostClock,
    shared: SharedTime,
    ready: Callable[[dict[str, Place]], None],
    stop: threading.Event,
    happened: Callable[[RigEvent, int], None] = lambda _, __: None,
) -> PlayReport:
    """Play a scenario until its duration is over or `stop` is set.

    The structure moves from the beginning; devices sample when they are started. The timeline counts from the start of
    the last of them; a device that was not started yet delays everything. Ports are links in a folder that is removed
    at the end: the kernel gives the number of a closed pty to the next program, whose terminal a driver that reconnects
    would open.

    Parameters
    ----------
    structure : nominal
    scenario : of the rig
    clock : of the world
    shared : gets the times of the world
    ready : called once with device -> where it is connected
    stop : ends it early
    happened : called with each event and its time [ns UTC]
    """
    world, sources = make_sources(structure, scenario)
    leashed = _LeashedClock(clock, shared)
    rig_ports: list[EmulatedPort] = []
    with tempfile.TemporaryDirectory(prefix="modalwatch-rig-") as links, unplugging(rig_ports) as ports:
        rig = _Rig(Path(links), ports)
        for device, source in zip(scenario.device, sources, strict=True):
            rig.add(device, source, leashed)
        rig.plug_adapter()
        ready(rig.places)
        events: list[int] = []
        timeline = sorted(scenario.event, key=lambda event: event.at)
        for moment in _serve(rig, scenario.duration, world, leashed, stop):
            happened(timeline[len(events)], moment)
            events.append(moment)
    dropped = {name: emulated.dropped for name, emulated in rig.devices.items()}
    sent = sum(emulated.sent for emulated in rig.devices.values())
    return PlayReport(sent=sent, dropped=sum(dropped.values()), dropped_by_device=dropped, events=tuple(events))


@dataclass(eq=False)
class _Rig:
    """Emulated devices, and the ports they are behind: a serial one each, or one adapter for all CAN nodes."""

    links: Path  #: folder of links to the ports
    ports: list[EmulatedPort]
    devices: dict[str, Emulated] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)

    def add(self, device: RigDevice, source: DeviceSource, clock: HostClock) -> None:
        """Add a device of the scenario."""
        error = device.clock_error
        if device.node is None:
            serial = EmulatedEpson(source, clock, serial_number=serial_number(device), clock_error=error)
            self.devices[device.name] = serial
            self.places[device.name] = self._linked(serial)
        else:
            number = serial_word(device)
            self.devices[device.name] = EmulatedEpsonCan(
                source, clock, node=device.node, serial_number=number, clock_error=error
            )

    def plug_adapter(self) -> None:
        """Give the CAN nodes their adapter, if there are any."""
        nodes = {name: device for name, device in self.devices.items() if isinstance(device, EmulatedEpsonCan)}
        if nodes:
            channel = self._linked(EmulatedSlcan(list(nodes.values())))
            for name, device in nodes.items():
                self.places[name] = CanAddress(interface="slcan", channel=channel, node=device.node)

    def _linked(self, port: EmulatedPort) -> str:
        """Take a port, and return the path of its link."""
        self.ports.append(port)
        link = self.links / f"port{len(self.ports)}"
        link.symlink_to(port.port)
        return str(link)


def _serve(rig: _Rig, duration: float, world: World, clock: _LeashedClock, stop: threading.Event) -> Iterator[int]:
    """Serve until the end; yield the time of each event when it has happened [ns UTC]."""
    begun: int | None = None
    coming: list[int] = []
    turn = 0
    while not stop.wait(_TICK):
        turn += 1
        clock.step(max(port.unread for port in rig.ports))
        world.keep_up(clock.now())
        serve_all(rig.ports, turn)
        if begun is None:
            devices = list(rig.devices.values())
            times = [time for device in devices if (time := device.sampling_since) is not None]
            begun = max(times) if len(times) == len(devices) else None
            coming = [] if begun is None else list(world.begin(begun))
        elif duration and clock.now() - begun > duration * 1e9:
            break
        while coming and coming[0] <= clock.now():
            yield coming.pop(0)
    yield from (time for time in coming if time <= clock.now())
