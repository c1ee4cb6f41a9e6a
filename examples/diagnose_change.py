"""What has changed in a recorded log: the causes weighed, and what the extended model gains on data it has not seen."""

import tomllib
from pathlib import Path

from daq import load_recordings, read_attachments
from monitor.analysis.explanation import explain
from monitor.analysis.observation import observe
from monitor.text.causes import cause_text
from updater import parse_structure
from updater.quantities import plain

folder = Path(__file__).parents[1] / "replay_data"
truth = tomllib.loads((folder / "manifest.toml").read_text(encoding="utf-8"))["log"][0]
log = folder / truth["file"]
structure = parse_structure(read_attachments(log)["structure.toml"])

recordings = list(load_recordings(log, window_seconds=9))
before = observe(r for r in recordings if r.end <= truth["event_time"])
after = [r for r in recordings if r.start >= truth["event_time"]]

# every other window is held out: the causes are found without it
found = explain(structure, before, observe(after[::2]), heldout=observe(after[1::2]))
diagnosis = found.diagnosis
print(diagnosis.verdict)
for cause in diagnosis.causes:
    print(f"  {cause_text(cause)}, probability {cause.probability:.3f}")
for rejected in diagnosis.rejected:
    print(f"  not {plain(rejected.cause)}: {rejected.why}")
if diagnosis.gain:
    error, likelihood = diagnosis.gain.frequency_error_percent, diagnosis.gain.log_likelihood
    print(f"frequencies of the held-out windows: {error.before:.3f} % off without, {error.after:.3f} % with it")
    print(f"log likelihood of the held-out windows: {likelihood.before:.0f} without, {likelihood.after:.0f} with it")
