"""Output on the terminal, with control characters of names and texts shown as escapes."""

import os
from typing import Any

import typer
from rich.console import Console, ConsoleDimensions
from rich.text import Text

from daq.bounded_text import printable

_FILE_COLUMNS = 1000  # of lines that no terminal shows


class Terminal(Console):
    """Console that escapes control characters in all strings it renders, cells of tables too."""

    def __init__(self) -> None:
        super().__init__(highlight=False)

    @property
    def size(self) -> ConsoleDimensions:
        """Size of the terminal; lines for files and other programs are whole."""
        found = super().size
        if self.is_terminal or self._width is not None or "COLUMNS" in os.environ:
            return found
        return ConsoleDimensions(_FILE_COLUMNS, found.height)

    @size.setter
    def size(self, new: tuple[int, int]) -> None:
        self._width, self._height = new

    def render_str(self, text: str, **options: Any) -> Text:  # noqa: ANN401 - as rich has them
        """Return the text of a string with markup."""
        return super().render_str(printable(text), **options)


console = Terminal()


def keep_stdout_free() -> None:
    """Print all texts to the standard error stream from now on."""
    console.stderr = True


def echo(text: str, *, nl: bool = True, err: bool = False) -> None:
    """Print a text without markup, its control characters as escapes."""
    typer.echo(printable(text), nl=nl, err=err or console.stderr)


def warn(text: str) -> None:
    """Print a text that needs attention, in yellow."""
    console.print(text, style="yellow", soft_wrap=True, markup=False)
