"""Processes of the tests: scripts that exchange lines, and servers on ports of their own."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def script_process(script: Path, *words: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run a script of this folder; give the process and its first line. It is gone afterwards."""
    with subprocess.Popen(
        [sys.executable, str(script), *map(str, words)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    ) as process:
        try:
            assert process.stdout is not None
            yield process, process.stdout.readline()
        finally:
            process.kill()


def free_port() -> int:
    """Return a port of the loopback interface that was free."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


@contextmanager
def server_process(command: list[str], folder: Path) -> Iterator[Path]:
    """Run a server for as long as the context lasts; give the file of its output."""
    output = folder / "output.txt"
    with (
        output.open("wb") as file,
        subprocess.Popen(
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT
        ) as process,
    ):
        try:
            yield output
        finally:
            process.kill()
