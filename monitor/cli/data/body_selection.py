"""Bodies removed or added at known places: tables and JSON."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from monitor.analysis.known_bodies import BodiesResult, select_known_bodies
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.cli.output import write_json
from monitor.cli.terminal import console, echo, new_table, progress
from monitor.text.causes import quantity_text
from monitor.text.quantities import share_text
from updater.quantities import Quantity

_MAX_LISTED = 5  # sets of bodies
_STYLE: dict[str, Any] = {"pad_edge": False}  # of the tables


def identify_bodies(path: Path, json_path: Path | None) -> int:
    """Identify the bodies; return 0 if the answer is sure, 1 if a person must decide."""
    with progress("comparing sets of bodies"):
        result = select_known_bodies(path)
    if json_path:
        write_json(json_path, bodies_json(result))
    echo(_answer_text(result), divide=True)
    for table in (_sets_table(result), _bodies_table(result), _records_table(result)):
        console.print(table)
    found = result.selection
    echo(
        f"scatter between records per mode [%]: {', '.join(f'{100 * s:.2g}' for s in found.scatter)}; "
        f"model error: {100 * found.model_error:.2g} % of a mode's displacement",
        divide=True,
    )
    return DONE if result.verdict in {"explained", "nothing_to_explain"} else NEEDS_A_PERSON


def bodies_json(result: BodiesResult) -> dict[str, Any]:
    """Return the result for other programs."""
    found, content = result.selection, result.content
    names = content.names
    order = np.argsort(-found.probability).tolist()
    best = found.best
    return {
        "verdict": result.verdict,
        "bodies": [
            {
                "name": body.name,
                "change": body.change,
                "probability": float(found.candidate_probability[k]),
                "mass": {"value": abs(float(found.mass[k])), "std": float(found.mass_std[k]), "unit": "kg"}
                if k in best
                else None,
            }
            for k, body in enumerate(content.body)
        ],
        "sets": [
            {"bodies": [names[k] for k in found.sets[row]], "probability": float(found.probability[row])}
            for row in order
        ],
        "records": [
            {
                "name": name,
                "bodies": [names[k] for k in found.sets[int(own.argmax())]],
                "probability": float(own.max()),
                "probability_of_answer": float(own[order[0]]),
            }
            for name, own in zip(content.record_names, found.per_record, strict=True)
        ],
        "scatter": found.scatter.tolist(),
        "model_error": found.model_error,
    }


def _answer_text(result: BodiesResult) -> str:
    found, content = result.selection, result.content
    probability = share_text(float(found.probability.max()))
    records = f"{len(content.record)} record{'s' * (len(content.record) > 1)}"
    changes = [f"{content.names[k]} {content.body[k].change}" for k in found.best]
    best = ", ".join(changes) or "no body taken off or added"
    if result.verdict == "unexplained":
        return (
            f"unexplained: no set of the bodies fits. The nearest is: {best}; it needs a scatter or model error "
            f"{found.excess:.1f} prior standard deviations above the usual one."
        )
    return f"{result.verdict.replace('_', ' ')}: {best} (probability {probability}, {records})"


def _set_text(names: Sequence[str], chosen: Sequence[int]) -> str:
    return escape(", ".join(names[k] for k in chosen) or "none")


def _sets_table(result: BodiesResult) -> Table:
    found, names = result.selection, result.content.names
    table = new_table(("bodies",), ("probability",), title="sets of bodies, all records together", **_STYLE)
    for row in np.argsort(-found.probability)[:_MAX_LISTED].tolist():
        table.add_row(_set_text(names, found.sets[row]), _probability_text(float(found.probability[row])))
    return table


def _bodies_table(result: BodiesResult) -> Table:
    found, content = result.selection, result.content
    table = new_table(("body", "change"), ("probability", "mass"), title="bodies", **_STYLE)
    for k, body in enumerate(content.body):
        mass = Quantity(value=abs(float(found.mass[k])), std=float(found.mass_std[k]), unit="kg")
        table.add_row(
            escape(body.name),
            body.change,
            _probability_text(float(found.candidate_probability[k])),
            quantity_text(mass) if k in found.best else "",
        )
    return table


def _records_table(result: BodiesResult) -> Table:
    found, content = result.selection, result.content
    best = int(np.argmax(found.probability))
    answer = _set_text(content.names, found.best)
    numbers = ("probability", f"probability of {answer}")
    table = new_table(
        ("record", "most probable"), numbers, title="each record alone, with the scatter of all", **_STYLE
    )
    for name, own in zip(content.record_names, found.per_record, strict=True):
        table.add_row(
            escape(name),
            _set_text(content.names, found.sets[int(own.argmax())]),
            _probability_text(float(own.max())),
            _probability_text(float(own[best])),
        )
    return table


def _probability_text(probability: float) -> str:
    """Return a probability in per cent; a small one with its order of magnitude."""
    return share_text(probability) if probability >= 1e-3 else f"{100 * probability:.0e} %"
