"""A bracket of 5 cm is diagnosed as a frame of 1.5 m is: no length is taken for usual on every structure."""

import numpy as np
import pytest

from oma import ModalEstimate
from tests.support.updater.reference_frame import measure
from updater import (
    Body,
    Structure,
    build_model,
    calibrate,
    diagnose,
    learn_reference,
    matched,
    mean_modes,
    parse_structure,
    stack_tracks,
)
from updater.causes import propose_added_mass
from updater.inference import compare, fit

TRACK = np.arange(8)


def bracket(youngs_modulus: float, density: float, elements: int, axes: str = "xyz") -> Structure:
    """Upright of 40 mm and arm of 30 mm, of 3 mm by 2 mm aluminium."""
    places = [(0.0, 0.0, z) for z in (0.015, 0.03, 0.04)] + [(x, 0.0, 0.04) for x in (0.015, 0.03)]
    direction = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
    sensors = "".join(
        f'[[sensor]]\nchannel = "{axis}{i}"\nat = {list(at)}\ndirection = {direction[axis]}\n'
        for i, at in enumerate(places)
        for axis in axes
    )
    member = f'material = "a"\nsection = "s"\nelements = {elements}\n'
    return parse_structure(
        f'name = "bracket"\n[material.a]\nyoungs_modulus = {youngs_modulus}\npoisson_ratio = 0.33\n'
        f"density = {density}\n"
        '[section.s]\nshape = "rectangle"\nwidth = 0.003\nheight = 0.002\n'
        f'[[member]]\nname = "upright"\nfrom = [0, 0, 0]\nto = [0, 0, 0.04]\n{member}'
        f'[[member]]\nname = "arm"\nfrom = [0, 0, 0.04]\nto = [0.03, 0, 0.04]\n{member}'
        f'[[support]]\nat = [0, 0, 0]\nfixed = ["x", "y", "z", "rx", "ry", "rz"]\n{sensors}'
    )


@pytest.mark.thorough
def test_50_mg_mass_is_found_on_a_5_cm_bracket() -> None:
    """Of 1.1 g; a body's centre is millimetres off such an axis, and positions a centimetre apart would be four."""
    given, true = bracket(70e9, 2700, 25), bracket(68.5e9, 2730, 50)
    random, gain = np.random.default_rng(3), np.ones(len(given.channels))

    def windows(body: tuple[Body, ...], n: int) -> list[ModalEstimate]:
        model = build_model(true.with_bodies(body), shear_flexible=True, mass="consistent")
        return [measure(model, random, gain) for _ in range(n)]

    reference = learn_reference(given, windows((), 6), [TRACK] * 6)
    now = reference.mean_of(stack_tracks(windows((Body(at=(0.02, 0, 0.04), mass=5e-5),), 5), [TRACK] * 5))
    found = diagnose(reference, matched(reference.baseline, now))
    assert found.diagnosis.verdict == "explained", found.next_measurement
    (cause,) = found.diagnosis.causes
    assert cause.cause == "added_mass"
    assert cause.where is not None
    assert cause.where.position is not None
    assert cause.where.position_std is not None
    assert abs(cause.where.position[0] - 0.02) < max(4 * cause.where.position_std, 2e-4)
    mass = cause.parameters["mass"]
    assert abs(mass.value - 5e-5) < 4 * mass.std
    assert mass.std < 1e-5


def test_model_includes_unmeasured_modes_observable_by_sensors_in_one_plane() -> None:
    """Half of a bracket's modes are across its plane: thirty are not enough to describe a change in it."""
    given = bracket(70e9, 2700, 25, axes="x")
    model = build_model(given, shear_flexible=True, mass="consistent")
    windows = [measure(model, np.random.default_rng(i), np.ones(len(given.channels)), n_modes=30) for i in range(3)]
    at = np.abs(windows[0].shape).max(1) > 0.05
    seen = mean_modes(stack_tracks(windows, [np.flatnonzero(at)] * 3))
    found = calibrate(given, seen)
    moved = np.linalg.norm(found.model.sensor_rows @ found.modes.shape, axis=0)
    assert (moved > 1e-3 * moved.max()).sum() >= at.sum() + 4


def girder(youngs_modulus: float, elements: int) -> Structure:
    """Twelve metres on two bearings, with six sensors each across and upwards on the axis."""
    sensors = "".join(
        f'[[sensor]]\nchannel = "{axis}{round(10 * x)}"\nat = [{x}, 0, 0]\ndirection = {direction}\n'
        for x in (1.5, 3.5, 5.0, 6.5, 8.5, 10.5)
        for axis, direction in (("y", [0, 1, 0]), ("z", [0, 0, 1]))
    )
    return parse_structure(
        f'name = "girder"\n[material.s]\nyoungs_modulus = {youngs_modulus}\npoisson_ratio = 0.3\ndensity = 7850\n'
        "[section.g]\narea = 0.00774\nsecond_moment = [9.88e-5, 5.26e-5]\n"
        "torsion_constant = 1.04e-4\nshear_factor = 0.44\n"
        '[[member]]\nname = "girder"\nfrom = [0, 0, 0]\nto = [12, 0, 0]\nmaterial = "s"\nsection = "g"\n'
        f"elements = {elements}\nlocal_y = [0, 1, 0]\n"
        '[[support]]\nat = [0, 0, 0]\nfixed = ["x", "y", "z", "rx"]\n'
        f'[[support]]\nat = [12, 0, 0]\nfixed = ["y", "z", "rx"]\n{sensors}'
    )


def test_offset_body_on_a_girder_is_found_without_side_information() -> None:
    """On the axis of a symmetric structure a fit has no slope to either side, and stayed there."""
    given, true = girder(210e9, 30), girder(207e9, 60)
    random, gain = np.random.default_rng(5), np.ones(len(given.channels))
    at = np.flatnonzero(np.abs(measure(build_model(true), random, gain, n_modes=14).shape).max(1) > 0.05)

    def windows(body: tuple[Body, ...], n: int) -> list[ModalEstimate]:
        model = build_model(true.with_bodies(body), shear_flexible=True, mass="consistent")
        return [measure(model, random, gain, n_modes=14) for _ in range(n)]

    reference = learn_reference(given, windows((), 6), [at] * 6)
    body = Body(at=(3.16, 0, 0), mass=40.0, offset=(0, -0.05, 0.15))
    now = reference.mean_of(stack_tracks(windows((body,), 5), [at] * 5))
    data = compare(reference, matched(reference.baseline, now))
    found = fit(data, propose_added_mass(reference, data))
    assert found.p_value > 1e-3
    posterior = found.hypotheses.posterior(found)
    distance, std = posterior.distance(posterior.places[0])
    assert abs(distance - 3.16) < 4 * std
