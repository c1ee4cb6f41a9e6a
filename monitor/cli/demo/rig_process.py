"""The virtual rig in a process of its own: start, pace and end."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from daq.timing import SharedTime
from monitor.errors import StartError
from monitor.results.windows import Result, WindowResult

_READY_SECONDS = 30.0
_END_SECONDS = 20.0


class RigProcess:
    """The virtual rig, in a process of its own that Ctrl-C does not reach."""

    def __init__(self, folder: Path, speed: float) -> None:
        self._ports, self._report = folder / "ports.json", folder / "rig.json"
        self._command = [sys.executable, "-c", "from monitor.cli.main import main; main()", "rig"]
        self._command += [str(folder / "scenario.toml"), "--speed", str(speed)]
        self._command += ["--ports", str(self._ports), "--report", str(self._report)]

    def __enter__(self) -> "RigProcess":
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(
            self._command, stdin=quiet, stdout=quiet, stderr=subprocess.PIPE, start_new_session=True
        )
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self._process.communicate()

    def wait_until_ready(self, stop: threading.Event) -> dict[str, Any]:
        """Return {"clock": .., "ports": ..}."""
        end = time.monotonic() + _READY_SECONDS
        while not self._ports.exists():
            if stop.is_set():
                raise KeyboardInterrupt
            if self._process.poll() is not None or time.monotonic() > end:
                self._process.kill()
                raise StartError(f"the virtual rig did not start: {self._errors() or 'no answer'}")
            time.sleep(0.05)
        found: dict[str, Any] = json.loads(self._ports.read_text(encoding="utf-8"))
        return found

    def stop_at_its_end(self, stop: threading.Event) -> None:
        """Set `stop` when the rig ends, however that comes."""

        def watch() -> None:
            self._process.wait()
            stop.set()

        threading.Thread(target=watch, name="rig watch", daemon=True).start()

    @property
    def over(self) -> bool:
        """True once the rig has ended by itself."""
        return self._process.poll() == 0

    def finish(self) -> dict[str, Any]:
        """End the rig and return its report."""
        self._process.terminate()
        try:
            self._process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired as error:
            raise StartError("the virtual rig did not end") from error
        if not self._report.exists():
            raise StartError(f"the virtual rig failed: {self._errors()}")
        found: dict[str, Any] = json.loads(self._report.read_text(encoding="utf-8"))
        return found

    def _errors(self) -> str:
        return self._process.stderr.read().decode().strip() if self._process.stderr else ""


_AHEAD = 2.0  # windows that the rig may be ahead of the analysis
_LONGEST = 60.0  # s of wall time that it waits for one result


class Pace:
    """Holds the world of a rig while the analysis is behind: no window is left out, whatever the machine.

    Parameters
    ----------
    clock : fields of the rig's clock, as it reports them
    window : length of a window [s]
    """

    def __init__(self, clock: Mapping[str, Any], window: float) -> None:
        self._most = round(_AHEAD * window * 1e9)
        self._world = SharedTime(Path(clock["shared"])) if clock["shared"] else None  # none in real time

    def keep(self, result: Result) -> None:
        """Let the world go on to some windows after a result, and hold it there until the next one."""
        if self._world is not None and isinstance(result, WindowResult):
            self._world.hold(_LONGEST, at=result.end + self._most)
