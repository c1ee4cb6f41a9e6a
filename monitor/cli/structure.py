"""`structure`: what a structure file says, drawn, with what its sensors can see."""

from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from monitor.cli.files import write_json
from monitor.errors import ArgumentError
from monitor.sight import ALIKE, Sight, look
from monitor.structure_picture import draw_structure
from updater import ModelError, StructureError, load_structure

console = Console(highlight=False)


def structure_command(path: Path, *, n_modes: int, json_path: Path | None, picture: Path | None) -> int:
    """Draw the structure and list its modes."""
    structure = load_structure(path)
    try:
        sight = look(structure, n_modes)
    except ModelError as error:
        raise StructureError(path, str(error)) from error
    picture = picture or path.with_suffix(".png")
    try:
        draw_structure(sight, picture)
    except (OSError, ValueError) as error:  # matplotlib: ValueError for an ending it does not know
        raise ArgumentError("--out", f"{picture}: cannot be written: {error}".splitlines()[0]) from error
    _say(sight)
    console.print(f"picture: {escape(str(picture))}", soft_wrap=True)
    if json_path:
        write_json(json_path, as_json(sight))
    return 0


def as_json(sight: Sight) -> dict[str, Any]:
    """Return what other programs read; null where no sensor sees a mode."""
    n = len(sight.modes.frequency)
    return {
        "name": sight.model.structure.name,
        "total_mass": sight.model.total_mass(),
        "channels": list(sight.model.structure.channels),
        "frequencies": sight.modes.frequency.tolist(),
        "seen": sight.seen.tolist(),
        "auto_mac": [[None if np.isnan(v) else v for v in row] for row in sight.auto_mac.tolist()],
        "alike": [[k + 1 for k in sight.alike(mode)] for mode in range(n)],
    }


def _say(sight: Sight) -> None:
    structure = sight.model.structure
    table = Table(box=SIMPLE_HEAD, title=escape(structure.name))
    for name in ("mode", "frequency [Hz]", "seen by sensors", "best sensor", "looks to them like"):
        table.add_column(name, justify="right", no_wrap=True)
    for k, frequency in enumerate(sight.modes.frequency):
        best = structure.channels[int(np.argmax(np.abs(sight.at_sensors[k])))] if structure.channels else "-"
        alike = ", ".join(str(other + 1) for other in sight.alike(k))
        seen = f"{100 * sight.seen[k]:.0f} %" if sight.is_seen(k) else "no"
        table.add_row(str(k + 1), f"{frequency:.3f}", seen, escape(best), alike)
    console.print(table)
    console.print(
        f"{sight.model.total_mass():.3f} kg; {len(structure.member)} members, {sight.model.n_dofs} degrees of freedom, "
        f"{len(structure.sensor)} sensors"
    )
    console.print(f"seen: largest motion at a sensor over the largest anywhere; alike: MAC at the sensors over {ALIKE}")
