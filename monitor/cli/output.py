"""Files that commands write, and questions for what a command line leaves open."""

import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from daq.errors import writing
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
    with writing(path, ArgumentError.of_file("--json")):
        path.write_text(json.dumps(content, indent=1), encoding="utf-8")


def check_outputs(files: Mapping[str, Path | None], *, force: bool) -> None:
    """Refuse to write over files, unless by `force`; the standard output, pipes and folders are no such files.

    Parameters
    ----------
    files : by the options that name them; None: not requested
    force : existing files are replaced

    Raises
    ------
    ArgumentError
        If one of them exists.
    """
    for option, path in files.items():
        if path is None or path == STDOUT or force:
            continue
        with writing(path, ArgumentError.of_file(option)):
            exists = path.is_file()
        if exists:
            raise ArgumentError(option, f"{path} exists: give another name, or --force to replace it")


def existing_in(folder: Path | None, names: Iterable[str]) -> Path | None:
    """Return the first of some files that is in a folder already; None if there is none."""
    with writing(folder or STDOUT, ArgumentError.of_file("--out")):
        return next((folder / name for name in names if (folder / name).is_file()), None) if folder else None


@contextmanager
def replacing(path: Path | None, *, force: bool, option: str = "--out") -> Iterator[None]:
    """With `force`, set an existing file aside while another is written in its place; restore it if that fails.

    Raises
    ------
    ArgumentError
        If it is there already, without `force`, or cannot be set aside.
    """
    check_outputs({option: path}, force=force)
    if path is None or not force or not path.is_file():
        yield
        return
    aside = path.with_name(f"{path.name}.replaced")
    with writing(path, ArgumentError.of_file(option)):
        os.replace(path, aside)
    try:
        yield
    except BaseException:
        os.replace(aside, path)
        raise
    aside.unlink()


def write_new(path: Path, text: str, *, force: bool, option: str = "--out") -> None:
    """Write a file that is not there yet, or any with `force`.

    Parameters
    ----------
    path : of the file
    text : its content
    force : an existing file is replaced
    option : that names the file, for errors

    Raises
    ------
    ArgumentError
        If it is there already or cannot be written.
    """
    with (
        writing(path, ArgumentError.of_file(option)),
        replacing(path, force=force, option=option),
        path.open("x", encoding="utf-8") as file,
    ):
        file.write(text)


def asked(option: str, question: str, choices: Sequence[str] = ()) -> str:
    """Return the answer of the person at the terminal.

    Raises
    ------
    ArgumentError
        If nobody can be asked, or the answer is not one of the choices.
    """
    listed = f" ({', '.join(choices)})" if choices else ""
    if not sys.stdin.isatty():
        raise ArgumentError(option, f"needed{listed}: {question}")
    answer: str = typer.prompt(f"{question}{listed}")
    if choices and answer not in choices:
        raise ArgumentError(option, f"expected one of {', '.join(choices)}, found {answer!r}")
    return answer
