"""Latency of the status page under attack: half-sent requests stay open while many clients request the page.

    python benchmarks/monitor/web_load.py [--half 1200] [--asked 500] [--threads 32]

The history has 300 windows with eight modes. Every request has a connection of its own. Prints one row per path.
"""

import argparse
import contextlib
import os
import resource
import socket
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import psutil

from daq import SystemClock
from monitor.results.site_status import FILE_NAME
from monitor.service.servers.web import Source, WebServer, web_process
from monitor.service.status import MonitorStatus
from tests.support.monitor.history import HOUR, run_events, sqlite_url, write_years
from tests.support.monitor.service.status import PACE, WELL

PORT = 28_765
_HALF = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "
_WHOLE = "GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n"


def asked(path: str) -> tuple[float, bytes]:
    """Return how long an answer takes [s], and its first line."""
    begin = time.perf_counter()
    with socket.create_connection(("127.0.0.1", PORT), 60.0) as connection:
        connection.sendall(_WHOLE.format(path=path).encode())
        label = b""
        while more := connection.recv(65536):
            label += more
    return time.perf_counter() - begin, label.partition(b"\r\n")[0]


def half_sent(n: int) -> list[socket.socket]:
    """Return connections on which a request has begun and does not end."""
    made = []
    for _ in range(n):
        connection = socket.create_connection(("127.0.0.1", PORT), 60.0)
        connection.sendall(_HALF)
        made.append(connection)
    return made


def cpu_seconds(server: WebServer) -> float:
    """Return the processor time that the server has used [s]."""
    times = psutil.Process(server.process.pid).cpu_times()
    return float(times.user + times.system)


def delay_seconds(server: WebServer) -> float:
    """Return how long the server's event loop has waited for a processor [s]."""
    return int(Path(f"/proc/{server.process.pid}/schedstat").read_text().split()[1]) / 1e9


def row(path: str, answers: list[tuple[float, bytes]]) -> str:
    """Return a line of the table."""
    seconds = np.array([second for second, _ in answers])
    refused = sum(b" 200 " not in line and b" 503 " not in line for _, line in answers)
    return (
        f"| `{path}` | {len(answers)} | {np.median(seconds):.3f} | {np.percentile(seconds, 99):.3f} | "
        f"{seconds.max():.3f} | {refused} |"
    )


def main() -> None:
    """Serve, attack, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--half", type=int, default=1200)
    parser.add_argument("--asked", type=int, default=500)
    parser.add_argument("--threads", type=int, default=32)
    options = parser.parse_args()
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, options.half + 500)), hard))
    with tempfile.TemporaryDirectory() as folder:
        state = Path(folder)
        source = Source(name="bridge", state=state, url=sqlite_url(state))
        write_years(source.url, years=300 / 24 / 365.25, step=HOUR, n_modes=8)
        status = MonitorStatus(state / FILE_NAME, ("left",), PACE, SystemClock())
        for event in run_events():
            status.take(event)
        status.write(*WELL)
        with web_process(source, "127.0.0.1", PORT, None) as server:
            asked("/state")
            alone = [asked("/healthz") for _ in range(20)]
            slow, over = half_sent(options.half), threading.Event()
            health: list[tuple[float, bytes]] = []

            def look() -> None:
                while not over.wait(0.02):
                    health.append(asked("/healthz"))

            looking = threading.Thread(target=look)
            looking.start()
            begin, used, waited = time.perf_counter(), cpu_seconds(server), delay_seconds(server)
            with ThreadPoolExecutor(options.threads) as pool:
                states = list(pool.map(asked, ["/state"] * options.asked))
            whole = time.perf_counter() - begin
            used, waited = cpu_seconds(server) - used, delay_seconds(server) - waited
            over.set()
            looking.join()
            print("| path | asked | median [s] | 99 % [s] | longest [s] | refused |")
            print("| --- | --- | --- | --- | --- | --- |")
            print(row("/healthz", alone).replace("`", "alone: `", 1))
            print(row("/state", states))
            print(row("/healthz", health))
            print(f"{options.half} half-sent requests, {options.asked} x /state within {whole:.1f} s,")
            print(f"in which the server used a processor for {used:.2f} s and waited for one for {waited:.2f} s;")
            print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
            for connection in slow:
                with contextlib.suppress(OSError):
                    connection.close()


if __name__ == "__main__":
    main()
