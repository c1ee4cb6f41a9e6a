"""Headers of universal files (dataset 151): model, description, programs, times."""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from daq.errors import DataError
from daq.files.formats.universal.datasets import Dataset, datasets

_HEADER = 151
_PROGRAM = "modalwatch"
_WIDTH = 80  # of a record
_EVENTS = ("db_created", "db_saved", "file_written")


@dataclass(frozen=True, kw_only=True)
class Header:
    """Header of a universal file; an empty text is a record that is not filled in. Times are local and as written."""

    model: str = ""  #: model file
    description: str = ""
    database_program: str = ""  #: program that made the model
    created: str = ""  #: day and time when the model was made
    saved: str = ""  #: day and time when the model was last saved
    program: str = ""  #: program that wrote the universal file
    written: str = ""  #: day and time when the universal file was written

    @property
    def text(self) -> str:
        """One line: model, description, program and day."""
        return ", ".join(part for part in (self.model, self.description, self.program, self.written) if part)


def read_header(path: Path) -> Header | None:
    """Read the header of a universal file, the first if there are several; None without one.

    Raises
    ------
    DataError
        Naming the file, and the dataset that cannot be read.
    """
    for number, one in datasets(path, (_HEADER,)):
        if one["type"] == _HEADER:
            return _header(path, number, one)
    return None


def _header(path: Path, number: int, one: Dataset) -> Header:
    try:
        return Header(
            model=_text(one, "model_name"),
            description=_text(one, "description"),
            database_program=_text(one, "db_app"),
            created=_text(one, "date_db_created", "time_db_created"),
            saved=_text(one, "date_db_saved", "time_db_saved"),
            program=_text(one, "program"),
            written=_text(one, "date_file_written", "time_file_written"),
        )
    except KeyError as error:
        raise DataError(path, f"dataset {number}: the header lacks {error}") from error


def _text(one: Dataset, *names: str) -> str:
    words = (" ".join(str(one[name]).split()) for name in names)
    return " ".join(word for word in words if word != "NONE").strip()


def header_set(description: str, model: str = "", now: datetime | None = None) -> Dataset:
    """Return the dataset of a header, as pyuff writes it.

    Parameters
    ----------
    description : of the contents
    model : file that they were made from
    now : default: the present local time
    """
    now = now or datetime.now().astimezone()
    times = {f"date_{event}": now.strftime("%d-%b-%y") for event in _EVENTS}
    times |= {f"time_{event}": now.strftime("%H:%M:%S") for event in _EVENTS}
    texts = {"model_name": model, "description": description, "db_app": _PROGRAM, "program": _PROGRAM}
    return {"type": _HEADER, **{name: _record(text) for name, text in texts.items()}, **times}


def _record(text: str) -> str:
    """Return a text as a record: ASCII, on one line; `NONE` without one."""
    line = " ".join(text.encode("ascii", "replace").decode().split())[:_WIDTH]
    return line or "NONE"
