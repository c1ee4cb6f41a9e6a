"""Lines of text for a terminal."""

import sys
from shutil import get_terminal_size
from textwrap import fill
from typing import TextIO

import typer


def divided(text: str, stream: TextIO | None) -> str:
    """Return a text for a stream; long lines are divided between words, where a terminal would divide them anywhere."""
    if stream is None or not stream.isatty():
        return text
    width = get_terminal_size().columns
    return "\n".join(_divided_line(line, width) for line in text.split("\n"))


def _divided_line(line: str, width: int) -> str:
    indent = line[: len(line) - len(line.lstrip())]
    return fill(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def echo_error(text: str) -> None:
    """Print an error, in one line where that is no terminal."""
    typer.echo(divided(text, sys.stderr), err=True)
