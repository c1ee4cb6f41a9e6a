"""The monitor through every fault of a rig's life: nothing lost that was there to be had, memory flat, all of it named.

A real `modalwatch run` - viewer, pages, notices, history - on emulated accelerometers in a separate process, in real
time, with the faults of soak_faults.py once in ten minutes. Afterwards every scan that a device took is looked up in
the logs by its number; a missing one must have been taken during a fault that prevents its recording.

    python benchmarks/monitor/soak/run.py [--minutes 10] [--devices 6] [--keep DIR]

or `make soak`. Exit code 1 if a check fails.
"""

import argparse
import http.server
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path

import httpx
import psutil

from benchmarks.monitor.soak.faults import Spell, by_rig, played, stood_still
from benchmarks.monitor.soak.found import missing, named
from benchmarks.monitor.soak.memory import BLOCKS, HEAP, Series, judged
from benchmarks.monitor.soak.rig import places
from monitor.results.site_status import FILE_NAME, read_status
from updater import t_structure_toml

_HERE = Path(__file__).parent
_RUN = [sys.executable, "-c", "from monitor.cli.main import main; main()", "run"]
_ROTATE = 5.0  # min: a soak has more of its files than a site in a day
_LOOK = 1.0  # s
_WINDOW, _BASELINE = 20.0, 8  # s; windows
_START = 180.0  # s that the monitor may take to start, on a machine that has other work
_VIEWER_MB = 4  # the least: what is kept for viewers that come late is full soon, and then flat
_CHANGED = 110.0  # s before the end: when the structure changes
_END = 0.5  # s before the end: what is on its way then


def free_port() -> int:
    """Return a port that is free, as is the next one."""
    while True:
        with socket.socket() as one, socket.socket() as two:
            one.bind(("127.0.0.1", 0))
            port = int(one.getsockname()[1])
            try:
                two.bind(("127.0.0.1", port + 1))
            except OSError:
                continue
            return port


class Hook(http.server.BaseHTTPRequestHandler):
    """Takes notices."""

    texts: list[str]
    hostile: str

    def do_POST(self) -> None:
        """Keep the received data, or send a hostile reply."""
        if self.hostile == "retry":
            self.send_response(503)
            self.send_header("Retry-After", "Wed, 21 Oct 99999999999 07:28:00 GMT")
            self.end_headers()
            return
        if self.hostile == "trickle":
            self.send_response(200)
            with suppress(OSError):
                for _ in range(600):
                    self.send_header("X-More", "x")
                    self.flush_headers()
                    time.sleep(0.5)
            return
        label = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.texts += [notice["text"] for notice in label["notices"]]
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Print nothing."""


class Life:
    """One process of the monitor, as it was looked at."""

    def __init__(self) -> None:
        self.processes: dict[int, Series] = {}  # by their numbers
        self.held = Series(BLOCKS), Series(HEAP)
        self.cpu = {"monitor": 0.0, "analysis": 0.0, "others": 0.0}  # s
        self.seconds = 0.0

    @property
    def own(self) -> Series:
        """The monitor's own process, which is looked at first."""
        return next(iter(self.processes.values()))


class Soak:
    """A rig and a monitor that go through it."""

    def __init__(self, folder: Path, n: int, seconds: float) -> None:
        self.folder, self._n, self._seconds = folder, n, seconds
        self.viewer_port, self.web_port, self._hook_port = free_port(), free_port(), free_port()
        self.stated: list[str] = []
        self.lives: list[Life] = []
        self._hook: http.server.ThreadingHTTPServer | None = None
        self._rotate = _ROTATE
        self.web_codes: dict[int, int] = {}
        (folder / "t_structure.toml").write_text(structure(n), encoding="utf-8")

    @contextmanager
    def rig(self) -> Iterator[None]:
        """Run the rig."""
        mass_at = max(10.0, self._seconds - _CHANGED)
        command = [sys.executable, str(_HERE / "rig.py"), str(self.folder), str(self._n)]
        command += [str(self._seconds), str(mass_at)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as self._rig:
            assert self._rig.stdout is not None
            assert self._rig.stdin is not None
            if not self._rig.stdout.readline():
                raise SystemExit("the rig did not start")
            self.rig_process = psutil.Process(self._rig.pid)
            yield
            self._rig.stdin.close()
            self._rig.wait(20)

    def tell_rig(self, line: str) -> None:
        """Have the rig do something."""
        assert self._rig.stdin is not None
        self._rig.stdin.write(line + "\n")
        self._rig.stdin.flush()

    def webhook(self, *, up: bool, hostile: str = "") -> None:
        """Let notices be accepted, refused, or answered by a hostile reply: "retry" or "trickle"."""
        if up:
            handler = type("Kept", (Hook,), {"texts": self.stated, "hostile": hostile})
            self._hook = http.server.ThreadingHTTPServer(("127.0.0.1", self._hook_port), handler)
            threading.Thread(target=self._hook.serve_forever, daemon=True).start()
        elif self._hook:
            self._hook.shutdown()
            self._hook.server_close()

    def write_site(self) -> None:
        """Write the settings."""
        lines = ['structure = "t_structure.toml"', "[recorder]", "min_free_gb = 0", f"rotate_minutes = {self._rotate}"]
        lines += ["[analysis]", f"window_seconds = {_WINDOW}", f"baseline_windows = {_BASELINE}"]
        lines += ["[web]", f"port = {self.web_port}", "[viewer]", f"port = {self.viewer_port}"]
        lines += [f"memory_mb = {_VIEWER_MB}", "[[notify]]"]
        lines += [f'webhook = "http://127.0.0.1:{self._hook_port}/"', "max_per_hour = 1000", "timeout_seconds = 3"]
        for name, (_, axes) in places(self._n).items():
            mapped = ", ".join(f'{axis} = "{name}_{axis}"' for axis in axes)
            lines += ["[[device]]", f'name = "{name}"', 'driver = "epson-uart"', f'port = "{self.folder / name}"']
            lines += [f"channels = {{{mapped}}}"]
        (self.folder / "site.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")

    def start_monitor(self) -> None:
        """Start the monitor, and wait until it reports that it has started."""
        path = str(self.folder / "notify")
        Path(path).unlink(missing_ok=True)
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
            heard.bind(path)
            heard.settimeout(_START)
            out = (self.folder / "console.jsonl").open("a", encoding="utf-8")
            environment = os.environ | {"NOTIFY_SOCKET": path}
            command = [*_RUN, str(self.folder / "site.toml"), "--json-log"]
            self._process = subprocess.Popen(command, stdout=out, stderr=out, env=environment)
            try:
                while heard.recv(4096) != b"READY=1":
                    pass
            except TimeoutError:
                raise SystemExit((self.folder / "console.jsonl").read_text(encoding="utf-8")) from None
        Path(path).unlink()
        self.monitor = psutil.Process(self._process.pid)
        self.lives.append(Life())
        self._started = time.monotonic()

    def reload(self, more: str = "") -> None:
        """Have files rotate at another size: a new log, and not a gap; or add text to the file."""
        self._rotate += not more
        self.write_site()
        if more:
            path = self.folder / "site.toml"
            path.write_text(f"{more}\n{path.read_text(encoding='utf-8')}", encoding="utf-8")
        self._process.send_signal(signal.SIGHUP)

    def look(self) -> None:
        """Look at the monitor's processes, and at its page."""
        time.sleep(_LOOK)
        life = self.lives[-1]
        used = dict.fromkeys(life.cpu, 0.0)
        try:
            for process in (self.monitor, *self.monitor.children()):
                looked = life.processes.get(process.pid) or Series(self._role(process))
                used[looked.kind if looked.kind in used else "others"] += _cpu(process)
                if not looked.kind:
                    continue  # it is not known yet by the port that it will serve
                looked.note(time.monotonic() - self._started, process.memory_info().rss / 1e6)
                life.processes[process.pid] = looked
        except psutil.NoSuchProcess:
            return  # it was just killed
        life.seconds = time.monotonic() - self._started
        life.cpu = {name: max(seconds, life.cpu[name]) for name, seconds in used.items()}
        self._look_at_held(life)
        if len(life.own.times) % 10 == 0:
            self._ask()

    def _look_at_held(self, life: Life) -> None:
        """Record the memory that the monitor reports."""
        status = read_status(self.folder / "state" / FILE_NAME)
        if status and status.pid == self.monitor.pid:
            blocks, heap = life.held
            blocks.note(time.monotonic() - self._started, status.memory_use["blocks"] / 1e3)
            heap.note(time.monotonic() - self._started, status.memory_use["heap_bytes"] / 1e6)

    def _role(self, process: psutil.Process) -> str:
        """Return the role of a process of the monitor; empty if it is not known yet."""
        roles = {None: "analysis", self.viewer_port: "view", self.web_port: "pages"}
        if process == self.monitor:
            return "monitor"
        if process.nice() == self.monitor.nice() + 5:
            return roles[None]
        return next((roles[port] for port in _ports(process) if port in roles), "")

    def child(self, nice: int, port: int | None = None) -> psutil.Process:
        """Return a process of the monitor's by its priority, and the port that it serves."""
        for child in self.monitor.children():
            if child.nice() == self.monitor.nice() + nice and (port is None or port in _ports(child)):
                return child
        raise LookupError(f"the monitor has no process of priority +{nice}")

    def _ask(self) -> None:
        try:
            code = httpx.get(f"http://127.0.0.1:{self.web_port}/healthz", timeout=5.0, trust_env=False).status_code
        except httpx.HTTPError:
            code = 0
        self.web_codes[code] = self.web_codes.get(code, 0) + 1

    def metrics(self) -> dict[str, float]:
        """Return the metrics of the monitor."""
        text = httpx.get(f"http://127.0.0.1:{self.web_port}/metrics", timeout=10.0, trust_env=False).text
        pairs = (line.rsplit(" ", 1) for line in text.splitlines() if line.startswith("modalwatch_"))
        return {name: float(value) for name, value in pairs}

    def stop(self) -> int:
        """End the monitor; return its exit code."""
        self._process.terminate()
        return self._process.wait(120)


def _ports(process: psutil.Process) -> set[int]:
    return {c.laddr.port for c in process.net_connections("tcp") if c.status == psutil.CONN_LISTEN}


def _cpu(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def structure(n: int) -> str:
    """Return the T-frame's file with a sensor wherever a device of the rig has an analysed axis."""
    text = t_structure_toml()
    for name, (at, axes) in list(places(n).items())[6:]:
        for axis in axes:
            direction = [int(axis == other) for other in "xyz"]
            text += f'\n[[sensor]]\nchannel = "{name}_{axis}"\nat = {list(at)}\ndirection = {direction}\n'
    return text


def soaked(folder: Path, n: int, seconds: float) -> bool:
    """Run the soak, print the tables; return whether all results are as required."""
    soak = Soak(folder, n, seconds)
    soak.webhook(up=True)
    soak.write_site()
    with soak.rig():
        soak.start_monitor()
        spells = played(soak, seconds, soak.look)
        label = soak.metrics()
        rig_cpu = _cpu(soak.rig_process)
        end = time.time_ns() - int(_END * 1e9)
        code = soak.stop()
    soak.webhook(up=False)
    spells = sorted(spells + by_rig(folder, seconds) + stood_still(folder), key=lambda spell: spell.ended)
    looks = [[asdict(process) for process in life.processes.values()] for life in soak.lives]
    (folder / "looks.json").write_text(json.dumps(looks), encoding="utf-8")
    return report(soak, spells, label, (code, end, rig_cpu), n, seconds)


def report(
    soak: Soak, spells: list[Spell], label: dict[str, float], ended: tuple[int, int, float], n: int, seconds: float
) -> bool:
    """Print the results."""
    code, end, rig_cpu = ended
    print(f"\n{3 * n} channels at 1000 Hz, {2 * n} of them analysed, {seconds / 60:.0f} minutes\n")
    print("| fault | seconds | events in the history |\n| --- | ---: | --- |")
    rows, all_named = named(soak.folder, spells)
    print("\n".join(rows))
    print(
        "\n| device | scans taken | missing | of these unexplained | repeated | lost before the kill [s] |\n"
        "| --- | ---: | ---: | ---: | ---: | ---: |"
    )
    rows, all_there = missing(soak.folder, spells, n, end)
    print("\n".join(rows))
    print(
        "\n| monitor start | seconds | monitor | analysis | view and pages "
        "| RSS of the monitor after one minute [MB] | last |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for number, life in enumerate(soak.lives, 1):
        shares = " | ".join(f"{100 * used / life.seconds:.1f} %" for used in life.cpu.values())
        rss = life.own.values
        print(f"| {number} | {life.seconds:.0f} | {shares} | {rss[min(60, len(rss) - 1)]:.0f} | {rss[-1]:.0f} |")
    rows, flat = judged([*soak.lives[-1].processes.values(), *soak.lives[-1].held])
    if rows:
        print(
            "\n| process | lowest RSS in each ten minutes of the last hour [MB] | slope per hour | limit |\n"
            "| --- | --- | ---: | ---: |"
        )
        print("\n".join(rows))
    for name in ("window", "alarm"):
        late = label.get(f"modalwatch_{name}_latency_seconds")
        print(f"\nlast sample to {name}: {'-' if late is None else f'{late:.2f} s'}", end="")
    print(f"\nnotices taken: {len(soak.stated)}; /healthz answered: {soak.web_codes}; exit code {code}")
    print(f"the rig itself: {100 * rig_cpu / seconds:.0f} % of a core")
    checks = {"nothing missing without a reason": all_there, "every fault named": all_named, "ended with 0": code == 0}
    checks["the mass at the end raised an alarm"] = label.get('modalwatch_state{state="alarm"}') == 1.0
    if flat is not None:
        checks["memory flat in the last hour"] = flat
    for what, well in checks.items():
        print(f"{'ok  ' if well else 'FAIL'} {what}")
    return all(checks.values())


def main() -> None:
    """Read the arguments, soak, and end with 1 if a check fails."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--devices", type=int, default=6, help="of three channels each")
    parser.add_argument("--keep", type=Path, help="folder that keeps what the monitor wrote")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        well = soaked(Path(name), asked.devices, 60 * asked.minutes)
        if asked.keep:
            shutil.copytree(name, asked.keep, symlinks=True, ignore_dangling_symlinks=True)
    sys.exit(not well)


if __name__ == "__main__":
    main()
