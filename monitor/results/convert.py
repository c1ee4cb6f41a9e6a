"""Arrays of the analysis put into the plain values of the log."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from daq import FloatArray, IndexArray, Recording
from monitor.results.sensor_geometry import SensorGeometry
from monitor.results.windows import (
    AcceptedShift,
    FlaggedDof,
    IncrementPlace,
    Interval,
    MassAnswer,
    MassIncrements,
    ModeResult,
    OtherPlace,
    ProfilePoint,
    ReferenceMode,
    ReferenceResult,
    Spectrum,
)
from oma import IdentificationError, ModalEstimate, Stabilization
from oma.spectral import singular_values_of_clean
from updater import MassChange, ModalMean, Model, Reference, Structure, build_model
from updater.modal_data import BaselineModes, real_shape
from updater.one_step import IncrementLocation, MassUpdate
from updater.quantities import Vector, vector
from updater.structure import place_name

_SPECTRUM_POINTS = 1024
_TINY = 1e-12  # of a shape of unit norm
_DIRECTIONS: tuple[Literal["x"], Literal["y"], Literal["z"]] = ("x", "y", "z")


def mode_results(
    estimate: ModalEstimate, track: IndexArray, tracks: IndexArray, baseline: BaselineModes | None
) -> list[ModeResult]:
    """Return the tracked modes.

    Parameters
    ----------
    estimate : of a window
    track : (n_modes,) indices into the estimate's modes, or -1, in the order of the baseline's
    tracks : (n_modes,) which tracks these are
    baseline : that frequencies are compared with; None for none
    """
    shape = real_shape(estimate.shape)
    return [
        ModeResult(
            id=int(tracks[row]) + 1,
            frequency=float(estimate.frequency[i]),
            frequency_std=float(estimate.frequency_std[i]),
            damping=float(estimate.damping[i]),
            damping_std=float(estimate.damping_std[i]),
            shape=shape[i].tolist(),
            **(_shift(estimate, int(i), baseline, row) if baseline else {}),
        )
        for row, i in enumerate(track)
        if i >= 0
    ]


def _shift(estimate: ModalEstimate, mode: int, baseline: BaselineModes, row: int) -> dict[str, float]:
    ratio = np.log(estimate.frequency[mode]) - baseline.mean.log_frequency[row]
    std = np.hypot(baseline.scatter.window_std[row], baseline.mean.log_frequency_std[row])
    return {"shift_percent": float(100 * np.expm1(ratio)), "shift_std_percent": float(100 * std)}


def spectrum_result(clean: Recording) -> Spectrum | None:
    """Return the first three singular values of clean signals for a picture, without poles; None of a short window."""
    try:
        frequency, values = singular_values_of_clean(clean, 2 * _SPECTRUM_POINTS)
    except IdentificationError:
        return None
    return Spectrum(
        frequency=frequency.tolist(),
        singular_values=np.round(10 * np.log10(np.maximum(values[:, :3].T, 1e-30)), 2).tolist(),
        pole_frequency=[],
        pole_order=[],
        pole_stable=[],
    )


def with_poles(spectrum: Spectrum, poles: Stabilization) -> Spectrum:
    """Return a picture with the poles of its window."""
    drawn = {
        "pole_frequency": np.round(poles.frequency, 4).tolist(),
        "pole_order": poles.order.tolist(),
        "pole_stable": poles.stable.tolist(),
    }
    return spectrum.model_copy(update=drawn)


def reference_result(
    baseline: BaselineModes,
    reference: Reference | None,
    time: int,
    tracks: IndexArray,
    accepted: Sequence[AcceptedShift] = (),
    geometry: SensorGeometry | None = None,
) -> ReferenceResult:
    """Return the reference with the geometry to draw it, and the changes that were accepted since the baseline.

    Parameters
    ----------
    baseline : its modes, as they are now
    reference : model with these modes; None for a site without one
    time : from when on [ns UTC]
    tracks : (n_modes,) of these modes
    accepted : in order
    geometry : positions of the sensors, drawn without a model
    """
    mean = baseline.mean
    geometry = geometry if mean.has_shapes else None
    modes = _model_modes(reference) if reference else _measured_shapes(mean, geometry)
    if reference:
        calibrated = {p.name: (p.value, p.std) for p in reference.calibration.parameters}
        about = {**_geometry(reference.model), "calibrated": calibrated}
    else:
        about = _channels(mean, geometry)
    return ReferenceResult(
        time=time,
        n_windows=int(mean.n.max()),
        modes=[
            ReferenceMode(
                id=int(track) + 1,
                frequency=float(np.exp(mean.log_frequency[i])),
                frequency_std=float(np.exp(mean.log_frequency[i]) * mean.log_frequency_std[i]),
                damping=float(mean.damping[i]),
                **modes[i],
            )
            for i, track in enumerate(tracks)
        ],
        delays={name: (delay, baseline.delays.std[name]) for name, delay in baseline.delays.seconds.items()},
        delay_wander=baseline.delays.wander,
        accepted=list(accepted),
        **about,
    )


def _channels(mean: ModalMean, geometry: SensorGeometry | None) -> dict[str, Any]:
    """Return the fields of a reference without a model."""
    channels = list(mean.channels) if mean.has_shapes else []
    places: dict[str, Any] = {"nodes": [], "lines": {}, "sensors": {}}
    if geometry:
        lines = {f"line {k}": chain for k, chain in enumerate(geometry.chains, 1)}
        places = {"nodes": geometry.nodes, "lines": lines, "sensors": dict(geometry.sensors)}
    return {"calibrated": {}, "channels": channels, **places}


def _measured_shapes(mean: ModalMean, geometry: SensorGeometry | None) -> list[dict[str, Any]]:
    if not mean.has_shapes:
        return [{} for _ in mean.shape]
    measured = [{"shape": shape.tolist()} for shape in mean.shape]
    if geometry is None:
        return measured
    motion = geometry.displacement(mean.channels, mean.shape).real
    largest = np.maximum(np.abs(motion).max(axis=(1, 2), keepdims=True), _TINY)
    moved = [{"displacement": [vector(u) for u in mode]} for mode in motion / largest]
    return [shape | displacement for shape, displacement in zip(measured, moved, strict=True)]


def _model_modes(reference: Reference) -> list[dict[str, Any]]:
    """Return the fields of each mode that describe the model's."""
    calibration, model = reference.calibration, reference.model
    padded = np.concatenate([reference.shape, np.zeros((1, reference.shape.shape[1]))])
    motion = padded[model.dofs][:, :, calibration.paired]
    motion = motion / np.abs(motion[:, :3]).max(axis=(0, 1))
    return [
        {
            "model_frequency": float(calibration.nominal_frequency[i]),
            "mac": float(calibration.nominal_mac[i]),
            "displacement": [vector(u) for u in motion[:, :3, i]],
            "rotation": [vector(u) for u in motion[:, 3:, i]],
        }
        for i in range(len(calibration.paired))
    ]


def _geometry(model: Model) -> dict[str, Any]:
    lines: dict[str, list[int]] = {}
    for member, (start, end) in zip(model.member_names, model.spans, strict=True):
        lines.setdefault(member, [start]).append(end)
    sensors = {s.channel: (s.at, s.direction) for s in model.structure.corrected_sensors}
    return {"nodes": [vector(p) for p in model.nodes], "lines": lines, "sensors": sensors}


def bare_reference(structure: Structure) -> ReferenceResult:
    """Return a structure as it can be drawn, with nothing learned about it."""
    return ReferenceResult(time=0, n_windows=0, modes=[], calibrated={}, **_geometry(build_model(structure)))


def mass_answer(structure: Structure, change: MassChange, n_windows: int, outlook: str) -> MassAnswer:
    """Return a located mass in the structure's coordinates."""
    at = {member.name: member.point for member in structure.member}
    columns = (change.members, change.position, change.density, change.profile_mass)
    return MassAnswer(
        member=change.member,
        position=vector(at[change.member](change.distance)),
        position_std=change.distance_std,
        mass=change.mass,
        mass_std=change.mass_std,
        region=[
            Interval(member=r.member, start=vector(at[r.member](r.start)), end=vector(at[r.member](r.stop)))
            for r in change.region
        ],
        member_probability=change.member_probability,
        p_value=change.p_value,
        n_windows=n_windows,
        outlook=outlook,
        profile=[
            ProfilePoint(member=m, position=vector(at[m](s)), density=float(d), mass=float(g))
            for m, s, d, g in zip(*columns, strict=True)
        ],
        others=[
            OtherPlace(
                member=a.member,
                position=vector(at[a.member](a.distance)),
                position_std=a.distance_std,
                mass=a.mass,
                mass_std=a.mass_std,
                probability=a.probability,
                joint=_joint(structure, a.members, vector(at[a.member](a.distance))),
            )
            for a in change.alternatives[1:]
        ],
        joint=_joint(structure, change.alternatives[0].members, vector(at[change.member](change.distance))),
    )


def _joint(structure: Structure, members: Sequence[str], position: Vector) -> str:
    """Return the name of the joint or foot that a place [m] on several members is; empty for one on a single member."""
    return place_name(structure, position) if len(members) > 1 else ""


def increment_result(update: MassUpdate, n_windows: int) -> MassIncrements:
    """Return the one-step update's increments, not-a-number as None."""
    return MassIncrements(
        place=_place(update.location) if update.location else None,
        increment=[vector(v) for v in update.increment],
        increment_std=[vector(v) for v in update.increment_std],
        normalised=[_components(v) for v in update.normalised],
        normalised_std=[_components(v) for v in update.normalised_std],
        totals=vector(update.totals),
        totals_std=vector(update.totals_std),
        z_limit=update.z_limit,
        flagged=[FlaggedDof(node=f.node, direction=_DIRECTIONS[f.direction], z=f.z) for f in update.flagged],
        n_windows=n_windows,
    )


def _place(found: IncrementLocation) -> IncrementPlace:
    return IncrementPlace(
        located=found.is_located,
        fits=found.fits,
        member=found.member,
        position=vector(found.position),
        radius=found.radius,
        region=[Interval(member=name, start=vector(a), end=vector(b)) for name, a, b in found.region],
        mass=found.mass,
        p_value=found.p_value,
    )


def _components(values: FloatArray) -> tuple[float | None, float | None, float | None]:
    x, y, z = ((float(v) if np.isfinite(v) else None) for v in values)
    return x, y, z
