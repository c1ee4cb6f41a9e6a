"""Commands of a person to a running monitor: one small file each, taken once, logged as an event.

A file needs no port and no rights but those on the folder, outlives a restart, and is seen by whoever runs the monitor.
"""

import os
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from daq.events import EventPayload
from monitor.results.service_events import AcceptanceUndone, Acknowledged, ChangeAccepted, CommandRefused

_LONGEST = 4096  # bytes


def _one_line(text: str) -> str:
    """Return a text without control characters: line breaks separate the lines of logs, and databases refuse zeros."""
    return "".join(letter if letter.isprintable() else " " for letter in text).strip()


CommandText = Annotated[str, AfterValidator(_one_line)]


class OperatorCommand(BaseModel):
    """Command of a person."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    by: CommandText = ""


class Acknowledgement(OperatorCommand):
    """Acknowledgement of the alarm."""

    kind: Literal["acknowledge"] = "acknowledge"
    note: CommandText = ""


class Acceptance(OperatorCommand):
    """Acceptance: the change that raised the alarm is intended, or explained, and becomes the new reference."""

    kind: Literal["accept"] = "accept"
    cause: Annotated[CommandText, Field(min_length=1)]  #: cause in a person's words
    alarm: int | None = None  #: time at which the alarm was raised [ns UTC]. Default: the active one


class UndoAcceptance(OperatorCommand):
    """Undo of the last acceptance."""

    kind: Literal["undo"] = "undo"
    note: CommandText = ""


Command = Acknowledgement | Acceptance | UndoAcceptance
_EVENTS: dict[str, type[EventPayload]] = {
    "acknowledge": Acknowledged,
    "accept": ChangeAccepted,
    "undo": AcceptanceUndone,
}
_COMMAND: TypeAdapter[Command] = TypeAdapter(Annotated[Command, Field(union_mode="left_to_right")])


def write_command(state: Path, command: Command) -> Path:
    """Write a command to the inbox of a state folder, atomically.

    Commands that are written while no monitor runs are executed in their order at the next start.

    Raises
    ------
    OSError
        If this user may not.
    """
    folder = inbox_of(state)
    path = folder / f"{time.time_ns():020}_{uuid.uuid4().hex}.json"
    unfinished = path.with_suffix(".part")
    unfinished.write_text(command.model_dump_json(), encoding="utf-8")
    _give(unfinished, state)
    os.replace(unfinished, path)
    return path


def inbox_of(state: Path) -> Path:
    """Return the folder of commands; it is made if necessary."""
    folder = state / "inbox"
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        _give(folder, state)
    return folder


def _give(path: Path, state: Path) -> None:
    """Give a file that the superuser made to the owner of the state folder, so that the monitor can remove it."""
    if os.geteuid() == 0:
        owner = state.stat()
        os.chown(path, owner.st_uid, owner.st_gid)


class Inbox:
    """Commands left for a monitor.

    Parameters
    ----------
    state : its folder
    """

    def __init__(self, state: Path) -> None:
        self._folder = state / "inbox"
        self._stuck: set[str] = set()

    def taken(self) -> Iterator[EventPayload]:
        """Yield the events of new commands; their files are removed.

        A file that cannot be read or removed is refused once. Otherwise it would be executed again at each start.
        """
        for path in sorted(self._folder.glob("*.json"), key=lambda p: p.name):
            if path.name in self._stuck:
                continue
            try:
                with path.open("rb") as file:
                    text = file.read(_LONGEST + 1)
                path.unlink()
            except OSError as error:
                self._stuck.add(path.name)
                yield CommandRefused(file=path.name, why=f"it cannot be taken: {error.strerror}")
                continue
            yield _parse(path.name, text)


def _parse(name: str, text: bytes) -> EventPayload:
    try:
        command = _COMMAND.validate_json(text)
    except ValidationError as error:
        return CommandRefused(file=name, why=str(error).splitlines()[0])
    return _EVENTS[command.kind](**command.model_dump(exclude={"kind"}))
