"""Files that commands write for other programs."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from monitor.errors import ArgumentError

STDOUT = Path("-")  #: name of the standard output in place of a file
VERSION = 1  #: of the JSON of all commands, on the standard output: larger if a key is removed or has another meaning


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write the file that --json names, or to the standard output.

    Raises
    ------
    ArgumentError
        If it cannot be written.
    """
    if path == STDOUT:
        typer.echo(json.dumps({"version": VERSION} | content, indent=1))
        return
    try:
        path.write_text(json.dumps(content, indent=1), encoding="utf-8")
    except OSError as error:
        raise ArgumentError("--json", f"{path}: cannot be written: {error.strerror}") from error


@contextmanager
def replacing(path: Path | None, *, force: bool) -> Iterator[None]:
    """With `force`, set an existing file aside while another is written in its place; restore it if that fails."""
    if path is None or not force or not path.is_file():
        yield
        return
    aside = path.with_name(f"{path.name}.replaced")
    os.replace(path, aside)
    try:
        yield
    except BaseException:
        os.replace(aside, path)
        raise
    aside.unlink()
