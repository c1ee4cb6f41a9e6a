"""Contents of the saved state, as text with a check of its completeness and of the watch that it belongs to."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from daq.bounded_text import parse_json
from monitor.analysis.window import Window
from monitor.detection.alarm import Alarm
from monitor.settings import Settings, TemperatureSettings
from monitor.settings.redaction import redacted_topic, revealed
from monitor.watch.accepted_change import AcceptanceRequest, AcceptedChange
from monitor.watch.detector import DetectorState
from monitor.watch.memory.codec import CodecError, decode, encode
from monitor.watch.memory.file import MEMORY, NOTHING, LoadedState
from monitor.watch.memory.signals import CalmSignals
from monitor.watch.self_test import Tested
from updater import Structure, dump_structure
from updater.structure import without_edges

STRUCTURE, NO_STRUCTURE = "the structure file", "none"  #: key and value in the dependencies of a state
VERSION = 11  # version of this format, or of the identification of modes: another one is not read, but for
_WITHOUT_SIGNALS = 10  # this one


@dataclass(frozen=True, eq=False, kw_only=True)
class Memory:
    """State of a watch between two windows."""

    state_fingerprint: dict[str, str]  #: dependencies, each as a text (see `state_fingerprint`)
    n_windows: int  #: so far
    baseline: tuple[Window, ...]  #: learned from, or so far
    target: int  #: windows to learn from
    restarts: int  #: restarts of learning, by changes of the structure within the baseline
    detector: DetectorState | None  #: None while the baseline is being learned
    alarm: Alarm
    accepted: tuple[AcceptedChange, ...]  #: changes of the structure since the baseline
    wanted: AcceptanceRequest | None  #: an acceptance that waits for windows
    tests: Tested
    out: tuple[Window, ...]  #: windows above the limit, without interruption
    calm: tuple[Window, ...]  #: windows below it since the last evaluation of the sensors
    #: difference of the site's thermometer from the devices' [K], see `SiteTemperature`
    thermometer_offset: float = math.nan
    signals: CalmSignals | None = None  #: of the first calm window of the reference

    @property
    def without_model(self) -> bool:
        """Return whether it was learned without a structure file."""
        return self.state_fingerprint.get(STRUCTURE) == NO_STRUCTURE


def state_fingerprint(structure: Structure | None, settings: Settings) -> dict[str, str]:
    """Return the dependencies of a baseline; if any of them changes, it must be learned again.

    A structure file may be added to a site without one (`check_saved_state`).
    """
    analysis, temperature = settings.analysis, settings.temperature
    return {
        STRUCTURE: NO_STRUCTURE if structure is None else _digest(dump_structure(without_edges(structure)))[:16],
        "the channels": ", ".join(f"{c.name} = {c.device} {'xyz'[c.axis]}" for c in settings.channels),
        "the devices": ", ".join(f"{d.name} ({d.driver}, {d.rate:g} Hz)" for d in settings.device),
        "the thermometer": "the devices'" if temperature is None else _thermometer(temperature),
        "analysis.window_seconds": f"{analysis.window_seconds:g}",
        "analysis.overlap": f"{analysis.overlap:g}",
        "analysis.band": "unset" if analysis.band is None else "{:g} to {:g} Hz".format(*analysis.band),
    }


def _thermometer(settings: TemperatureSettings) -> str:
    """Return which one it is: a file by its name, wherever the site lies."""
    return Path(settings.csv).name if settings.csv else redacted_topic(revealed(settings.mqtt))


def memory_text(memory: Memory) -> str:
    """Return a saved state as text: one line with version and checksum, and one of values."""
    content = json.dumps(encode(memory))
    return json.dumps({"modalwatch": VERSION, "sha256": _digest(content)}) + "\n" + content


def parse_memory(text: str) -> Memory:
    """Return the memory of a text.

    Raises
    ------
    CodecError
        If it is damaged, of another version, or no memory.
    """
    head, _, content = text.partition("\n")
    try:
        header: Any = parse_json(head)
        version, digest = header["modalwatch"], header["sha256"]
    except (ValueError, KeyError, TypeError) as error:
        raise CodecError("it is no memory of a watch, or damaged") from error
    if version not in (VERSION, _WITHOUT_SIGNALS):
        raise CodecError(f"it is of version {version}, this program reads {VERSION}")
    if _digest(content) != digest:
        raise CodecError("it is damaged: its checksum is wrong")
    values = _content(content)
    if version == _WITHOUT_SIGNALS and isinstance(values, dict):
        values["signals"] = None
    memory: Memory = decode(Memory, values)
    return memory


def _content(text: str) -> Any:  # noqa: ANN401 - any JSON value
    try:
        return parse_json(text)
    except ValueError as error:
        raise CodecError(f"it is no memory of a watch: {error}") from error


def _digest(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()


def recall(state: Path, structure: Structure | None, settings: Settings) -> LoadedState:
    """Return the saved state, if it is intact and of the same baseline."""
    path = state / MEMORY
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return NOTHING
    except (OSError, UnicodeDecodeError) as error:
        return LoadedState(refused=f"{path} cannot be read: {error}")
    return check_saved_state(text, str(path), structure, settings)


def check_saved_state(text: str, source: str, structure: Structure | None, settings: Settings) -> LoadedState:
    """Return a saved state if it is intact and was made with the present settings; else the reason.

    One that was made without a structure file is valid with one, too, unless that states delays of channels, which
    would have been removed from the windows.
    """
    try:
        found = parse_memory(text)
    except CodecError as error:
        return LoadedState(refused=f"{source}: {error}")
    then, now = _without_login(found.state_fingerprint), state_fingerprint(structure, settings)
    if found.without_model and structure is not None and not any(structure.delays.values()):
        del now[STRUCTURE]
    changed = [f"{name}: {then.get(name)} then, {value} now" for name, value in now.items() if then.get(name) != value]
    if changed:
        return LoadedState(refused="; ".join(changed))
    return LoadedState(
        text=text if then == found.state_fingerprint else memory_text(replace(found, state_fingerprint=then))
    )


def _without_login(then: Mapping[str, str]) -> dict[str, str]:
    """Return the dependencies of a saved state, with a thermometer's address in the present form: no login."""
    return {
        name: redacted_topic(words) if words.startswith(("mqtt://", "mqtts://")) else words
        for name, words in then.items()
    }
