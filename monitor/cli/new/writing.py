"""New files, and questions for what a command line leaves open."""

import sys
from collections.abc import Sequence
from pathlib import Path

import typer

from monitor.errors import ArgumentError


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


def write_new(path: Path, text: str, *, force: bool) -> None:
    """Write a file that is not there yet, or any with `force`.

    Raises
    ------
    ArgumentError
        If it is there already or cannot be written.
    """
    try:
        with path.open("w" if force else "x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise ArgumentError("--out", f"{path} exists: give another name, or --force to replace it") from error
    except OSError as error:
        raise ArgumentError("--out", f"{path}: cannot be written: {error.strerror}") from error
