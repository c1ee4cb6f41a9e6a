"""Structures besides the T-frame: a portal, a bridge, a mast, a grid, a frame of two storeys."""

from dataclasses import replace

import numpy as np

from tests.examiner.design import Design, Section
from tests.examiner.models.bar import Bar, Vector, vector
from tests.examiner.models.frame import Ground, Lump, Meeting


def steel_bar(name: str, start: Vector, axis: int, length: float, section: Section, size: float) -> Bar:
    """Return a bar of steel."""
    return Bar(
        name=name,
        start=start,
        axis=axis,
        length=length,
        size=size,
        modulus=210e9,
        shear_modulus=80.77e9,
        density=7850.0,
        area=section.area,
        second_moment=section.second_moment,
        torsion_constant=section.torsion_constant,
        shear_factor=section.shear_factor,
    )


def thin_box(across_first: float, across_second: float, wall: float) -> Section:
    """Return a thin box's constants from its outer measures along the two cross axes [m]."""
    a, b = across_first, across_second
    c, d = a - 2 * wall, b - 2 * wall
    middle = (a - wall) * (b - wall)
    return Section(
        area=a * b - c * d,
        second_moment=((a * b**3 - c * d**3) / 12, (b * a**3 - d * c**3) / 12),
        torsion_constant=2 * middle**2 * wall / (a + b - 2 * wall),
        shear_factor=0.44,
    )


def _tube(diameter: float, wall: float) -> Section:
    inner = diameter - 2 * wall
    second = np.pi / 64 * (diameter**4 - inner**4)
    return Section(
        area=float(np.pi / 4 * (diameter**2 - inner**2)),
        second_moment=(float(second), float(second)),
        torsion_constant=float(2 * second),
        shear_factor=0.53,
    )


def _rigid_but(axes: str = "", stiffness: float = 0.0) -> Vector:
    return vector(stiffness if a in axes else np.inf for a in "xyz")


_POST, _BEAM = thin_box(0.06, 0.06, 0.003), thin_box(0.04, 0.08, 0.003)
_UNIT = 210e9 * _POST.second_moment[0] / 2.0 / 0.004  # N m/rad
PORTAL = Design(
    name="portal",
    bars=(
        steel_bar("left", (0.0, 0.0, 0.0), 2, 2.0, _POST, 0.06),
        steel_bar("beam", (0.0, 0.0, 2.0), 0, 3.0, _BEAM, 0.06),
        steel_bar("right", (3.0, 0.0, 0.0), 2, 2.0, _POST, 0.06),
    ),
    grounds=(Ground(bar="left", s=0.0, about=(_UNIT,) * 3), Ground(bar="right", s=0.0, about=(_UNIT,) * 3)),
    meetings=(
        Meeting(bar="left", s=2.0, other="beam", t=0.0, about=(_UNIT,) * 3),
        Meeting(bar="right", s=2.0, other="beam", t=3.0, about=(_UNIT,) * 3),
    ),
    devices=(
        *((post, z, f"{post}_{round(10 * z):02d}", "xy") for post in ("left", "right") for z in (0.8, 1.5)),
        *(("beam", x, f"beam_{round(100 * x):03d}", "yz") for x in (0.75, 1.5, 2.25)),
    ),
    band=150.0,
    window=120.0,
    element=0.1,
)

_GIRDER = thin_box(0.20, 0.30, 0.008)
BRIDGE = Design(
    name="bridge",
    bars=(steel_bar("girder", (0.0, 0.0, 0.0), 0, 12.0, _GIRDER, 0.3),),
    grounds=(
        Ground(bar="girder", s=0.0, along=_rigid_but("z", 8e7), about=(np.inf, 0.0, 0.0)),
        Ground(bar="girder", s=12.0, along=(0.0, np.inf, 8e7), about=(np.inf, 0.0, 0.0)),
    ),
    meetings=(),
    devices=tuple(("girder", x, f"g_{round(10 * x):03d}", "yz") for x in (1.5, 3.5, 5.0, 6.5, 8.5, 10.5)),
    band=180.0,
    window=600.0,
    element=0.4,
)

_SLABS = tuple(Lump(bar="girder", s=s + 0.5, mass=150.0, offset=(0.0, 0.0, 0.35)) for s in range(12))
#: the bridge with a deck of 1.8 t above its axis, which couples motion along the axis with bending
GIRDER = replace(BRIDGE, name="girder", bodies=_SLABS, band=120.0)

_DECK = thin_box(1.4, 0.9, 0.025)
#: three spans, few sensors across; along its bearings it slides at nearly a frequency that it bends at across them
FOOTBRIDGE = Design(
    name="footbridge",
    bars=(steel_bar("deck", (0.0, 0.0, 0.0), 0, 66.0, _DECK, 1.0),),
    grounds=tuple(
        Ground(bar="deck", s=s, along=(kx, ky, kz), about=(np.inf, 2e6, 1e6))
        for s, kx, ky, kz in (
            (0.0, 1e6, 5e7, 5e8),
            (18.0, 1e8, 1e7, 1e9),
            (48.0, 1e6, 1e7, 1e9),
            (66.0, 1e6, 5e7, 5e8),
        )
    ),
    meetings=(),
    devices=tuple(
        ("deck", s, f"d_{round(10 * s):03d}", axes)
        for s, axes in (
            (9.0, "yz"),
            (13.5, "z"),
            (25.5, "z"),
            (33.0, "yz"),
            (39.0, "z"),
            (54.0, "z"),
            (57.0, "y"),
            (60.0, "z"),
        )
    ),
    band=22.0,
    window=600.0,
    element=1.0,
)

_LOW, _MID, _TOP = _tube(0.324, 0.008), _tube(0.273, 0.0063), _tube(0.219, 0.005)
_FOOT = 210e9 * _LOW.second_moment[0] / 15.0 / 0.004
MAST = Design(
    name="mast",
    bars=(
        steel_bar("low", (0.0, 0.0, 0.0), 2, 5.0, _LOW, 0.25),
        steel_bar("mid", (0.0, 0.0, 5.0), 2, 5.0, _MID, 0.25),
        steel_bar("top", (0.0, 0.0, 10.0), 2, 5.0, _TOP, 0.25),
    ),
    grounds=(Ground(bar="low", s=0.0, about=(_FOOT, 1.5 * _FOOT, np.inf)),),
    meetings=(Meeting(bar="low", s=5.0, other="mid", t=0.0), Meeting(bar="mid", s=5.0, other="top", t=0.0)),
    devices=(
        *(("low", z, f"m_{round(10 * z):03d}", "xy") for z in (2.5, 4.5)),
        *(("mid", z, f"m_{round(10 * z) + 50:03d}", "xy") for z in (2.0, 4.0)),
        *(("top", z, f"m_{round(10 * z) + 100:03d}", "xy") for z in (2.5, 5.0)),
    ),
    bodies=(Lump(bar="top", s=5.0, mass=30.0, offset=(0.15, 0.0, 0.2)),),
    band=120.0,
    window=600.0,
    element=0.5,
)

_LONG, _CROSS = thin_box(0.06, 0.10, 0.004), thin_box(0.08, 0.06, 0.003)
GRID = Design(
    name="grid",
    bars=(
        steel_bar("south", (0.0, 0.0, 0.0), 0, 4.0, _LONG, 0.1),
        steel_bar("north", (0.0, 1.2, 0.0), 0, 4.0, _LONG, 0.1),
        *(steel_bar(f"cross{i}", (x, 0.0, 0.0), 1, 1.2, _CROSS, 0.1) for i, x in enumerate((0.0, 1.4, 2.6, 4.0))),
    ),
    grounds=(
        Ground(bar="south", s=0.0),
        Ground(bar="south", s=4.0, along=(0.0, np.inf, np.inf)),
        Ground(bar="north", s=0.0, along=(0.0, 0.0, np.inf)),
        Ground(bar="north", s=4.0, along=(0.0, 0.0, np.inf)),
    ),
    meetings=tuple(
        Meeting(bar=girder, s=x, other=f"cross{i}", t=y)
        for girder, y in (("south", 0.0), ("north", 1.2))
        for i, x in enumerate((0.0, 1.4, 2.6, 4.0))
    ),
    devices=tuple(
        (girder, x, f"{girder}_{round(10 * x):02d}", "z")
        for girder in ("south", "north")
        for x in (0.7, 1.4, 2.1, 2.6, 3.4)
    ),
    band=158.0,
    window=120.0,
    element=0.1,
)

_COLUMN, _STOREY_BEAM = thin_box(0.05, 0.03, 0.002), thin_box(0.03, 0.04, 0.002)
_STIFF = 210e9 * _COLUMN.second_moment[0] / 2.0 / 0.004  # N m/rad
_CORNERS = ((0.0, 0.0), (1.2, 0.0), (1.2, 0.8), (0.0, 0.8))
#: eight closed loops of members, and modes close to some that the sensors do not measure
STOREYS = Design(
    name="storeys",
    bars=(
        *(steel_bar(f"column{i}", (x, y, 0.0), 2, 2.0, _COLUMN, 0.05) for i, (x, y) in enumerate(_CORNERS)),
        *(
            steel_bar(f"beam{level}{side}", (x, y, float(level)), axis, length, _STOREY_BEAM, 0.05)
            for level in (1, 2)
            for side, x, y, axis, length in (
                ("front", 0.0, 0.0, 0, 1.2),
                ("back", 0.0, 0.8, 0, 1.2),
                ("left", 0.0, 0.0, 1, 0.8),
                ("right", 1.2, 0.0, 1, 0.8),
            )
        ),
    ),
    grounds=tuple(Ground(bar=f"column{i}", s=0.0, about=(_STIFF,) * 3) for i in range(4)),
    meetings=tuple(
        Meeting(bar=f"column{i}", s=float(level), other=f"beam{level}{side}", t=t, about=(_STIFF,) * 3)
        for level in (1, 2)
        for i, side, t in (
            (0, "front", 0.0),
            (1, "front", 1.2),
            (3, "back", 0.0),
            (2, "back", 1.2),
            (0, "left", 0.0),
            (3, "left", 0.8),
            (1, "right", 0.0),
            (2, "right", 0.8),
        )
    ),
    devices=(
        *((f"column{i}", 2.0, f"top_{i}", "xy") for i in range(4)),
        *((f"column{i}", 1.0, f"middle_{i}", "xy") for i in (0, 2)),
    ),
    band=170.0,
    window=120.0,
    element=0.1,
)

DESIGNS = {design.name: design for design in (PORTAL, BRIDGE, MAST, GRID, STOREYS)}
