"""Memory of the live view over days of monitoring: its real process, fed as fast as it takes.

    python benchmarks/monitor/view_memory.py LOG.. [--windows 1000] [--client]

The watched windows of a run's log and their signals are shown again and again, each time later. With `--client`, two of
rerun's own read results and signals all the while. Prints the lowest memory in each tenth of the windows.
"""

import argparse
import math
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path

import psutil

from benchmarks.monitor.soak.run import free_port
from daq import AnyLog, Block, Item, read_attachments, read_log
from monitor.cli.logs.run_log import one_log
from monitor.results.windows import ReferenceResult, WindowResult, event_result, result_event
from monitor.service.servers.live_view import LiveView, live_urls, live_view
from monitor.settings import parse_settings

_MEMORY_MB = 4  # the least
_PARTS = 10
_MAX_WAITING = 200  # items
Shown = tuple[Item, bool]  #: an item, and whether it is a window


def played(log: AnyLog) -> Iterator[Shown]:
    """Yield a log's reference and then, for ever, its watched windows and their blocks, later each time."""
    items = list(read_log(log))
    results = {id(item): event_result(item) for item in items if not isinstance(item, Block)}
    reference = next(r for r in results.values() if isinstance(r, ReferenceResult))
    yield result_event(reference), False
    watched = [item for item in items if isinstance(item, Block) or isinstance(results[id(item)], WindowResult)]
    blocks = [item for item in items if isinstance(item, Block)]
    last = {b.device: b.end_index for b in blocks}
    span = max(b.arrival_time for b in blocks) - min(b.arrival_time for b in blocks)
    for turn in count():
        for item in watched:
            if isinstance(item, Block):
                shift, by = turn * last[item.device], turn * span
                yield (
                    replace(
                        item,
                        first_index=item.first_index + shift,
                        arrival_index=item.arrival_index + shift,
                        arrival_time=item.arrival_time + by,
                    ),
                    False,
                )
                continue
            window = results[id(item)]
            if isinstance(window, WindowResult) and window.phase != "learning":
                by = turn * span
                later = window.model_copy(update={"start": window.start + by, "end": window.end + by})
                yield result_event(later), True


@contextmanager
def client(url: str) -> Iterator[psutil.Process]:
    """Run rerun's own client, which reads the served data and discards them."""
    rerun = shutil.which("rerun", path=str(Path(sys.executable).parent))
    port = int(url.rpartition(":")[2].partition("/")[0])
    while socket.socket().connect_ex(("127.0.0.1", port)):
        time.sleep(0.1)
    command = [str(rerun), "--bind", "127.0.0.1", "--port", str(free_port()), "--save", "/dev/null", url]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
        yield psutil.Process(running.pid)
        running.kill()


def show(live: LiveView, item: Item) -> None:
    """Show an item once there is room for it."""
    while live.waiting > _MAX_WAITING:
        time.sleep(0.002)
    live.show(item)


def site(text: str, port: int) -> str:
    """Return a site's settings with the smallest live view, on a port."""
    without = re.sub(r"(?m)^\[viewer\]\n(?:[^\[\n].*\n|\n)*", "", text)
    return f"{without}\n[viewer]\nport = {port}\nmemory_mb = {_MEMORY_MB}\n"


def main() -> None:
    """Read the arguments, show, and print the resources of the process."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="+", help="files of a run that has learned its reference")
    parser.add_argument("--windows", type=int, default=1000)
    parser.add_argument("--client", action="store_true")
    asked = parser.parse_args()
    log = one_log(asked.log)
    attached, port = read_attachments(log), free_port()
    text = site(attached["site.toml"], port)
    lows = [math.inf] * _PARTS
    with ExitStack() as stack:
        live = stack.enter_context(live_view(parse_settings(text), attached["structure.toml"], text))
        clients = [stack.enter_context(client(url)) for url in live_urls(port) if asked.client]
        shown, process = 0, psutil.Process(live.pid)
        for item, is_window in played(log):
            show(live, item)
            if is_window:
                part = shown * _PARTS // asked.windows
                lows[part] = min(lows[part], process.memory_info().rss / 1e6)
                shown += 1
            if shown == asked.windows:
                break
        seconds = sum(process.cpu_times()[:2])
        read = [sum(sum(one.cpu_times()[:2]) for one in (each, *each.children())) for each in clients]
    print(f"{asked.windows} windows{', clients' * asked.client}: {', '.join(f'{low:.1f}' for low in lows)} MB")
    if read:
        print(f"the clients took {' and '.join(f'{each:.1f}' for each in read)} s of processor")
    print(
        f"{1000 * seconds / asked.windows:.0f} ms of processor a window; {live.dropped} items dropped; {live.problem}"
    )


if __name__ == "__main__":
    main()
