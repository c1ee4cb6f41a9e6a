"""The memory of the run before: read at the start, and checked against the present settings."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from monitor.settings import Settings
from monitor.settings.redaction import redacted_topic
from monitor.watch.memory.codec import CodecError
from monitor.watch.memory.file import MEMORY, NOTHING, LoadedState
from monitor.watch.memory.state import STRUCTURE, memory_text, parse_memory, state_fingerprint
from updater import Structure


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
