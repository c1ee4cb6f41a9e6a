"""Record t_frame_added_mass.mcap and say in manifest.toml what happened in it.

Usage: python replay_data/make.py [SEED]

A demo with slow devices and short windows, so that the log stays small: four emulated M-A352 and two M-A552 on a CAN
bus, 500 scans per second on real ptys, logged by the daemon. Signals and events are as recorded; the results are those
of the present analysis, written by `modalwatch replay LOG -o NEW`.
"""

import json
import os
import shutil
import sys
import tempfile
import tomllib
from pathlib import Path

from monitor.cli.demo.demonstration import Plan, demonstrate

HERE = Path(__file__).parent
PLAN = Plan(window=15.0, baseline_windows=8, windows=12, between=(125.0, 130.0), rate=500.0)
MANIFEST = """# What happened in the logs of this folder; written by make.py.

[[log]]
file = "t_frame_added_mass.mcap"
what = "T-frame, four emulated M-A352 and two M-A552 at 500 Hz, ambient forces; a body is added to it"
seed = {seed}
event_time = {time}    # ns UTC
mass = {mass:.4f}    # kg
position = [{x:.4f}, {y:.4f}, {z:.4f}]    # m, where it is fixed to the member's axis
scans_sent = {sent}
scans_dropped = {dropped}
"""


def main() -> int:
    """Record, and keep the log only if nothing was lost."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 2026
    os.environ["MODALWATCH_RECORDER__VIEW_RATE"] = "0"  # half the size; `log expand` makes a view of it
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        demonstrate(out, seed, speed=5.0, plan=PLAN)
        answer = json.loads((out / "answer.json").read_text(encoding="utf-8"))
        if answer["dropped"]:
            print(f"{answer['dropped']} scans were lost: try again on a quieter machine")
            return 1
        truth = answer["truth"]
        x, y, z = truth["position"]
        text = MANIFEST.format(
            seed=seed, time=truth["time"], mass=truth["mass"], x=x, y=y, z=z, sent=answer["sent"], dropped=0
        )
        tomllib.loads(text)
        (HERE / "manifest.toml").write_text(text, encoding="utf-8")
        shutil.copy(next((out / "log").glob("*.mcap")), HERE / "t_frame_added_mass.mcap")
    return 0


if __name__ == "__main__":
    sys.exit(main())
