"""File of records with bodies at known places: reading and evaluation.

The file (TOML) names a structure file without the bodies, the bodies, and per record their places and the natural
frequencies before and after the change. Example and keys: docs/howto/data/bodies.md.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from daq import FloatArray, LogError
from daq.bounded_text import parse_toml
from monitor.analysis.modal_table.table import frequency_table, observation_of, read_tables
from monitor.analysis.observation import Observation
from monitor.errors import BodiesError
from updater import Body, ModalDataError, ModelError, PairingError, Structure, learn_reference, load_structure, matched
from updater.diagnosis import Verdict
from updater.localization import BodyRecord, BodySelection, select_bodies

_MASS_STD = 0.1  # of a body's mass, where none is given
_SURE = 0.95  # probability of a set of bodies from which it is the answer
_PLAUSIBLE = 2.0  # prior standard deviations of scatter and model error, beyond which no set of bodies explains

_Positive = Annotated[float, Field(gt=0, lt=1e30)]
_Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class KnownBody(_Entry):
    """A body that may have been taken off or added."""

    name: Annotated[str, Field(min_length=1)]
    mass: _Positive  #: [kg]
    mass_std: _Positive | None = None  #: [kg]; None: a tenth of the mass
    change: Literal["removed", "added"] = "removed"  #: possible change


class KnownRecord(_Entry):
    """Frequencies before and after the change, with the bodies at some places.

    Each state is a list of natural frequencies or the file of a table of modes (CSV, or JSON of `identify`).
    """

    name: str | None = None
    at: tuple[tuple[_Coordinate, _Coordinate, _Coordinate], ...]  #: position of each body, on a member's axis [m]
    before: tuple[_Positive, ...] | str  #: [Hz], or a file
    after: tuple[_Positive, ...] | str  #: [Hz], or a file
    before_std: tuple[_Positive, ...] | None = None  #: [Hz]; None: 0.1 %
    after_std: tuple[_Positive, ...] | None = None  #: [Hz]; None: 0.1 %

    @model_validator(mode="after")
    def _deviations_belong_to_frequencies(self) -> Self:
        for state in ("before", "after"):
            given, std = getattr(self, state), getattr(self, f"{state}_std")
            if std is not None and len(std) != (0 if isinstance(given, str) else len(given)):
                if isinstance(given, str):
                    raise ValueError(f"{state}_std: expected none where `{state}` is a file, found {len(std)}")
                raise ValueError(f"{state}_std: expected one number per frequency of {state}, found {len(std)}")
        return self


class KnownBodies(_Entry):
    """Content of the file."""

    structure: str  #: file of the structure without the bodies, relative to this file
    most: Annotated[int, Field(ge=1)] = 3  #: largest number of bodies that changed
    body: Annotated[tuple[KnownBody, ...], Field(min_length=1)]
    record: Annotated[tuple[KnownRecord, ...], Field(min_length=1)]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(body.name for body in self.body)

    @property
    def record_names(self) -> tuple[str, ...]:
        """Names of the records; their numbers where the file has none."""
        return tuple(record.name or str(number) for number, record in enumerate(self.record, 1))

    @property
    def change(self) -> FloatArray:
        """Change of mass by each body (n_bodies,), negative if it is taken off [kg]."""
        return np.array([-b.mass if b.change == "removed" else b.mass for b in self.body])

    @property
    def change_std(self) -> FloatArray:
        """Standard deviation of that (n_bodies,) [kg]."""
        return np.array([b.mass_std or _MASS_STD * b.mass for b in self.body])

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for name in self.names:
            if self.names.count(name) > 1:
                raise ValueError(f"body: expected names that differ, found {name!r} twice")
        for number, record in enumerate(self.record, 1):
            if len(record.at) != len(self.body):
                raise ValueError(f"record {number}: at: expected {len(self.body)} places, found {len(record.at)}")
        return self


@dataclass(frozen=True, eq=False, kw_only=True)
class BodiesResult:
    """Bodies that changed, with the input."""

    content: KnownBodies
    selection: BodySelection

    @property
    def verdict(self) -> Verdict:
        """Verdict by the probability of the best set, with scatter and model error within their priors."""
        if self.selection.excess > _PLAUSIBLE:
            return "unexplained"
        if self.selection.probability.max() < _SURE:
            return "ambiguous"
        return "explained" if self.selection.best else "nothing_to_explain"


def read_known_bodies(path: Path) -> KnownBodies:
    """Read the file of bodies and records.

    Raises
    ------
    BodiesError
        Naming the file, the field, the expected and the found value.
    """
    try:
        return KnownBodies.model_validate(parse_toml(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise BodiesError(path, f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise BodiesError(
            path, f"cannot be read: expected text in UTF-8, {error.reason} at byte {error.start}"
        ) from error
    except ValidationError as error:
        raise BodiesError(path, _first_text(error)) from error
    except ValueError as error:
        raise BodiesError(path, str(error)) from error


def _first_text(error: ValidationError) -> str:
    """Return field, expectation and finding of the first error; lists are counted from 1."""
    first: dict[str, Any] = dict(error.errors()[0])
    field = ""
    for part in first["loc"]:
        if isinstance(part, int):
            field += f" {part + 1}"
        elif part != "str" and "[" not in part:  # alternatives of `before` and `after`
            field += f": {part}" if field else part
    message = _message(first)
    return f"{field}: {message}" if field else message


def _message(first: dict[str, Any]) -> str:
    """Return expectation and finding of one of pydantic's errors."""
    if first["type"] == "missing":
        return "expected a value, found none"
    if first["type"] == "too_short":
        return f"expected at least {first['ctx']['min_length']}, found {first['ctx']['actual_length']}"
    message = str(first["msg"]).removeprefix("Value error, ").replace("Input should be", "expected")
    return message if first["type"] == "value_error" else f"{message}, found {first['input']!r:.60}"


def select_known_bodies(path: Path) -> BodiesResult:
    """Compare all sets of the bodies of a file by its records.

    Raises
    ------
    BodiesError
        Naming the file, the record and the fault.
    StructureError, LogError
        If a file that it names cannot be used.
    """
    content = read_known_bodies(path)
    bare = load_structure(path.parent / content.structure)
    records = []
    for number, (name, record) in enumerate(zip(content.record_names, content.record, strict=True), 1):
        place = f"{path}: record {number}" + (f" ({name})" if record.name else "")
        try:
            records.append(_record(bare, content, record, path.parent, place))
        except (ModelError, ModalDataError, PairingError) as error:
            raise BodiesError(place, str(error)) from error
    try:
        selection = select_bodies(records, content.change, content.change_std, most=content.most)
    except ValueError as error:
        raise BodiesError(path, str(error)) from error
    return BodiesResult(content=content, selection=selection)


def _record(bare: Structure, content: KnownBodies, record: KnownRecord, folder: Path, place: str) -> BodyRecord:
    """Return a record with its own reference.

    Parameters
    ----------
    bare : the structure without the bodies
    content, record : of the file
    folder : of the file
    place : name of the record in errors
    """
    present = [
        Body(at=at, mass=body.mass)
        for body, at in zip(content.body, record.at, strict=True)
        if body.change == "removed"
    ]
    structure = bare.with_bodies(present)
    before = _observation(structure, record.before, record.before_std, folder, f"{place}: before")
    after = _observation(structure, record.after, record.after_std, folder, f"{place}: after")
    reference = learn_reference(structure, before.estimates, before.tracks, stated=True, shaped=before.shaped)
    event = matched(reference.baseline, reference.mean_of(after.modes))
    return BodyRecord(
        reference=reference,
        event=event if before.shaped and after.shaped else event.without_shapes(),
        position=np.array(record.at, float),
    )


def _observation(
    structure: Structure, given: tuple[float, ...] | str, std: tuple[float, ...] | None, folder: Path, place: str
) -> Observation:
    """Return frequencies or a table of modes as an observation of one state."""
    if isinstance(given, str):
        return read_tables(structure, [folder / given])
    if list(given) != sorted(set(given)):
        raise LogError(place, f"expected ascending frequencies in Hz, found {list(given)}")
    table = frequency_table(structure, np.array(given), None if std is None else np.array(std), place)
    return observation_of([table], place)
