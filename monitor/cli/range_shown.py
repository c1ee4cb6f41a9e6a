"""The line that says to which range of time a command is limited."""

from monitor.cli.terminal import Terminal

_console = Terminal()


def say_range(text: str) -> None:
    """Print a range."""
    _console.print(text, soft_wrap=True, markup=False)
