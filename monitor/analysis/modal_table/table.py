"""Tables of modes from other programs: CSV, the JSON of `modalwatch identify`, or frequency responses; one per record.

Columns of a table: `frequency` [Hz]; optional `damping` [-], `frequency_std` [Hz], one column per channel with the
shape's component, and `CHANNEL_std`; `temperature` [degC] and `rms` [m/s2] of the record, the same in every row.
Formats of headers and cells: `monitor/analysis/modal_table/csv.py`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from daq import FloatArray, LogError
from monitor.analysis.modal_table.columns import Columns, read_columns
from monitor.analysis.modal_table.universal import UNIVERSAL
from monitor.analysis.observation import Observation
from oma import ComplexArray, ModalEstimate, normalise
from oma.windows import Windows
from updater import Structure, build_model, mean_modes, stack_tracks
from updater.modal_data import choose_tracks, doubles

_SUFFIXES = (".csv", ".json", *UNIVERSAL)
_FREQUENCY_STD = 1e-3  # relative, if a table has none: usual value of minutes of ambient vibration
_SHAPE_STD = 0.02  # of a unit shape's components, where a table states none
_DAMPING = 0.01  # value if a table has none; its deviation marks it as unknown
_MIN_RECORDS = 3  # from which their own scatter is learned
_N_MODES = 30  # of the model, which lends its shapes to a table that has none
_MAX_NAMED = 10  # of the model's frequencies in an error
_FARTHEST = 0.3  # of ln f between a mode and the model's


@dataclass(frozen=True, eq=False, kw_only=True)
class Table:
    """Modes of one record."""

    estimate: ModalEstimate
    shaped: bool  #: whether the shapes were measured; else they are the model's
    temperature: float  #: [degC], NaN if not known
    rms: float  #: [m/s2], NaN if not known


def is_table(path: Path) -> bool:
    """Return whether a file is a modal table, by its name."""
    return path.suffix.lower() in _SUFFIXES


def read_tables(structure: Structure, paths: Sequence[Path], window: float | None = None) -> Observation:
    """Read modal tables of one state, each a record.

    Parameters
    ----------
    structure : with the sensors
    paths : of the tables
    window : time constant of the exponential window of frequency responses [s]. Default: none

    Raises
    ------
    LogError
        Naming file, line and column of invalid values.
    """
    return observation_of([read_table(structure, path, window) for path in paths], paths[0])


def observation_of(tables: Sequence[Table], path: Path | str) -> Observation:
    """Return tables of one state as an observation.

    Parameters
    ----------
    tables : at least one
    path : name of the first one in errors

    Raises
    ------
    LogError
        If they have fewer than three modes in common, or shapes in some tables only.
    """
    estimates = [t.estimate for t in tables]
    if len({t.shaped for t in tables}) > 1:
        raise LogError(path, "expected mode shapes in all tables of one state, or in none")
    _, kept, tracks = choose_tracks(estimates, identified=False)
    if len(kept) < 3:
        raise LogError(path, f"expected at least 3 modes that the tables have in common, found {len(kept)}")
    return Observation(
        windows=Windows(
            estimates=tuple(estimates),
            harmonics=np.empty(0),
            channels=dict.fromkeys(estimates[0].channels, "ok"),
            quality=(),
            problems=(),
            start=0,
            end=0,
            rate=float("nan"),
        ),
        estimates=tuple(estimates),
        tracks=tuple(tracks),
        temperature=np.array([t.temperature for t in tables]),
        rms=np.array([t.rms for t in tables]),
        shaped=tables[0].shaped,
        stated=len(tables) < _MIN_RECORDS,
    )


def read_table(structure: Structure, path: Path, window: float | None = None) -> Table:
    """Read one modal table; parameters and errors as for `read_tables`."""
    return _table(structure, read_columns(path, structure, window), path)


def frequency_table(structure: Structure, frequency: FloatArray, std: FloatArray | None, path: Path | str) -> Table:
    """Return frequencies without shapes as a table; errors as for `read_tables`.

    Parameters
    ----------
    structure : whose shapes are used for pairing
    frequency : (n_modes,) [Hz]
    std : (n_modes,) their standard deviations [Hz]; None: 0.1 %
    path : name of the table in errors
    """
    values = {"frequency": frequency.astype(complex)}
    if std is not None:
        values["frequency_std"] = std.astype(complex)
    columns = Columns(values, list(range(1, len(frequency) + 1)))
    columns.check(path, structure)
    return _table(structure, columns, path)


def _table(structure: Structure, columns: Columns, path: Path | str) -> Table:
    order = np.argsort(columns.values["frequency"])
    values = {name: value[order] for name, value in columns.values.items()}
    frequency = values["frequency"].real
    channels = tuple(c for c in structure.channels if c in values)
    if channels:
        shape = np.column_stack([values[c] for c in channels])
        norm = np.linalg.norm(shape, axis=1, keepdims=True)
        std = np.column_stack([values.get(f"{c}_std", np.full(len(frequency), np.nan)).real for c in channels]) / norm
        std = np.where(np.isfinite(std), std, _SHAPE_STD)
        shape = normalise(shape)
    else:
        channels = structure.channels
        shape = _lent(structure, frequency, path)
        std = np.full(shape.shape, _SHAPE_STD)
    known = "damping" in values
    line = [columns.line[i] for i in order]
    damping = values["damping"].real if known else np.full(len(frequency), _DAMPING)
    estimate = ModalEstimate(
        channels=channels,
        frequency=frequency,
        frequency_std=_or(values.get("frequency_std"), _FREQUENCY_STD * frequency),
        damping=damping,
        damping_std=_or(values.get("damping_std"), (0.3 if known else 1e3) * damping),
        shape=shape,
        shape_std=std,
        support=np.ones(len(frequency)),
        law_ratio=np.ones(len(frequency)),
        start=0,
        end=0,
    )
    _refuse_doubled(path, estimate, line)
    return Table(
        estimate=estimate,
        shaped=any(c in values for c in structure.channels),
        temperature=_one(values.get("temperature")),
        rms=_one(values.get("rms")),
    )


def _refuse_doubled(path: Path | str, estimate: ModalEstimate, line: list[int]) -> None:
    found = doubles(mean_modes(stack_tracks([estimate], [np.arange(estimate.n_modes)])))
    if len(found):
        again, frequency = line[found[0]], estimate.frequency[found[0]]
        raise LogError(path, f"line {again}: the mode at {frequency:.5g} Hz is in the table twice")


def _or(found: ComplexArray | None, usual: FloatArray) -> FloatArray:
    return usual if found is None else np.where(np.isfinite(found.real), found.real, usual)


def _one(found: ComplexArray | None) -> float:
    return float("nan") if found is None else float(np.mean(found.real))


def _lent(structure: Structure, frequency: FloatArray, path: Path | str) -> ComplexArray:
    """Return the shapes (n, n_channels) of the model's modes that are nearest in frequency, one to one."""
    if len(structure.channels) < 2:
        raise LogError(path, f"expected a structure with 2 sensors or more, found {len(structure.channels)}")
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(_N_MODES)
    at = (model.sensor_rows @ modes.shape).T
    seen = np.flatnonzero(np.linalg.norm(at, axis=1) > 1e-9)
    distance = np.abs(np.log(frequency[:, None] / modes.frequency[seen]))
    row, column = linear_sum_assignment(distance**2)  # squares keep the order of close modes
    far = distance[row, column] > _FARTHEST
    if far.any():
        near = ", ".join(f"{f:.4g}" for f in modes.frequency[seen][:_MAX_NAMED])
        raise LogError(
            path,
            f"the mode at {frequency[row[far][0]]:.4g} Hz has no partner in the model by frequency, whose modes are at "
            f"{near} Hz; without shapes there is no telling which is which",
        )
    return normalise(at[seen[column]].astype(complex))
