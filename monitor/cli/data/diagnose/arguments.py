"""Arguments of `diagnose`: logs, known masses, bounds, efforts, and the structure with the parameters to update."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import get_args

import numpy as np

from daq import AnyLog
from daq.log import as_logs
from monitor.analysis.modal_table.table import is_table
from monitor.analysis.modal_table.universal import is_universal
from monitor.analysis.selection import Selection
from monitor.analysis.time_range import WHOLE, TimeRange
from monitor.cli.data.diagnose.held_out import check_independent
from monitor.errors import ArgumentError, State
from updater import ModelError, Structure, build_model, load_structure
from updater.diagnosis import allowed_causes
from updater.errors import SelectionError
from updater.modal_data import Effort


@dataclass(frozen=True)
class MassLog:
    """Log of the present state with a known mass."""

    path: Path
    mass: float  #: [kg]
    position: tuple[float, float, float]  #: [m]

    @classmethod
    def of(cls, text: str) -> "MassLog":
        """Return what is written as `with_mass.mcap=0.1@0.3,0,1.48`.

        Raises
        ------
        ArgumentError
            If the text is not written like that.
        """
        path, _, rest = text.rpartition("=")
        mass, _, place = rest.partition("@")
        try:
            kilograms, (x, y, z) = float(mass), map(float, place.split(","))
        except ValueError:
            kilograms = 0.0
        if not path or not 0 < kilograms < math.inf or not all(map(math.isfinite, (x, y, z))):
            raise ArgumentError(
                "--known-mass", f"expected LOG=KG@X,Y,Z, such as with_mass.mcap=0.1@0.3,0,1.48, found {text!r}"
            )
        return cls(Path(path), kilograms, (x, y, z))

    def check_place(self, structure: Structure) -> None:
        """Refuse a place that is on no member.

        Raises
        ------
        ArgumentError
            Naming the point.
        """
        try:
            build_model(structure).read(np.array(self.position))
        except ModelError as error:
            raise ArgumentError("--known-mass", str(error)) from error


@dataclass(frozen=True, kw_only=True)
class Logs:
    """Logs of a diagnosis, as given on the command line."""

    current: Sequence[Path]
    reference: Sequence[Path] = ()
    heldout: Sequence[Path] = ()
    mass: Sequence[MassLog] = ()
    within: TimeRange = WHOLE  #: range of the current logs
    reference_within: TimeRange = WHOLE
    heldout_within: TimeRange = WHOLE
    exponential_window: float | None = None  #: time constant, of frequency responses [s]

    def of_state(self, state: State) -> Sequence[Path]:
        """Return the logs of a state of the structure."""
        known = {"current": self.current, "reference": self.reference, "heldout": self.heldout}
        return known[state] if state in known else [one.path for one in self.mass]

    def check(self, structure: Structure) -> None:
        """Refuse ranges without logs, masses beside the members, and held-out logs that the fit uses.

        Raises
        ------
        ArgumentError
            Naming the option.
        """
        for known in self.mass:
            known.check_place(structure)
        if not (self.reference or self.reference_within.whole):
            raise ArgumentError(", ".join(self.reference_within.options), "expected --reference LOG, found none")
        if not (self.heldout or self.heldout_within.whole):
            raise ArgumentError(", ".join(self.heldout_within.options), "expected --held-out LOG, found none")
        if self.heldout:
            self._check_independent()

    def check_window(self) -> None:
        """Refuse an exponential window of no length, or of no frequency responses."""
        window, paths = self.exponential_window, [path for state in get_args(State) for path in self.of_state(state)]
        if window is not None and not window > 0:
            raise ArgumentError("--exponential-window", f"expected a positive time in s, found {window:g}")
        if window is not None and not any(map(is_universal, paths)):
            raise ArgumentError("--exponential-window", f"expected frequency responses (.uff, .unv), found {paths[0]}")

    def _check_independent(self) -> None:
        """Refuse held-out logs that are not independent of the fit."""
        fitted: list[AnyLog] = []
        for paths, within in ((self.current, self.within), (self.reference, self.reference_within)):
            if within.whole or not any(map(is_table, paths)):  # else refused as it is read
                fitted += within.of_logs(as_logs(paths))
        if self.heldout_within.whole or not any(map(is_table, self.heldout)):
            check_independent(self.heldout_within.of_logs(as_logs(self.heldout)), fitted)


def selected_structure(path: Path, selection: Selection) -> Structure:
    """Read a structure file and limit the updated parameters.

    Raises
    ------
    ArgumentError
        Naming a parameter that the structure does not have, or an unknown cause.
    """
    try:
        allowed_causes(selection.only, selection.without)
    except SelectionError as error:
        raise ArgumentError("--only, --without", str(error)) from error
    structure = load_structure(path)
    try:
        return selection.of_structure(structure)
    except ValueError as error:
        given = (("--fix", selection.fixed), ("--bound", selection.bounds))
        named = [option for option, values in (*given, ("--without-channel", selection.without_channels)) if values]
        raise ArgumentError(", ".join(named), str(error)) from error


def bound_of(text: str) -> tuple[str, tuple[float, float]]:
    """Return name and bounds of a parameter, written as `steel.E=200e9:215e9`.

    Raises
    ------
    ArgumentError
        If the text is not written like that.
    """
    name, _, limits = text.rpartition("=")
    least, _, greatest = limits.partition(":")
    try:
        values = float(least), float(greatest)
    except ValueError:
        values = 1.0, 0.0
    if not name or not 0 < values[0] < values[1]:
        raise ArgumentError("--bound", f"expected NAME=MIN:MAX, such as steel.E=200e9:215e9, found {text!r}")
    return name, values


def effort_of(texts: Sequence[str]) -> Effort:
    """Return the effort of further measurements, written as `sensor=2` in hours.

    Raises
    ------
    ArgumentError
        If a text is not written like that.
    """
    kinds = tuple(field.name for field in fields(Effort) if field.name != "record")
    given: dict[str, float] = {}
    for text in texts:
        name, _, hours = text.partition("=")
        kind = name.strip().replace("-", "_").replace(" ", "_")
        try:
            given[kind] = float(hours)
        except ValueError:
            given[kind] = -1.0
        if kind not in kinds or not 0 <= given[kind] < math.inf:
            raise ArgumentError("--effort", f"expected KIND=HOURS with one of {', '.join(kinds)}, found {text!r}")
    return Effort(**given)


def names_of(paths: Sequence[Path]) -> str:
    """Return the names of files in a list."""
    return ", ".join(path.name for path in paths)
