"""What a person tells a running monitor: one small file each, taken once, put into the log as an event.

A file needs no port and no rights but those on the folder, outlives a restart, and is seen by whoever runs the monitor.
"""

import json
import os
import uuid
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

TOPIC_ACKNOWLEDGE = "/event/acknowledge"
TOPIC_REFUSED = "/event/refused"  # a file that says nothing sensible
_LONGEST = 4096  # bytes


class Acknowledgement(BaseModel):
    """A person knows of the alarm."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    by: str = ""
    note: str = ""


def leave(state: Path, said: Acknowledgement) -> Path:
    """Put an acknowledgement where the monitor of that state folder takes it; it appears whole or not at all."""
    folder = state / "inbox"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{uuid.uuid4().hex}.json"
    unfinished = path.with_suffix(".part")
    unfinished.write_text(said.model_dump_json(), encoding="utf-8")
    os.replace(unfinished, path)
    return path


def taken(state: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield topic and payload of what was left since the last time; each file is gone once it is yielded."""
    for path in sorted((state / "inbox").glob("*.json"), key=lambda p: p.name):
        try:
            with path.open("rb") as file:
                text = file.read(_LONGEST + 1)
            path.unlink()
        except OSError:
            continue  # not ours to read, or gone: the next look will tell
        try:
            said = Acknowledgement.model_validate(json.loads(text))
        except (ValueError, ValidationError) as error:
            yield TOPIC_REFUSED, {"file": path.name, "why": str(error).splitlines()[0]}
        else:
            yield TOPIC_ACKNOWLEDGE, said.model_dump()
