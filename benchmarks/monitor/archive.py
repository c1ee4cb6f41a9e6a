"""Reanalysis of an archive: time with one worker and with two, from the first byte and with kept steps.

The logs are the recorded log of the repository, each cut at another byte, so that all differ.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/monitor/archive.py [N_LOGS], or make bench-archive
"""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd

RECORDED = Path(__file__).parents[2] / "replay_data" / "t_frame_added_mass.mcap"
_CUT = 3_200_000  # bytes: ten windows before the change
COMMAND = [sys.executable, "-c", "from monitor.cli.main import main; main()", "reanalyse"]


def run(logs: Path, out: Path, workers: int) -> float:
    """Return the time of a reanalysis [s]."""
    start = time.monotonic()
    subprocess.run([*COMMAND, logs, "-o", out, "--workers", str(workers)], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - start


def main() -> None:
    """Print the table of the documentation."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    with tempfile.TemporaryDirectory() as folder:
        logs, out = Path(folder) / "logs", Path(folder) / "out"
        logs.mkdir()
        whole = RECORDED.read_bytes()
        for k in range(n):
            (logs / f"log{k:03d}.mcap").write_bytes(whole[: _CUT + k])
        print("| run | time | data over time |\n|:--|---:|---:|")
        seconds = 0.0
        for text, workers, fresh in (
            ("one worker", 1, True),
            ("two workers", 2, True),
            ("two workers, all windows identified by an earlier run", 2, False),
        ):
            if fresh:
                shutil.rmtree(out, ignore_errors=True)
            took = run(logs, out, workers)
            seconds = seconds or float(pd.read_parquet(out / "logs").seconds.sum())
            print(f"| {text} | {took:.1f} s | {seconds / took:.0f} |", flush=True)
        print(
            f"\n{n} logs, {seconds / 3600:.1f} h of data, {sum(p.stat().st_size for p in logs.glob('*')) / 1e6:.0f} MB"
        )


if __name__ == "__main__":
    main()
