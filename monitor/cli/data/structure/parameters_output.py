"""Table of the model parameters that may be updated, with the sensitivity of each natural frequency."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from monitor.cli.terminal import new_table
from monitor.text.causes import change_texts
from updater.quantities import ParameterChange
from updater.reference import ParameterSensitivity

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""))
_N_LISTED = 3  # modes that are named for each parameter; `--json` has all of them
_NEGLIGIBLE = 5e-5  # relative change of a frequency that is not listed
SENSITIVITY_NOTE = (
    "change: relative change of the frequency if the parameter moves from the file's value to the one in the third "
    "column, by one prior standard deviation. A, J, Iy and Iz of sections and masses are fitted only without reference "
    "logs. To limit the updating: fixed and bounds under \\[updating] in the file."
)


def parameter_table(found: Sequence[ParameterSensitivity]) -> Table:
    """Return one row per parameter with the modes that it changes most."""
    table = new_table(("parameter",), ("file", "moved to"), no_wrap=True, title="parameters that may be updated")
    table.add_column("mode: change [%]")
    for one in found:
        table.add_row(escape(one.name), with_unit(one.nominal, one.unit), with_unit(one.step, one.unit), _largest(one))
    return table


def _largest(one: ParameterSensitivity) -> str:
    """Return the numbers of the modes that change most, with their changes."""
    order = np.argsort(-np.abs(one.change).round(6), kind="stable")[:_N_LISTED]
    listed = sorted(int(k) for k in order if abs(one.change[k]) > _NEGLIGIBLE)
    return "  ".join(f"{k + 1}: {100 * one.change[k]:+.2f}" for k in listed) or "none"


def changes_table(changes: Sequence[ParameterChange], title: str) -> Table:
    """Return one row per model parameter: name, value in the file, fitted value, change."""
    table = new_table(title=title, pad_edge=False)
    table.add_column("parameter", no_wrap=True)
    table.add_column("quantity")
    for name in ("file", "fitted"):
        table.add_column(name, justify="right", no_wrap=True)
    for change in changes:
        before, after = change_texts(change)
        quantity = f"{change.quantity}, {change.place}" if change.place else change.quantity
        table.add_row(escape(change.name), escape(quantity), before, after)
    return table


def parameters_json(found: Sequence[ParameterSensitivity]) -> list[dict[str, Any]]:
    """Return the same for other programs; the value of a rigid connection is null."""
    return [
        {
            "name": one.name,
            "unit": one.unit,
            "file": one.nominal if np.isfinite(one.nominal) else None,
            "moved_to": one.step,
            "frequency_change": one.change.tolist(),
        }
        for one in found
    ]


def with_unit(value: float, unit: str) -> str:
    """Return a value to four digits with its unit, such as `660 kN m/rad`; `rigid` for an infinite stiffness."""
    if not np.isfinite(value):
        return "rigid"
    if unit == "-":
        return f"x {value:.4g}"
    prefixes = _PREFIXES[-1:] if unit == "kg" else _PREFIXES
    scale, prefix = next(((s, p) for s, p in prefixes if abs(value) >= s), _PREFIXES[-1])
    return f"{value / scale:.4g} {prefix}{unit}"
