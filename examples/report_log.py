"""What a log says: the verdict, the answer beside the truth, and a report of one page."""

import tempfile
import tomllib
from pathlib import Path

from monitor.text.verdicts import headline
from monitor.views.report import run_report
from monitor.views.run import load_run

folder = Path(__file__).parents[1] / "replay_data"
run = load_run(folder / "t_frame_added_mass.mcap")
verdict = headline(run.results, None)
print(verdict)

answer = run.results.answers[-1][1]  # of the last window
truth = tomllib.loads((folder / "manifest.toml").read_text(encoding="utf-8"))["log"][0]
print(f"{1000 * answer.mass:.0f} ± {1000 * answer.mass_std:.0f} g; the rig had added {1000 * truth['mass']:.0f} g")
print(f"x = {answer.position[0]:.3f} ± {answer.position_std:.3f} m; the rig had chosen {truth['position'][0]:.3f} m")

with tempfile.TemporaryDirectory() as out:
    page = Path(out) / "report.html"
    run_report(run, page)  # modalwatch report replay_data -o report.html
    report = page.read_text(encoding="utf-8")
