"""A log as a run would have written it, made without ports and at once."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from daq import AnyLog, Block, Event, Item, McapWriter, read_events
from daq.drivers import EPSON_SCALE
from daq.log import RotatingWriter, Rotation
from monitor.results.windows import Result, event_result
from monitor.rig import T_DEVICES, Scenario, make_sources
from updater import parse_structure, t_structure_toml

START = 1_767_225_600_000_000_000
_BLOCK = 0.25  # s
_LATENCY = 1e-3  # s, the least; what comes on top is drawn


def site_toml(*, window: float, baseline_windows: int, rate: float) -> str:
    """Settings for the six devices of the T-frame."""
    lines = ['structure = "t_structure.toml"', "[analysis]"]
    lines += [f"window_seconds = {window}", f"baseline_windows = {baseline_windows}"]
    for name, (_, axes) in T_DEVICES.items():
        mapped = ", ".join(f'{axis} = "{name}_{axis}"' for axis in axes)
        lines += ["[[device]]", f'name = "{name}"', 'driver = "epson-uart"', f'port = "/dev/{name}"', f"rate = {rate}"]
        lines += [f"channels = {{{mapped}}}"]
    return "\n".join(lines) + "\n"


def blocks(scenario: Scenario, seconds: float) -> Iterator[Block]:
    """Blocks of all devices in the order of their arrival; starts, clocks and latencies differ."""
    random = np.random.default_rng((scenario.seed, 9))
    world, sources = make_sources(parse_structure(t_structure_toml()), scenario)
    starts = [START + int(t * 1e9) for t in np.sort(random.uniform(0, 0.5, len(sources)))]
    rates = [scenario.rate * (1 + device.clock_error) for device in scenario.device]
    for source, start, rate in zip(sources, starts, rates, strict=True):
        source.start(start, rate)
    world.begin(starts[-1])
    n = round(_BLOCK * scenario.rate)
    for first in range(0, round(seconds * scenario.rate), n):
        for device, source, start, rate in zip(scenario.device, sources, starts, rates, strict=True):
            late = _LATENCY + random.exponential(2e-3)
            yield Block(
                device=device.name,
                rate=scenario.rate,
                first_index=first,
                counts=source.read(first, n),
                scale=EPSON_SCALE,
                arrival_index=first + n - 1,
                arrival_time=start + round(((first + n - 1) / rate + late) * 1e9),
                temperature=21.0,
            )


def write_log(path: Path, scenario: Scenario, seconds: float, site: str) -> None:
    """Write the measurements of a scenario's devices in `seconds` as a log."""
    writer = McapWriter(path, {"site.toml": site, "structure.toml": t_structure_toml()})
    for i, block in enumerate(blocks(scenario, seconds)):
        writer.write(block)
        if i % 12 == 11:
            writer.flush()
    writer.write(Event(topic="/event/stopped", time=START + round(seconds * 1e9), payload={}))
    writer.close()


def logged_results(log: AnyLog) -> Iterator[Result]:
    """Yield the results in a log."""
    yield from (result for event in read_events(log) if (result := event_result(event)) is not None)


def write_run(folder: Path, items: Sequence[Item], attached: Mapping[str, str], seconds: float) -> RotatingWriter:
    """Write the items as files of some seconds; return the open writer."""
    folder.mkdir()
    start = next(item.arrival_time for item in items if isinstance(item, Block))
    writer = RotatingWriter(folder, attached, start, Rotation(seconds=seconds))
    write_items(writer, items)
    return writer


def write_items(writer: RotatingWriter, items: Sequence[Item]) -> None:
    """Write the items, in small chunks."""
    for k, item in enumerate(items):
        writer.write(item)
        if k % 20 == 0:
            writer.flush()
