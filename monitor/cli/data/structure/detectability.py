"""Picture of a structure file, and the accuracy of its sensors."""

import re
from pathlib import Path

from rich.markup import escape

from monitor.analysis.channels import ChannelCheck
from monitor.cli.data.structure.parameters_output import SENSITIVITY_NOTE, parameter_table
from monitor.cli.data.structure.structure_output import (
    body_table,
    channel_words,
    clearer_words,
    helper_words,
    modes_table,
    plan_tables,
)
from monitor.cli.terminal import console, progress
from monitor.errors import ArgumentError, drawing
from monitor.views.plots.structure import draw_structure
from oma.preparation import PASS
from updater import ModelError, Record, Structure
from updater.planning import ALIKE, ModeVisibility, Plan, Target, plan
from updater.reference import ParameterSensitivity, parameter_sensitivities

_USUAL_RATE = 1000.0  # Hz
_USUAL_SECONDS = 600.0
USUAL_BAND = (
    f"modes are counted up to {PASS * _USUAL_RATE:g} Hz, as recorded at {_USUAL_RATE:g} Hz; "
    "for another recorder give --highest, or --channels SITE.toml or a log of it"
)
_UNITS = {"kg": ("mass", 1.0), "g": ("mass", 1e-3), "m": ("length", 1.0), "mm": ("length", 1e-3)}


def planned_record(length: float | None, damping: float, given: float | None, check: ChannelCheck | None) -> Record:
    """Return the record that is planned, with modes up to a given frequency [Hz], or the highest of a recorder.

    Its length [s] is as given, or that of the log whose channels are compared.

    Raises
    ------
    ArgumentError
        Naming the option that makes no sense.
    """
    seconds = length if length is not None else (check and check.seconds) or _USUAL_SECONDS
    highest = given if given is not None else check.highest if check else PASS * _USUAL_RATE
    for name, value in (("--record-seconds", seconds), ("--damping", damping), ("--highest", highest)):
        if not value > 0:
            raise ArgumentError(name, f"expected a positive number, found {value:g}")
    if damping >= 1:
        raise ArgumentError("--damping", f"expected a ratio of critical such as 0.005, found {damping:g}")
    return Record(seconds=seconds, damping=damping, highest=highest)


def target_of(mass: str | None, tolerance: str) -> Target | None:
    """Return the target mass, None if there is none."""
    if mass is None:
        return None
    return Target(mass=_measured("--target-mass", mass, "mass"), within=_measured("--tolerance", tolerance, "length"))


def _measured(option: str, text: str, kind: str) -> float:
    """Return a positive quantity with its unit, such as `50g` or `0.05 m`, in SI units.

    Raises
    ------
    ArgumentError
        If it is not.
    """
    units = [unit for unit, (what, _) in _UNITS.items() if what == kind]
    found = re.fullmatch(r"\s*([0-9.]+(?:e-?[0-9]+)?)\s*([a-z]+)\s*", text)
    try:
        value = float(found[1]) * _UNITS[found[2]][1] if found and found[2] in units else 0.0
    except ValueError:
        value = 0.0
    if not value > 0:
        raise ArgumentError(option, f"expected a {kind} in {' or '.join(units)}, such as 50{units[1]}, found {text!r}")
    return value


def list_parameters(structure: Structure, n_modes: int) -> list[ParameterSensitivity]:
    """List the parameters that may be updated with their sensitivities, and return these."""
    with progress("computing sensitivities"):
        _, found = parameter_sensitivities(structure, n_modes)
    console.print(parameter_table(found) if found else "no parameter may be updated")
    if found:
        console.print(SENSITIVITY_NOTE, style="dim")
    return found


def plan_for(sight: ModeVisibility, target: Target | None) -> Plan | None:
    """Return how to find the target.

    Raises
    ------
    ModelError
        If the sensors are too few to find anything.
    """
    if target is None:
        return None
    if sight.outlook is None:
        raise ModelError(sight.too_few)
    with progress("simulating records"):
        return plan(sight.outlook, target)


def draw(sight: ModeVisibility, picture: Path, planned: Plan | None) -> None:
    """Draw the structure."""
    with drawing(picture, "--out"):
        draw_structure(sight, picture, planned)


def print_study(sight: ModeVisibility, planned: Plan | None, check: ChannelCheck | None) -> None:
    """Print modes, detectability, the plan, and the channels of a recorder."""
    _say(sight, planned)
    for words in channel_words(sight.model.structure, check):
        console.print(escape(words))


def _say(sight: ModeVisibility, planned: Plan | None) -> None:
    structure = sight.model.structure
    members = f"{len(structure.member)} member" + "s" * (len(structure.member) != 1)
    console.print(modes_table(sight))
    console.print(
        f"{sight.model.total_mass():.3f} kg; {members}, {sight.model.n_dofs} degrees of freedom, "
        f"{len(structure.sensor)} sensors"
    )
    console.print(
        f"measured: motion at a sensor divided by the largest anywhere; similar: MAC at the sensors above {ALIKE}"
    )
    for words in clearer_words(sight):
        console.print(escape(words))
    if sight.outlook is None:
        console.print(escape(sight.too_few))
        return
    console.print(body_table(sight, sight.outlook))
    console.print(escape(helper_words(sight)))
    for table in plan_tables(planned) if planned else []:
        console.print(table)
