"""Motion and stresses where there is no sensor, with fatigue, of logs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from daq import LogError, Recording, export_recording
from daq.log import as_logs
from monitor.analysis.explanation import reference_of
from monitor.analysis.observation import without_delays
from monitor.analysis.selection import Selection
from monitor.analysis.states.stationarity import of_one_state
from monitor.analysis.time_range import WHOLE, TimeRange
from monitor.cli.data.log_observation import check_structure_first, observe_logs, sensor_recordings
from monitor.cli.data.response.response_output import say_response
from monitor.cli.options import DONE
from monitor.cli.output import write_json
from monitor.cli.terminal import console, echo, progress
from monitor.errors import ArgumentError
from monitor.results.response import Motion, ResponseFound, SectionStress, SensorError
from monitor.text.quantities import utc
from updater import ModalDataError, ModelError, Structure, UpdaterError, load_structure
from updater.quantities import Quantity, Vector, vector
from updater.validation import (
    Fibre,
    MotionQuantity,
    Place,
    Point,
    PredictedSensors,
    ResponseEstimate,
    ResponseModel,
    count_cycles,
    damage_rate,
    edge_fibres,
    learn_predictors,
)

_AXES: tuple[Literal["x"], Literal["y"], Literal["z"]] = ("x", "y", "z")
_WINDOW = 600.0  # s that are in memory at a time
_YEAR = 365.25 * 86400  # s
_SPARSE = 4  # times the length of the windows, that a file with all of them may have


@dataclass(frozen=True, kw_only=True)
class Request:
    """Response to be estimated, as given on the command line."""

    structure: Path
    logs: Sequence[Path]
    reference: Sequence[Path]
    points: Sequence[str]  #: MEMBER:DISTANCE:AXIS[:QUANTITY]
    sections: Sequence[str]  #: MEMBER:DISTANCE
    sensors: bool  #: whether each sensor is predicted from those at other places
    category: float  #: detail category [Pa]
    window: float | None  #: of the reference [s]
    within: TimeRange  #: of the logs


def estimate_response(request: Request, out: Path | None, json: Path | None) -> int:
    """Estimate, print and write the response of logs; 0 as there is no verdict."""
    check_structure_first(request.structure, request.logs)
    structure = load_structure(request.structure)
    points = [_point(structure, text) for text in request.points]
    sections = [_section(structure, text) for text in request.sections]
    places: list[Place] = [*points, *(fibre for section in sections for fibre in section)]
    with progress("reading") as work:
        before = observe_logs(structure, request.reference, request.window, "reference", work, Selection(), WHOLE)
        before, _ = of_one_state(before)
        work.stage("learning the excitation")
        try:
            if before.sample is None:
                raise ModalDataError("expected logs, found tables of modes")
            model = ResponseModel.learn(reference_of(structure, before), before.sample)
            predictors = learn_predictors(model.reference, before.sample) if request.sensors else ()
        except UpdaterError as error:
            raise LogError(", ".join(map(str, request.reference)), str(error)) from error
        logs = request.within.of_logs(as_logs(request.logs), echo)
        work.windows_of("logs", logs)
        removed, problem = model.reference.delays.seconds, "there are no data"
        estimates: list[ResponseEstimate] = []
        predicted: list[list[PredictedSensors]] = []
        for recording in sensor_recordings(structure, logs, _WINDOW, ()):
            work.window(recording.start)
            try:
                signals = without_delays(recording, removed, structure.delays)
                estimate = model.estimate(signals, places)
                predicted.append([predictor.predict(signals) for predictor in predictors])
                estimates.append(estimate)
            except ModalDataError as error:
                problem = str(error)
                echo(f"{utc(recording.start)}: left out: {problem}")
        if not estimates:
            raise LogError(", ".join(map(str, request.logs)), f"no window can be estimated: {problem}")
        recordings = [_all_signals(*pair) for pair in zip(estimates, predicted, strict=True)]
        joined = _joined(recordings) if out else None
        work.stage("counting cycles")
        found = ResponseFound(
            band=model.band,
            level=float(np.sqrt(np.mean([estimate.level**2 for estimate in estimates]))),
            seconds=sum(float(np.isfinite(one.data[:, 0]).sum()) / one.rate for one in recordings),
            motions=[_motion(estimates, i) for i in range(len(points))],
            sections=[_section_stress(estimates, places.index(own[0]), own, request.category) for own in sections],
            sensors=[_sensor_error(own, i) for own in zip(*predicted, strict=True) for i in range(len(own[0].std))],
        )
    say_response(console, found)
    if out and joined:
        export_recording(out, joined)
        echo(f"written: {out}: {len(joined.channels)} signals in m, m/s, m/s2 and Pa")
    if json:
        write_json(json, found.model_dump(mode="json"))
    return DONE


def _point(structure: Structure, text: str) -> Point:
    quantities: dict[str, MotionQuantity] = {name: name for name in get_args(MotionQuantity)}
    parts = text.split(":")
    if len(parts) == 3:
        parts.append("acceleration")
    if len(parts) != 4 or parts[2] not in _AXES or parts[3] not in quantities:
        raise ArgumentError("--at", f"expected MEMBER:DISTANCE:AXIS[:{'|'.join(quantities)}], found {text!r}")
    member, distance, axis, quantity = parts
    at = _member_place(structure, "--at", member, distance)
    return Point(at=at, axis=_AXES.index(axis), quantity=quantities[quantity])


def _section(structure: Structure, text: str) -> tuple[Fibre, ...]:
    member, _, distance = text.partition(":")
    _member_place(structure, "--stress", member, distance)
    try:
        return edge_fibres(structure, member, float(distance))
    except ModelError as error:
        raise ArgumentError("--stress", str(error)) from error


def _member_place(structure: Structure, option: str, member: str, distance: str) -> Vector:
    """Return the point at a distance from the start of a member [m]."""
    members = {known.name: known for known in structure.member}
    if member not in members:
        raise ArgumentError(option, f"no member is named {member!r}; there are {', '.join(members)}")
    try:
        along = float(distance)
    except ValueError:
        along = math.nan
    length = members[member].length
    if not 0 <= along <= length:
        raise ArgumentError(option, f"{member}: expected a distance of 0 to {length:g} m, found {distance!r}")
    return vector(members[member].point(along))


def _motion(estimates: Sequence[ResponseEstimate], i: int) -> Motion:
    """Return the size of a signal at a point."""
    point = estimates[0].points[i]
    assert isinstance(point, Point)
    rms, std, largest = _size(estimates, i)
    unit = {"acceleration": "m/s2", "velocity": "m/s", "displacement": "m"}[point.quantity]
    return Motion(
        position=point.at,
        axis=_AXES[point.axis],
        quantity=point.quantity,
        rms=Quantity(value=rms, std=std, unit=unit),
        largest=largest,
    )


def _section_stress(
    estimates: Sequence[ResponseEstimate], first: int, fibres: Sequence[Fibre], category: float
) -> SectionStress:
    """Return the stress of the fibre of a section with the largest damage, or the largest equivalent range."""
    cycles = [
        reduce(add, (count_cycles(e.recording.data[:, first + k], e.recording.rate) for e in estimates))
        for k in range(len(fibres))
    ]
    k = max(range(len(fibres)), key=lambda k: (damage_rate(cycles[k], category), cycles[k].equivalent_range()))
    fibre, own = fibres[k], cycles[k]
    rms, std, _ = _size(estimates, first + k)
    relative = std / rms if rms else 0.0
    return SectionStress(
        member=fibre.member,
        distance=fibre.distance,
        fibre=(fibre.y, fibre.z),
        rms=Quantity(value=rms, std=std, unit="Pa"),
        equivalent_range=Quantity(value=own.equivalent_range(), std=relative * own.equivalent_range(), unit="Pa"),
        largest_range=own.largest,
        cycles_per_hour=3600 * own.rate,
        category=category,
        damage_per_year=_YEAR * damage_rate(own, category),
        damage_per_year_range=(
            _YEAR * damage_rate(own, category, 1 - relative),
            _YEAR * damage_rate(own, category, 1 + relative),
        ),
    )


def _size(estimates: Sequence[ResponseEstimate], i: int) -> tuple[float, float, float]:
    """Return root mean square, standard deviation and largest absolute value of a signal."""
    signal = np.concatenate([estimate.recording.data[:, i] for estimate in estimates])
    signal = signal[np.isfinite(signal)]
    std = np.sqrt(np.mean([estimate.std[i] ** 2 for estimate in estimates]))
    return float(np.sqrt(np.mean(signal**2))), float(std), float(np.abs(signal).max())


def _sensor_error(windows: Sequence[PredictedSensors], i: int) -> SensorError:
    """Return the error of the prediction of a sensor, where both signals have settled after gaps."""
    measured, found = (
        np.concatenate([(own.measured.data if which else own.predicted)[:, i] for own in windows]) for which in (1, 0)
    )
    settled = np.isfinite(found) & np.isfinite(measured)
    measured, error = measured[settled], (found - measured)[settled]
    std = float(np.sqrt(np.mean([own.std[i] ** 2 for own in windows])))
    return SensorError(
        channel=windows[0].measured.channels[i].name,
        rms=float(np.sqrt(np.mean(measured**2))),
        error=float(np.sqrt(np.mean(error**2))),
        std=std,
        within_two=float(np.mean(np.abs(error) < 2 * std)),
    )


def _all_signals(estimate: ResponseEstimate, predicted: Sequence[PredictedSensors]) -> Recording:
    """Return the estimated signals of a window, then those of the sensors, measured and predicted."""
    channels, data = [*estimate.recording.channels], [estimate.recording.data]
    for own in predicted:
        channels += own.measured.channels
        channels += [replace(channel, name=f"{channel.name} predicted") for channel in own.measured.channels]
        data += [own.measured.data, own.predicted]
    return replace(estimate.recording, channels=tuple(channels), data=np.hstack(data))


def _joined(recordings: Sequence[Recording]) -> Recording:
    """Return the signals of all windows in one recording, NaN between them."""
    first = min(recordings, key=lambda one: one.start)
    at = [round((one.start - first.start) * 1e-9 * first.rate) for one in recordings]
    n = max(start + len(one.data) for start, one in zip(at, recordings, strict=True))
    if n > _SPARSE * sum(len(one.data) for one in recordings):
        raise ArgumentError("--out", "the logs are far apart: give them one by one")
    data = np.full((n, len(first.channels)), np.nan)
    for start, one in zip(at, recordings, strict=True):
        data[start : start + len(one.data)] = one.data
    return replace(first, data=data)
