"""Programs of examples/ for boards with the Arduino core, compiled for this machine."""

import subprocess
from pathlib import Path

STUB = Path(__file__).parent / "arduino"


def compiled_program(source: Path, folder: Path, *flags: str) -> Path:
    """Return a program of a sketch or a source file."""
    program = folder / source.stem
    command = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-O1", f'-DPROGRAM="{source}"', *flags]
    subprocess.run(
        [*command, "-I", str(STUB), "-I", str(source.parent), "-o", str(program), str(STUB / "main.cpp")],
        check=True,
        timeout=60,
    )
    return program
