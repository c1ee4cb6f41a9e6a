"""A tab of a headless Chromium, spoken to by its DevTools protocol over pipes."""

import fcntl
import json
import os
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
_OPTIONS = ("--headless", "--disable-gpu", "--no-sandbox", "--disable-dev-shm-usage", "--remote-debugging-pipe")
_SECONDS = 30.0


class Tab:
    """One page.

    Parameters
    ----------
    ask, hear : ends of the pipes
    """

    def __init__(self, ask: int, hear: int) -> None:
        self._ask, self._hear, self._heard, self._n = ask, hear, b"", 0
        self._session: dict[str, str] = {}
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = {"sessionId": self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]}

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Call a method; return its result."""
        self._n += 1
        asked = {"id": self._n, "method": method, "params": params} | self._session
        os.write(self._ask, json.dumps(asked).encode() + b"\0")
        while (answer := self._message()).get("id") != self._n:
            pass
        assert "error" not in answer, answer
        return dict(answer["result"])

    def value(self, expression: str) -> Any:
        """Return the value of an expression in the page."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def until(self, expression: str) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + _SECONDS
        while not self.value(expression):
            assert time.monotonic() < end, f"{expression}: {self.value('document.body.innerText')}"
            time.sleep(0.05)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._heard:
            more = os.read(self._hear, 65_536)
            assert more, "the browser has gone"
            self._heard += more
        message, _, self._heard = self._heard.partition(b"\0")
        return dict(json.loads(message))


@contextmanager
def browser_tab(folder: Path) -> Iterator[Tab]:
    """Run a browser with its profile in a folder."""
    (its_in, ask), (hear, its_out) = os.pipe(), os.pipe()
    moved = [fcntl.fcntl(handle, fcntl.F_DUPFD_CLOEXEC, 20) for handle in (its_in, its_out)]  # off 3 and 4
    places = [(os.POSIX_SPAWN_DUP2, handle, 3 + k) for k, handle in enumerate(moved)]  # where it reads and writes
    quiet = [(os.POSIX_SPAWN_OPEN, handle, os.devnull, os.O_WRONLY, 0) for handle in (1, 2)]
    command = [str(BROWSER), *_OPTIONS, f"--user-data-dir={folder}"]
    number = os.posix_spawn(command[0], command, os.environ, file_actions=[*quiet, *places], setpgroup=0)
    for handle in (its_in, its_out, *moved):
        os.close(handle)
    try:
        yield Tab(ask, hear)
    finally:
        os.killpg(number, signal.SIGKILL)
        os.waitpid(number, 0)
        os.close(ask)
        os.close(hear)
