"""SITE.toml of the emulated devices of a virtual rig."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from monitor.cli.new.site_file import axis_channels
from monitor.rig import Scenario
from updater import Structure

_SAME_PLACE = 1e-6  # m


def rig_site(
    structure_file: str,
    structure: Structure,
    scenario: Scenario,
    ready: Mapping[str, Any],
    *,
    window: float,
    baseline_windows: int,
) -> str:
    """Return the settings of a monitor of a rig: those of a user, plus the rig's time scale.

    Parameters
    ----------
    structure_file : as written in the settings
    structure : nominal; its sensors at the place of a device are this device's channels
    scenario : of the rig
    ready : clock and ports, as the rig reports them
    window : length of a window [s]
    baseline_windows : from which the baseline is learned
    """
    lines = [
        f"structure = {json.dumps(structure_file)}",
        "",
        "[analysis]",
        f"window_seconds = {window}",
        f"baseline_windows = {baseline_windows}",
        "",
        "[viewer]",
        "",
        "[clock]",
        *(f"{key} = {json.dumps(value)}" for key, value in ready["clock"].items() if value is not None),
    ]
    for device in scenario.device:
        own = [sensor for sensor in structure.sensor if np.allclose(sensor.at, device.at, rtol=0, atol=_SAME_PLACE)]
        axes = axis_channels(own[:3])
        if not axes:
            continue  # no sensor of the structure is there
        mapped = ", ".join(f"{axis} = {json.dumps(channel)}" for axis, channel in axes.items())
        lines += ["", "[[device]]", f"name = {json.dumps(device.name)}", *_place(ready["ports"][device.name])]
        lines += [f"rate = {scenario.rate}", f"channels = {{{mapped}}}"]
    return "\n".join(lines) + "\n"


def _place(place: str | dict[str, Any]) -> list[str]:
    """Return driver and place of a device of the rig."""
    if isinstance(place, str):
        return ['driver = "epson-uart"', f"port = {json.dumps(place)}"]
    fields = ", ".join(f"{key} = {json.dumps(value)}" for key, value in place.items() if value is not None)
    return ['driver = "epson-can"', f"can = {{{fields}}}"]
