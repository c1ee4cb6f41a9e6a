"""Modes of the frequency responses of a universal file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from daq import DataError, LogError
from daq.files import FrequencyResponses, Header, read_header, read_responses
from oma import OmaError, ResponseIdentification, identify_responses_all, places_by_name


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedFile:
    """A file of frequency responses and its modes."""

    responses: FrequencyResponses  #: at the places of the shapes
    modes: ResponseIdentification
    header: Header | None  #: dataset 151


def identify_file(
    path: Path,
    sensors: Sequence[str] | None = None,
    band: tuple[float, float] | None = None,
    window: float | None = None,
) -> IdentifiedFile:
    """Identify the modes of the frequency responses of a universal file.

    Shapes are at the outputs, or at the forces if these are more (a hammer that moves, sensors that stay): responses
    are reciprocal. Lines and responses weigh by their coherences, if the file has all of them.

    Parameters
    ----------
    path : of the file
    sensors : names of the sensors of a structure; responses at other places are left out. Default: all are used
    band, window : as for `oma.identify_responses_all`

    Raises
    ------
    LogError
        Naming the file, and what it lacks.
    """
    try:
        read = _at_most_places(read_responses(path, window), sensors)
        if sensors is not None:
            read = _at_sensors(path, read, sensors)
        header = read_header(path)
        known = read.coherence is not None and bool(np.isfinite(read.coherence).all())
        found = identify_responses_all(
            read.frequency,
            read.response,
            read.outputs,
            read.inputs,
            band,
            window,
            coherence=read.coherence if known else None,
        )
    except DataError as error:
        raise LogError(path, str(error).removeprefix(f"{path}: ")) from error
    except OmaError as error:
        raise LogError(path, str(error)) from error
    return IdentifiedFile(responses=read, modes=found, header=header)


def _at_most_places(found: FrequencyResponses, sensors: Sequence[str] | None) -> FrequencyResponses:
    """Return the responses with the shapes' places as outputs."""
    n_outputs, n_inputs = (
        len(names if sensors is None else _signs(names, sensors)) for names in (found.outputs, found.inputs)
    )
    return found.by_reciprocity if n_inputs > n_outputs else found


def _at_sensors(path: Path, found: FrequencyResponses, sensors: Sequence[str]) -> FrequencyResponses:
    """Return the responses at sensors, under their names and in their directions."""
    signs = _signs(found.outputs, sensors)
    if len(signs) < 2:
        have, known = ", ".join(found.outputs), ", ".join(sensors)
        raise LogError(path, f"expected responses at two sensors of the structure or more ({known}), found {have}")
    places = list(signs)
    sign = np.array([signs[k][1] for k in places])
    return replace(
        found,
        response=found.response[:, places] * sign[:, None],
        coherence=None if found.coherence is None else found.coherence[:, places],
        outputs=tuple(signs[k][0] for k in places),
    )


def _signs(names: Sequence[str], sensors: Sequence[str]) -> dict[int, tuple[str, float]]:
    """Return the sensor and the sign of each name that is one: ``12_-z`` is the sensor ``12_z`` turned around."""
    places = places_by_name(list(dict.fromkeys([*sensors, *names])))
    known = {(places[sensor].node, places[sensor].direction): sensor for sensor in sensors}
    found: dict[int, tuple[str, float]] = {}
    for k, name in enumerate(names):
        for sign in (1.0, -1.0):
            x, y, z = places[name].direction
            sensor = known.get((places[name].node, (sign * x, sign * y, sign * z)))
            if sensor and sensor not in {other for other, _ in found.values()}:
                found[k] = sensor, sign
    return found
