"""The unit that `install-service --user` writes, run by systemd itself on an emulated device.

    python benchmarks/monitor/systemd_unit.py

or `make bench-unit`. A user's service manager is started in a mount namespace and a control group of its own, as root
or where control groups are delegated; the machine's own manager, if there is one, is not used. Exit code 1 if a check
fails.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from daq import read_events
from tests.support.processes import script_process
from updater import t_structure_toml

ROOT = Path(__file__).parents[2]
_SYSTEMD = "/lib/systemd/systemd"
_GROUPS = Path("/sys/fs/cgroup")
_CODE = "from monitor.cli.main import main; main()"
_WATCHDOG, _AGAIN = 4.0, 0.5  # s, instead of 60 and 5
_SITE = """structure = "t_structure.toml"
[recorder]
min_free_gb = 0
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "{}"
channels = {{y = "beam_left_y"}}
"""


@contextmanager
def control_group() -> Iterator[list[Path]]:
    """Make a control group below ours, in each hierarchy that systemd counts processes by; remove all of it after.

    A manager takes all processes of its control group for its own, and moves them.
    """
    name, found = f"modalwatch-unit-{os.getpid()}", []
    for line in Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines():
        number, controllers, path = line.split(":", 2)
        places = {"name=systemd": _GROUPS / "systemd"}
        if number == "0":
            places[""] = _GROUPS if (_GROUPS / "cgroup.controllers").exists() else _GROUPS / "unified"
        if controllers in places:
            found.append(places[controllers] / path.lstrip("/") / name)
    try:
        for group in found:
            group.mkdir()
        yield found
    finally:
        left = [Path(top) for top, _, _ in os.walk(_GROUPS) if name in top]
        for group in sorted(left, key=lambda path: len(path.parts), reverse=True):
            group.rmdir()


class Manager:
    """A user's service manager, and the unit under test."""

    def __init__(self, folder: Path, groups: list[Path]) -> None:
        self.folder, self.unit = folder, ""
        runtime = folder / "run"
        runtime.mkdir(mode=0o700)
        mine = {"HOME": str(folder), "XDG_RUNTIME_DIR": str(runtime), "PYTHONPATH": str(ROOT)}
        others = "DBUS_SESSION_BUS_ADDRESS", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "NOTIFY_SOCKET"
        self._environment = {k: v for k, v in os.environ.items() if k not in others} | mine
        join = " && ".join(f"echo $$ > '{group}/cgroup.procs'" for group in groups)
        booted = "mount -t tmpfs none /run/systemd && mkdir /run/systemd/system"  # it asks whether systemd has
        spaces = ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--user", "--map-root-user"])]
        self._command = [*spaces, "sh", "-c", f"{join} && {booted} && exec {_SYSTEMD} --user"]

    @contextmanager
    def running(self) -> Iterator[None]:
        """Run it."""
        quiet = subprocess.DEVNULL
        with subprocess.Popen(self._command, env=self._environment, stdout=quiet, stderr=quiet) as process:
            try:
                self.until(lambda: self._ctl("show", "--value", "-p", "SystemState").stdout.strip() == "running", 10.0)
                yield
            finally:
                process.terminate()  # it ends what it runs

    def _run(self, command: list[str]) -> subprocess.CompletedProcess[str]:
        options = {"capture_output": True, "text": True, "timeout": 120, "check": False}
        return subprocess.run(command, env=self._environment, cwd=self.folder, **options)  # type: ignore[call-overload, no-any-return]

    def _ctl(self, *words: str) -> subprocess.CompletedProcess[str]:
        return self._run(["systemctl", "--user", *words])

    def ask(self, what: str, *words: str) -> int:
        """Have something done to the unit; return the exit code."""
        return self._ctl(what, *words, self.unit).returncode

    def install(self, site: Path) -> str:
        """Have the unit written, with shorter times; return its text."""
        self._run([sys.executable, "-c", _CODE, "install-service", "--user", str(site)]).check_returncode()
        [unit] = (self.folder / ".config" / "systemd" / "user").glob("modalwatch-*.service")
        self.unit = unit.name
        shorter = f"[Service]\nRestartSec={_AGAIN}\nWatchdogSec={_WATCHDOG}\n"
        (unit.parent / f"{unit.name}.d").mkdir()
        (unit.parent / f"{unit.name}.d" / "shorter.conf").write_text(shorter, encoding="utf-8")
        self._ctl("daemon-reload").check_returncode()
        return unit.read_text(encoding="utf-8")

    def shows(self, *names: str) -> tuple[str, ...]:
        """Return the manager's properties of the unit."""
        return tuple(self._ctl("show", "--value", "-p", name, self.unit).stdout.strip() for name in names)

    def until(self, done: Callable[[], bool], seconds: float = 60.0) -> float:
        """Wait for something; return how long that took [s]."""
        begun = time.monotonic()
        while not done():
            if time.monotonic() > begun + seconds:
                raise SystemExit(self._ctl("status", "--no-pager", "--full", self.unit).stdout or "no manager runs")
            time.sleep(0.1)
        return time.monotonic() - begun


def checks(manager: Manager, site: Path) -> Iterator[tuple[str, str, bool]]:
    """Yield each check, its result, and whether it is right."""

    def active() -> bool:
        return manager.shows("ActiveState") == ("active",)

    kept = re.search(r"WatchdogSec=\d+", manager.install(site)) is not None
    begun = time.monotonic()
    code = manager.ask("start")
    yield "start returns after READY=1", f"{time.monotonic() - begun:.1f} s", code == 0 and active() and kept
    manager.until(lambda: manager.shows("StatusText") == ("no window yet; 1 of 1 devices",))
    yield "its status in a line", manager.shows("StatusText")[0], True
    before = manager.shows("MainPID", "NRestarts")
    time.sleep(2 * _WATCHDOG)
    fed = manager.shows("MainPID", "NRestarts") == before
    yield f"it feeds a watchdog of {_WATCHDOG:g} s", f"lives after {2 * _WATCHDOG:g} s", fed
    yield "reload", "", manager.ask("reload") == 0 and active()
    for number, (signal, what) in enumerate((("KILL", "killed (-9)"), ("STOP", "stopped, so that it feeds none")), 1):
        manager.ask("kill", f"--signal={signal}", "--kill-whom=main")
        gone = manager.until(lambda number=number: manager.shows("NRestarts") == (str(number),))  # type: ignore[misc]
        back = manager.until(active)
        yield f"{what}: started again", f"after {gone:.1f} s, ready {back:.1f} s later", True
    begun = time.monotonic()
    manager.ask("stop")
    label = manager.shows("ActiveState", "Result", "ExecMainStatus")
    seen = f"{', '.join(label)}; {time.monotonic() - begun:.1f} s"
    yield "stop ends it with 0", seen, label == ("inactive", "success", "0")
    stated = [event.topic for path in sorted((site.parent / "log").glob("*.mcap")) for event in read_events(path)]
    count = stated.count("/event/unclean_end")
    yield "unclean ends that its logs name", str(count), count == 2 and stated[-1] == "/event/stopped"
    site.write_text("nothing = 1\n", encoding="utf-8")
    manager.ask("start")
    time.sleep(4 * _AGAIN)
    label = manager.shows("ActiveState", "ExecMainStatus", "NRestarts")
    yield "wrong settings are not tried again", ", ".join(label), label == ("failed", "2", "0")


def main() -> None:
    """Run it, print a row a check; end with 1 if one fails."""
    well = True
    now = time.time_ns()
    with (
        tempfile.TemporaryDirectory() as name,
        script_process(ROOT / "tests" / "support" / "daq" / "emulated_ports.py", 1, 1, now, now) as (_, ports),
        control_group() as groups,
    ):
        folder = Path(name)
        (folder / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
        (folder / "site.toml").write_text(_SITE.format(ports.strip().strip('["]')), encoding="utf-8")
        manager = Manager(folder, groups)
        print("| what | seen | |\n| --- | --- | --- |")
        with manager.running():
            for what, seen, right in checks(manager, folder / "site.toml"):
                print(f"| {what} | {seen} | {'ok' if right else 'FAIL'} |", flush=True)
                well &= right
    sys.exit(not well)


if __name__ == "__main__":
    main()
