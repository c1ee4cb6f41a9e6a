"""Constants of cross-sections against published tables and closed forms."""

from typing import Any

import numpy as np
import pytest

from tests.support.updater.frames import t_frame
from updater import StructureError, build_model, parse_structure, t_structure_toml
from updater.structure import Section

COLD = {"shape": "box", "thickness": 3e-3, "corner_radius": 6e-3}


def _printed(value: float, like: str) -> str:
    """Return a figure with as many digits as another."""
    digits = sum(c.isdigit() for c in like)
    return f"{value:.{digits}g}"


# cm2 and cm4 as the tables print them: EN 10219-2 annex C for tubes, EN 10365 for IPE 200
@pytest.mark.parametrize(
    ("measures", "area", "about_y", "about_z", "torsion"),
    [
        (COLD | {"width": 0.04, "height": 0.04}, "4.21", "9.32", "9.32", "15.8"),
        (COLD | {"width": 0.03, "height": 0.05}, "4.21", "12.83", "5.7", "13.53"),
        (COLD | {"width": 0.05, "height": 0.03}, "4.21", "5.7", "12.83", "13.53"),
        (COLD | {"width": 0.04, "height": 0.06}, "5.41", "25.38", "13.44", "29.28"),
        ({"shape": "tube", "diameter": 0.0483, "thickness": 3.2e-3}, "4.53", "11.6", "11.6", "23.2"),
        (
            {"shape": "i", "width": 0.1, "height": 0.2, "web": 5.6e-3, "flange": 8.5e-3, "root_radius": 0.012},
            "28.5", "1943", "142", "6.98",
        ),
    ],
    ids=["40x40x3", "50x30x3 upright", "50x30x3 flat", "60x40x3", "48.3x3.2", "IPE 200"],
)  # fmt: skip
def test_section_constants_of_standard_profiles_match_the_tables(
    measures: dict[str, Any], area: str, about_y: str, about_z: str, torsion: str
) -> None:
    section = Section.model_validate(measures)
    assert _printed(section.area * 1e4, area) == area
    assert _printed(section.second_moment[0] * 1e8, about_y) == about_y
    assert _printed(section.second_moment[1] * 1e8, about_z) == about_z
    assert _printed(section.torsion_constant * 1e8, torsion) == torsion


# Timoshenko & Goodier, s. 109: J = k long short^3
@pytest.mark.parametrize(("ratio", "k"), [(1, 0.1406), (1.5, 0.1958), (2, 0.229), (5, 0.291), (10, 0.312)])
def test_rectangle_torsion_constant_matches_saint_venant_tables(ratio: float, k: float) -> None:
    for width, height in ((0.02, 0.02 * ratio), (0.02 * ratio, 0.02)):
        section = Section.model_validate({"shape": "rectangle", "width": width, "height": height})
        assert section.torsion_constant == pytest.approx(k * ratio * 0.02**4, rel=3e-3)  # k has three digits
        assert section.second_moment == pytest.approx((width * height**3 / 12, height * width**3 / 12))


# Cowper (1966), table 1, at a Poisson's ratio of 0.3
def test_shear_factors_match_cowper() -> None:
    def factor(**measures: Any) -> Any:
        return Section.model_validate(measures).shear_factor

    assert factor(shape="rectangle", width=1.0, height=3.0) == pytest.approx([0.850, 0.850], abs=5e-4)
    assert factor(shape="circle", diameter=1.0) == pytest.approx([0.886, 0.886], abs=5e-4)
    # a thin round tube: 2 (1 + nu) / (4 + 3 nu)
    assert factor(shape="tube", diameter=1.0, thickness=1e-4) == pytest.approx([2.6 / 4.9] * 2, rel=1e-3)
    # a tube that is nearly solid tends to the bar
    assert factor(shape="tube", diameter=1.0, thickness=0.499) == pytest.approx([0.886, 0.886], abs=1e-3)
    # a thin square tube: 20 (1 + nu) / (48 + 39 nu)
    assert factor(shape="box", width=1.0, height=1.0, thickness=1e-4) == pytest.approx([26 / 59.7] * 2, rel=1e-3)


@pytest.mark.parametrize("shape", ["box", "i"])
def test_shear_factors_at_zero_poisson_ratio_match_the_shear_flow(shape: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """kappa = I^2 / (A int S^2 / t ds), S the first moment of the part that is cut off; walls so thin that they are
    lines.
    """
    monkeypatch.setattr("updater.structure.section_shapes._NU", 0.0)
    b, h, t = 0.3, 0.5, 1e-6
    x, z = np.linspace(0, b / 2, 2001), np.linspace(-h / 2, h / 2, 4001)
    sides = 2 if shape == "box" else 1  # webs; each bears its half of the flanges, two of four strips or all four
    flange = t * h / 2 * x
    web = t * h / 2 * b / sides + t * ((h / 2) ** 2 - z**2) / 2
    flow = (4 * np.trapezoid(flange**2, x) + sides * np.trapezoid(web**2, z)) / t
    moment = 2 * b * t * (h / 2) ** 2 + sides * t * h**3 / 12
    expected = moment**2 / ((2 * b + sides * h) * t * flow)
    walls = {"thickness": t} if shape == "box" else {"web": t, "flange": t}
    section = Section.model_validate({"shape": shape, "width": b + t, "height": h + t} | walls)
    assert section.shear_area(1) / section.area == pytest.approx(expected, rel=1e-5)


def test_shear_area_is_that_of_the_parallel_walls() -> None:
    """Most of a flat box resists along its width, most of an I's web along its height."""
    along_width, along_height = Section.model_validate(
        {"shape": "box", "width": 0.3, "height": 0.1, "thickness": 0.005}
    ).shear_factor  # type: ignore[misc]
    assert along_width > 2 * along_height
    section = Section.model_validate({"shape": "i", "width": 0.1, "height": 0.2, "web": 0.0056, "flange": 0.0085})
    web = (0.2 - 0.0085) * 0.0056
    assert section.shear_area(1) == pytest.approx(web, rel=0.06)  # the engineers' rule: the web's area
    assert section.shear_area(0) == pytest.approx(5 / 6 * 2 * 0.1 * 0.0085)


def test_round_corner_tube_reproduces_the_shipped_frame_frequencies() -> None:
    """The T-frame's constants are rounded ones of a cold-formed 40 x 40 x 3: 0.35 % off in area, 0.3 % in J."""
    tube = Section.model_validate(COLD | {"width": 0.04, "height": 0.04})
    shaped = t_frame().model_copy(update={"section": {"tube_40x40x3": tube}})
    frequency, other = (build_model(s, shear_flexible=True).modes(8).frequency for s in (t_frame(), shaped))
    # half of 0.35 % by mass, half of 0.25 % and of 0.3 % by bending and twisting stiffness
    np.testing.assert_allclose(other, frequency, rtol=3.5e-3)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            'shape = "bx"\nwidth = 0.1',
            "section.tube_40x40x3: shape 'bx' is not known, did you mean 'box'?; there are rectangle, box, circle",
        ),
        ('shape = "circle"\ndiameter = -1.0', "section.tube_40x40x3: circle diameter: Input should be greater than 0"),
        ('shape = "circle"', "section.tube_40x40x3: circle diameter: Field required"),
        ('shape = "circle"\nradius = 1.0', "40x3: circle radius: not a known key; known here are diameter"),
        (
            'shape = "circle"\ndia = 0.1',
            "circle dia: not a known key, did you mean 'diameter'?; known",
        ),
        (
            'shape = "box"\nwidth = 1\nheigth = 1\nthickness = 0.01',
            "heigth: not a known key, did you mean 'height'?",
        ),
        ('shape = "circle"\ndiameter = 1.0\narea = 2.0', "circle area: not a known key; known here are diameter"),
        ('shape = "tube"\ndiameter = 0.1\nthickness = 0.06', "thickness: expected less than half the diameter, 0.05 m"),
        ('shape = "box"\nwidth = 0.1\nheight = 0.04\nthickness = 0.03', "expected less than half the lesser side"),
        ('shape = "box"\nwidth = 0.1\nheight = 0.04\nthickness = 0.003\ncorner_radius = 0.02', "corner_radius"),
        ('shape = "i"\nwidth = 0.1\nheight = 0.2\nweb = 0.2\nflange = 0.01', "web: expected less than the width"),
        ('shape = "i"\nwidth = 0.1\nheight = 0.2\nweb = 0.01\nflange = 0.1', "flange: expected less than half"),
    ],
)
def test_invalid_section_shape_is_refused_with_the_reason(text: str, says: str) -> None:
    old = t_structure_toml()
    start, end = old.index("area = "), old.index("[[member]]")
    with pytest.raises(StructureError) as caught:
        parse_structure(f"{old[:start]}{text}\n{old[end:]}", "frame.toml")
    assert str(caught.value).startswith("frame.toml: section.tube_40x40x3")
    assert says in str(caught.value)


# EN 10219-2 annex C and EN 10365: elastic section moduli [cm3], as the tables print them
@pytest.mark.parametrize(
    ("measures", "about_y", "about_z"),
    [
        (COLD | {"width": 0.04, "height": 0.06}, "8.46", "6.72"),
        ({"shape": "tube", "diameter": 0.0483, "thickness": 3.2e-3}, "4.8", "4.8"),
        (
            {"shape": "i", "width": 0.1, "height": 0.2, "web": 5.6e-3, "flange": 8.5e-3, "root_radius": 0.012},
            "194", "28.5",
        ),
    ],
    ids=["60x40x3", "48.3x3.2", "IPE 200"],
)  # fmt: skip
def test_outermost_fibres_give_the_section_moduli_of_the_tables(
    measures: dict[str, Any], about_y: str, about_z: str
) -> None:
    section = Section.model_validate(measures)
    y, z = np.abs(section.fibres()).max(0)
    assert _printed(section.second_moment[0] / z * 1e6, about_y) == about_y
    assert _printed(section.second_moment[1] / y * 1e6, about_z) == about_z
    assert len(section.fibres()) == (16 if section.round else 4)


def test_section_by_constants_has_no_fibres_without_its_edge() -> None:
    constants = {"area": 1e-4, "second_moment": (1e-9, 1e-9), "torsion_constant": 1e-9}
    assert len(Section.model_validate(constants).fibres()) == 0
    (y, z), *_ = Section.model_validate(constants | {"edge": (0.01, 0.03)}).fibres()
    assert (y, z) == (0.01, 0.03)
