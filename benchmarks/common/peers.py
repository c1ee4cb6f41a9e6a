"""Other people's packages in an environment of their own, and measured children.

A child is one Python process with one BLAS thread that runs one function of one file and reports its CPU time and
memory. Arguments and results are JSON; large arrays travel as .npy files.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import util
from pathlib import Path
from typing import Any

PEERS = ("pyoma-2==1.4.3", "koma-python==1.3.6", "sdypy-EMA==0.31.0", "pyuff>=2.5.8")
ENVIRONMENT = Path(__file__).parents[2] / ".benchmark-venv"
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}
OURS = Path(sys.executable)


def peer_python() -> Path:
    """Return the interpreter of the peers' environment, made at the first call (a few minutes)."""
    python = ENVIRONMENT / "bin" / "python"
    done = ENVIRONMENT / ".done"
    if not done.exists():
        subprocess.run([sys.executable, "-m", "venv", str(ENVIRONMENT)], check=True)
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, PEERS[0]], check=True)
        # its identification needs numpy, scipy and pandas only; its pictures would bring a browser's worth of packages
        subprocess.run([*pip, "--no-deps", *PEERS[1:]], check=True)
        done.touch()
    return python


def measured(python: Path, file: Path, function: str, repeats: int, **arguments: Any) -> dict[str, Any]:
    """Call a function in a child process of an interpreter.

    Parameters
    ----------
    python : Path
    file : Path
        Python file that has the function.
    function : str Its name. It is called with `arguments` and returns (work, result), where ``work()`` is measured and
        ``result(work())`` is returned.
    arguments : JSON values

    repeats : int
        How often it is done: the shortest time counts, the first one's memory.

    Returns
    -------
    dict
        ``cpu`` [s], ``megabytes`` taken by the work beyond those before it, ``result``.

    Raises
    ------
    subprocess.CalledProcessError
        If it fails; its standard error is shown.
    """
    command = [str(python), __file__, str(file), function, str(repeats), json.dumps(arguments)]
    done = subprocess.run(
        command,
        check=True,
        stdout=subprocess.PIPE,
        env=os.environ | ONE_THREAD | {"PYTHONPATH": str(ENVIRONMENT.parent)},
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def peak() -> float:
    """Return the most memory this process has held so far [MB]; `getrusage` would count its parent's as well."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return float(line.split()[1]) / 1024


def _main(file: str, function: str, repeats: str, arguments: str) -> None:
    spec = util.spec_from_file_location("measured", file)
    assert spec is not None
    assert spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    work, result = getattr(module, function)(**json.loads(arguments))
    before = peak()
    outcome, cpu = _timed(work)
    memory = peak() - before
    cpu = min([cpu, *(_timed(work)[1] for _ in range(int(repeats) - 1))])
    sys.stdout.write("\n" + json.dumps({"cpu": cpu, "megabytes": memory, "result": result(outcome)}) + "\n")


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return the result of the work, and its CPU time [s]."""
    start = time.process_time()
    return work(), time.process_time() - start


if __name__ == "__main__":
    _main(*sys.argv[1:])
