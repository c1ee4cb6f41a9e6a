"""Modes of the frequency responses of a universal file."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from daq import DataError, LogError
from daq.files import FrequencyResponses, read_responses
from oma import OmaError, ResponseIdentification, identify_responses_all, places_by_name

UNIVERSAL = (".uff", ".unv")  #: endings of universal files


def is_universal(path: Path) -> bool:
    """Return whether a file is a universal one, by its name."""
    return path.suffix.lower() in UNIVERSAL


def identify_file(
    path: Path,
    sensors: Sequence[str] | None = None,
    band: tuple[float, float] | None = None,
    window: float | None = None,
) -> ResponseIdentification:
    """Identify the modes of the frequency responses of a universal file.

    Shapes are at the outputs, or at the forces if these are more (a hammer that moves, sensors that stay): responses
    are reciprocal.

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
        found = _at_most_places(read_responses(path), sensors)
        if sensors is not None:
            found = _at_sensors(path, found, sensors)
        return identify_responses_all(found.frequency, found.response, found.outputs, found.inputs, band, window)
    except DataError as error:
        raise LogError(path, str(error).removeprefix(f"{path}: ")) from error
    except OmaError as error:
        raise LogError(path, str(error)) from error


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
