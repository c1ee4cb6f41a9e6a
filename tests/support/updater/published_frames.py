"""Published frames with published answers: NAFEMS's free vibrations and MacNeal & Harder's cantilevers.

References
----------
NAFEMS (1989). Selected benchmarks for natural frequency analysis, tests FV2, FV4 and FV5: their closed forms.
MacNeal, R. H. & Harder, R. L. (1985). A proposed standard set of problems to test finite element accuracy. Finite
Elements in Analysis and Design 1, 3-20.
"""

import itertools
from typing import Any

import numpy as np

from daq import FloatArray
from updater import Body, Model, Structure, build_model

FV2 = np.r_[11.336, [17.709] * 7, 45.345, [57.390] * 7]  # Hz
FV4 = np.array([1.723, 1.727, 7.413, 9.972, 18.155, 26.957])  # Hz
FV5 = np.array([42.650, 42.650, 71.20, 125.00, 148.15, 148.15, 213.61, 283.47, 283.47])  # Hz
CURVED = {"in the plane": 0.08734, "out of it": 0.5022}
TWISTED = {"along the width at the tip": 5.424e-3, "along the thickness": 1.754e-3}


def frame(
    points: FloatArray,
    section: dict[str, Any],
    *,
    elements: int,
    material: dict[str, float],
    support: list[dict[str, Any]],
    local_y: FloatArray | None = None,
    spans: list[tuple[int, int]] | None = None,
) -> Structure:
    """Return members between points (n, 3), one after another unless spans are given."""
    spans = spans or list(itertools.pairwise(range(len(points))))
    return Structure.model_validate(
        {
            "name": "benchmark",
            "material": {"m": material},
            "section": {"s": section},
            "member": [
                {"name": str(i), "from": points[a], "to": points[b], "material": "m", "section": "s"}
                | {"elements": elements, "local_y": None if local_y is None else tuple(local_y[i])}
                for i, (a, b) in enumerate(spans)
            ],
            "support": support,
        }
    )


def double_cross(elements: int) -> Model:
    """FV2: eight arms of 5 m, 0.125 m square, pinned at their ends, in their plane."""
    turn = np.arange(8) * np.pi / 4
    points = np.vstack([np.zeros(3), 5 * np.c_[np.cos(turn), np.sin(turn), np.zeros(8)]])
    inner = (points[1:, None] * np.arange(1, elements)[:, None] / elements).reshape(-1, 3)
    out = ("z", "rx", "ry")
    support = [{"at": tuple(p), "fixed": out} for p in (points[0], *inner)]
    support += [{"at": tuple(p), "fixed": ("x", "y", *out)} for p in points[1:]]
    section = {"shape": "rectangle", "width": 0.125, "height": 0.125}
    material = {"youngs_modulus": 200e9, "poisson_ratio": 0.3, "density": 8000.0}
    spans = [(0, i) for i in range(1, 9)]
    return build_model(
        frame(points, section, elements=elements, material=material, support=support, spans=spans), mass="consistent"
    )


def off_centre_masses(elements: int) -> Model:
    """FV4: a cantilever of 10 m, 0.5 m thick, with 10 t two metres to one side of its tip and 1 t to the other."""
    structure = frame(
        np.array([[0.0, 0, 0], [10, 0, 0]]),
        {"shape": "circle", "diameter": 0.5},
        elements=elements,
        material={"youngs_modulus": 200e9, "poisson_ratio": 0.3, "density": 8000.0},
        support=[{"at": (0, 0, 0), "fixed": ("x", "y", "z", "rx", "ry", "rz")}],
    )
    bodies = [Body(at=(10, 0, 0), mass=1e4, offset=(0, 2, 0)), Body(at=(10, 0, 0), mass=1e3, offset=(0, -2, 0))]
    return build_model(structure.with_bodies(bodies), mass="consistent")


def deep_beam(elements: int) -> Model:
    """FV5: a simply supported beam of 10 m, 2 m square: it shears, and its sections have inertia."""
    structure = frame(
        np.array([[0.0, 0, 0], [10, 0, 0]]),
        {"shape": "rectangle", "width": 2.0, "height": 2.0},
        elements=elements,
        material={"youngs_modulus": 200e9, "poisson_ratio": 0.3, "density": 8000.0},
        support=[{"at": (0, 0, 0), "fixed": ("x", "y", "z", "rx")}, {"at": (10, 0, 0), "fixed": ("y", "z")}],
    )
    return build_model(structure, shear_flexible=True, mass="consistent")


def portal(foot: tuple[str, ...], elements: int) -> tuple[FloatArray, FloatArray]:
    """Return K of a square portal, E I = L = 1, that sways in its plane, and its change by tension in its posts."""
    points = np.array([[0, 0, 0], [0, 0, 1.0], [1.0, 0, 1.0], [1.0, 0, 0]])
    structure = frame(
        points,
        {"area": 1e8, "second_moment": (1.0, 1.0), "torsion_constant": 1.0},  # posts that do not shorten
        elements=elements,
        material={"youngs_modulus": 1.0, "shear_modulus": 0.4, "density": 1.0},
        support=[{"at": tuple(p), "fixed": foot} for p in (points[0], points[3])]
        + [{"at": tuple(p), "fixed": ("y", "rx", "rz")} for p in points[1:3]],
    )
    tensed = tuple(m.model_copy(update={"preload": 0.0 if m.name == "1" else 1.0}) for m in structure.member)
    plain, loaded = (
        build_model(s).stiffness.toarray() for s in (structure, structure.model_copy(update={"member": tensed}))
    )
    return plain, loaded - plain


def _tip_moves(model: Model, tip: FloatArray, load: FloatArray) -> float:
    """Return how far the tip moves along a unit load."""
    row = load @ model.read(tip)[:3]
    return float(row @ np.linalg.solve(model.stiffness.toarray(), row))


def curved_cantilever(members: int) -> dict[str, float]:
    """A quarter of a ring of radius 4.22, 0.2 wide in its plane and 0.1 thick, E = 1e7, Poisson's ratio 0.25."""
    turn = np.linspace(0, np.pi / 2, members + 1)
    points = 4.22 * np.c_[np.cos(turn), np.sin(turn), np.zeros_like(turn)]
    structure = frame(
        points,
        {"shape": "rectangle", "width": 0.2, "height": 0.1},
        elements=1,
        material={"youngs_modulus": 1e7, "poisson_ratio": 0.25, "density": 1.0},
        support=[{"at": tuple(points[-1]), "fixed": ("x", "y", "z", "rx", "ry", "rz")}],
    )
    model = build_model(structure, shear_flexible=True)
    loads = (np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    return dict(zip(CURVED, (_tip_moves(model, points[0], load) for load in loads), strict=True))


def twisted_cantilever(members: int) -> dict[str, float]:
    """A strip of 12 x 1.1 x 0.32, turned by 90 degrees from root to tip, E = 29e6, Poisson's ratio 0.22."""
    points = np.c_[np.linspace(0, 12, members + 1), np.zeros((members + 1, 2))]
    middle = (np.arange(members) + 0.5) / members * np.pi / 2
    structure = frame(
        points,
        {"shape": "rectangle", "width": 1.1, "height": 0.32},
        elements=1,
        material={"youngs_modulus": 29e6, "poisson_ratio": 0.22, "density": 1.0},
        support=[{"at": (0, 0, 0), "fixed": ("x", "y", "z", "rx", "ry", "rz")}],
        local_y=np.c_[np.zeros(members), np.cos(middle), np.sin(middle)],
    )
    model = build_model(structure, shear_flexible=True)
    loads = (np.array([0, 0, 1.0]), np.array([0, 1.0, 0]))
    return dict(zip(TWISTED, (_tip_moves(model, points[-1], load) for load in loads), strict=True))
