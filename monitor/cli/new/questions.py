"""Questions for what a command line leaves open."""

import sys
from collections.abc import Sequence

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
