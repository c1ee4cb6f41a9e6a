"""Commissioning of a site with a known mass."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from monitor.cli.logs.run_log import one_log
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.cli.output import write_json
from monitor.cli.terminal import console, echo, new_table, progress
from monitor.errors import ArgumentError
from monitor.results.windows import Result, WindowResult
from monitor.service.replay import replay
from monitor.service.site import Site, load_site
from monitor.settings import attached_structure
from monitor.text.quantities import aligned_numbers, utc
from monitor.watch.commissioning import Proof, ProofError, gather, prove
from monitor.watch.memory import parse_memory, recall


def commission(path: Path, mass: float, at: str, logs: Sequence[Path], json: Path | None) -> int:
    """Report whether an attached mass [kg] was found; return 1 if not."""
    site, place = load_site(path), _place(at)
    structure = attached_structure(site.structure_text)
    with progress("reading") as work:

        def show(result: Result) -> None:
            if isinstance(result, WindowResult):
                work.window(result.end)

        log = one_log(logs) if logs else None
        if log:
            work.windows_of("replaying", [log])
        memory = parse_memory(replay(log, site, show).memory if log else _remembered(site))
        work.stage("diagnosing")
        proof = prove(gather(memory, structure, site.settings), mass, place)
    _say(proof)
    kept = json or _unused(site.state / "proofs", utc(proof.end).replace(":", "").replace(" ", "_"))
    kept.parent.mkdir(parents=True, exist_ok=True)
    write_json(kept, as_json(proof))
    echo(f"kept: {kept}")
    return DONE if proof.passed else NEEDS_A_PERSON


def _unused(folder: Path, name: str) -> Path:
    """Return a path for a proof: a later one of the same windows does not take the place of an earlier one."""
    names = itertools.chain([name], (f"{name}_{k}" for k in itertools.count(2)))
    return next(path for name in names if not (path := folder / f"{name}.json").exists())


def _place(at: str) -> tuple[float, float, float]:
    """Return a point; two numbers are those of a frame in the plane of x and z."""
    try:
        values = [float(value) for value in at.split(",")]
    except ValueError:
        values = []
    if len(values) not in (2, 3):
        raise ArgumentError("--position", f"expected X,Z or X,Y,Z in metres, found {at!r}")
    return values[0], values[1] if len(values) == 3 else 0.0, values[-1]


def _remembered(site: Site) -> str:
    found = recall(site.state, attached_structure(site.structure_text), site.settings)
    if found.text is None:
        raise ProofError(f"the monitor has no baseline: {found.refused or 'it has never run'}")
    return found.text


def _say(proof: Proof) -> None:
    x, y, z = proof.place
    console.print(f"{1000 * proof.mass:.0f} g on the {proof.member} at ({x:.3f}, {y:.3f}, {z:.3f}) m; ", end="")
    console.print(f"{proof.n_windows} windows, {utc(proof.start)} to {utc(proof.end)}; ", end="")
    console.print(f"the alarm was raised {utc(proof.raised)}" if proof.raised is not None else "")
    table = new_table(("", "answer of the monitor", ""))
    for check in proof.checks:
        table.add_row(check.what, escape(check.result), "[green]ok[/]" if check.passed else "[bold red]FAILED[/]")
    console.print(table)
    if proof.scales:
        console.print(_scales(proof))
    console.print("[bold green]proven[/]" if proof.passed else "[bold red]NOT proven[/]")


def _scales(proof: Proof) -> Table:
    table = new_table(right=("mode", "Hz", "modal mass, real over the model's"))
    overall = [proof.modal_mass] if proof.modal_mass else []
    masses = aligned_numbers([*((scale.modal_mass, scale.modal_mass_std) for scale in proof.scales), *overall])
    modes = [(str(scale.mode), f"{scale.frequency:.3f}") for scale in proof.scales]
    for mode, mass in zip([*modes, *[("all", "")] * len(overall)], masses, strict=True):
        table.add_row(*mode, mass)
    return table


def as_json(proof: Proof) -> dict[str, Any]:
    """Return the output for other programs; SI units, shapes mass-normalised [kg^-1/2]."""
    found = proof.found
    return {
        "passed": proof.passed,
        "truth": {"mass": proof.mass, "member": proof.member, "position": proof.place.tolist()},
        "found": {
            "mass": {"value": found.mass, "std": found.mass_std},
            "member": found.member,
            "position": proof.found_place.tolist(),
            "position_std": found.distance_std,
            "p_value": found.p_value,
        },
        "raised": proof.raised,
        "checks": [{"what": c.what, "result": c.result, "passed": c.passed} for c in proof.checks],
        "windows": {"n": proof.n_windows, "start": proof.start, "end": proof.end},
        "modes": [
            {
                "id": s.mode,
                "frequency": s.frequency,
                "modal_mass_over_model": {"value": s.modal_mass, "std": s.modal_mass_std},
                "shape": dict(zip(proof.channels, s.shape.tolist(), strict=True)),
            }
            for s in proof.scales
        ],
    }
