"""Shapes of cross-sections and their constants. Width is along the local y axis, height along z.

Shear factors are those of Cowper (1966) for a Poisson's ratio of 0.3; between 0.2 and 0.35 they change by under 2 %,
which a slender member's frequencies do not show.

References
----------
Cowper, G. R. (1966). The shear coefficient in Timoshenko's beam theory. J. Appl. Mech. 33, 335-340, table 1.
EN 10219-2 (2006), annex B: hollow sections with round corners.
Timoshenko, S. P. & Goodier, J. N. (1970). Theory of elasticity, s. 109: torsion of a rectangular bar.
"""

from abc import abstractmethod
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator

from daq import FloatArray
from daq.bounded_text import meant
from updater.structure.base import Entry, Positive, not_known

_NU = 0.3
_AROUND = 16  # points about a round section: between two of them the stress is at most 2 % larger
# What a round corner leaves of a square one, r x r less a quarter of a circle (also the fillet of a rolled section):
_CORNER = 1 - np.pi / 4  # its area over r^2
_FILLET_CENTRE = (10 - 3 * np.pi) / (12 - 3 * np.pi)  # its centroid from the corner over r
_FILLET = 1 / 3 - np.pi / 16 - 1 / (3 * (12 - 3 * np.pi))  # its second moment about its centroid over r^4


@dataclass(frozen=True)
class _Constants:
    area: float
    second_moment: tuple[float, float]
    torsion_constant: float
    shear_factor: tuple[float, float]
    edge: tuple[float, float]
    round: bool = False


class Shape(Entry):
    """A cross-section by its measures [m]."""

    def constants(self) -> dict[str, Any]:
        """Return area, second moments, torsion constant, shear factors and edge, by the names of `Section`."""
        return asdict(self._constants())

    @abstractmethod
    def _constants(self) -> _Constants: ...


class Rectangle(Shape):
    """A solid rectangle."""

    width: Positive
    height: Positive

    def _constants(self) -> _Constants:
        b, h = self.width, self.height
        factor = 10 * (1 + _NU) / (12 + 11 * _NU)
        moments = (b * h**3 / 12, h * b**3 / 12)
        return _Constants(b * h, moments, _rectangle_torsion(b, h), (factor, factor), (b / 2, h / 2))


class Circle(Shape):
    """A solid round bar."""

    diameter: Positive

    def _constants(self) -> _Constants:
        return _ring(self.diameter, 0.0)


class Tube(Shape):
    """A round tube."""

    diameter: Positive  #: outer
    thickness: Positive

    @model_validator(mode="after")
    def _is_hollow(self) -> Self:
        _less(self.thickness, self.diameter / 2, "thickness", "half the diameter")
        return self

    def _constants(self) -> _Constants:
        return _ring(self.diameter, self.diameter - 2 * self.thickness)


class Box(Shape):
    """A rectangular tube of one wall thickness; cold-formed ones have corners of 2 thicknesses (EN 10219)."""

    width: Positive
    height: Positive
    thickness: Positive
    corner_radius: float = Field(default=0.0, ge=0)  #: outer; the inner one is a thickness less, down to 0

    @model_validator(mode="after")
    def _is_hollow(self) -> Self:
        least = min(self.width, self.height) / 2
        _less(self.thickness, least, "thickness", "half the lesser side")
        _less(self.corner_radius, least, "corner_radius", "half the lesser side")
        return self

    def _constants(self) -> _Constants:
        b, h, t = self.width, self.height, self.thickness
        outer, inner = self.corner_radius, max(self.corner_radius - t, 0.0)
        hole = (b - 2 * t, h - 2 * t)
        area = 2 * t * (b + h - 2 * t) - 4 * _CORNER * (outer**2 - inner**2)
        moment = [_rounded(across, along, outer) for across, along in ((b, h), (h, b))]
        moment = [m - _rounded(*sides, inner) for m, sides in zip(moment, (hole, hole[::-1]), strict=True)]
        shear = _cowper_box(across=h - t, along=b - t), _cowper_box(across=b - t, along=h - t)
        return _Constants(area, (moment[0], moment[1]), self._torsion(outer, inner), shear, (b / 2, h / 2))

    def _torsion(self, outer: float, inner: float) -> float:
        """Bredt's closed cell and the resistance of the wall itself, EN 10219-2 annex B."""
        b, h, t = self.width, self.height, self.thickness
        radius = (outer + inner) / 2  # of the wall's middle line
        around = 2 * (b + h - 2 * t) - 8 * _CORNER * radius
        cell = (b - t) * (h - t) - 4 * _CORNER * radius**2
        return t**3 * around / 3 + 4 * cell**2 * t / around


class IBeam(Shape):
    """A doubly symmetric I, its web along z; rolled ones have a root radius (EN 10365)."""

    width: Positive  #: width of the flanges
    height: Positive
    web: Positive  #: thickness
    flange: Positive  #: thickness
    root_radius: float = Field(default=0.0, ge=0)

    @model_validator(mode="after")
    def _is_an_i(self) -> Self:
        _less(self.flange, self.height / 2, "flange", "half the height")
        _less(self.web, self.width, "web", "the width")
        room = min(self.height / 2 - self.flange, (self.width - self.web) / 2)
        _less(self.root_radius, room, "root_radius", "the room between web and flange")
        return self

    def _constants(self) -> _Constants:
        b, h, s, t, r = self.width, self.height, self.web, self.flange, self.root_radius
        clear = h - 2 * t
        area = 2 * b * t + clear * s + 4 * _CORNER * r**2
        corner = 4 * _CORNER * r**2
        own = 4 * _FILLET * r**4
        strong = (b * h**3 - (b - s) * clear**3) / 12 + own + corner * (clear / 2 - _FILLET_CENTRE * r) ** 2
        weak = (2 * t * b**3 + clear * s**3) / 12 + own + corner * (s / 2 + _FILLET_CENTRE * r) ** 2
        shear = (5 / 6 * 2 * b * t / area, self._shear_of_web())
        return _Constants(area, (strong, weak), self._torsion(), shear, (b / 2, h / 2))

    def _torsion(self) -> float:
        """Return the resistance of strips, less their ends, plus the junctions (El Darwish & Johnston 1965)."""
        b, h, s, t, r = self.width, self.height, self.web, self.flange, self.root_radius
        circle = ((r + s / 2) ** 2 + (r + t) ** 2 - r**2) / (2 * r + t)  # diameter inscribed at a junction
        junction = 2 * s / t * (0.145 + 0.1 * r / t) * circle**4
        return 2 / 3 * (b - 0.63 * t) * t**3 + (h - 2 * t) * s**3 / 3 + junction

    def _shear_of_web(self) -> float:
        m = 2 * self.width * self.flange / ((self.height - self.flange) * self.web)
        n = self.width / (self.height - self.flange)
        extra = 30 * n**2 * (m + m**2) + 5 * _NU * n**2 * (8 * m + 9 * m**2)
        return _thin_walled(m, extra)


SHAPES: dict[str, type[Shape]] = {"rectangle": Rectangle, "box": Box, "circle": Circle, "tube": Tube, "i": IBeam}


def _less(value: float, limit: float, name: str, what: str) -> None:
    if value >= limit:
        raise ValueError(f"{name}: expected less than {what}, {limit:g} m, found {value:g} m")


def _ring(outer: float, inner: float) -> _Constants:
    """Return a round tube's constants, a solid bar's with an inner diameter of 0."""
    moment = np.pi * (outer**4 - inner**4) / 64
    m2 = (inner / outer) ** 2
    ends = (1 + m2) ** 2
    factor = 6 * (1 + _NU) * ends / ((7 + 6 * _NU) * ends + (20 + 12 * _NU) * m2)
    area = np.pi * (outer**2 - inner**2) / 4
    return _Constants(area, (moment, moment), 2 * moment, (factor, factor), (outer / 2, outer / 2), round=True)


def _rounded(across: float, along: float, radius: float) -> float:
    """Return the second moment of a rectangle with round corners about the axis that halves its side `along`."""
    missing = _FILLET * radius**4 + _CORNER * radius**2 * (along / 2 - _FILLET_CENTRE * radius) ** 2
    return across * along**3 / 12 - 4 * missing


def _rectangle_torsion(a: float, b: float) -> float:
    """Return the torsion constant by the series of Timoshenko & Goodier; terms fall as n^-5."""
    long, short = max(a, b), min(a, b)
    n = np.arange(1, 40, 2)
    series = float((np.tanh(n * np.pi * long / (2 * short)) / n**5).sum())
    return long * short**3 * (1 / 3 - 64 / np.pi**5 * short / long * series)


def _cowper_box(*, across: float, along: float) -> float:
    """Return a thin-walled box's shear factor along the walls of length `along`; wall middle lines."""
    m = n = across / along
    return _thin_walled(m, 10 * n**2 * ((3 + _NU) * m + 3 * m**2))


def _thin_walled(m: float, extra: float) -> float:
    """Return Cowper's factor of boxes and I sections; `m` is the flanges' area over the webs'."""
    webs = 12 + 72 * m + 150 * m**2 + 90 * m**3 + _NU * (11 + 66 * m + 135 * m**2 + 90 * m**3)
    return 10 * (1 + _NU) * (1 + 3 * m) ** 2 / (webs + extra)


class Section(Entry):
    """A cross-section's constants; in a file, `shape = "box"` and its measures give them as well.

    Local axes: x along the member, y across (horizontal, unless the member states it), z orthogonal to both.
    """

    area: Positive  #: [m2]
    second_moment: tuple[Positive, Positive]  #: about the local y and z axes [m4]
    torsion_constant: Positive  #: [m4]
    shear_factor: Positive | tuple[Positive, Positive] = 5 / 6  #: effective shear area over area, y and z or both [-]
    edge: tuple[Positive, Positive] | None = None  #: distances of the outermost fibres along y and z; for stresses [m]
    round: bool = False  #: whether the edge is an ellipse; otherwise a rectangle

    @model_validator(mode="before")
    @classmethod
    def _of_shape(cls, content: object) -> object:
        """Put the constants of a shape in the place of its measures."""
        if not isinstance(content, dict) or "shape" not in content:
            return content
        name = content["shape"]
        if not isinstance(name, str) or name not in SHAPES:
            raise ValueError(f"shape {name!r} is not known{meant(str(name), SHAPES)}; there are {', '.join(SHAPES)}")
        measures = {key: value for key, value in content.items() if key != "shape"}
        try:
            return SHAPES[name].model_validate(measures).constants()
        except ValidationError as error:
            raise ValueError(_wrong_measure(name, error)) from error

    def fibres(self) -> FloatArray:
        """Return the points (n, 2) along y and z at which bending stresses are largest [m]; none without `edge`."""
        if self.edge is None:
            return np.empty((0, 2))
        if not self.round:
            return np.asarray(np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * self.edge)
        angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
        return np.asarray(np.column_stack([np.cos(angle), np.sin(angle)]) * self.edge)

    def shear_area(self, axis: int) -> float:
        """Return the effective shear area along the local y (0) or z (1) axis [m2]."""
        factor = self.shear_factor
        return self.area * (factor[axis] if isinstance(factor, tuple) else factor)


def _wrong_measure(shape: str, error: ValidationError) -> str:
    """Return which dimension of a shape is wrong; an unknown one may be the missing one, and comes first."""
    found = error.errors()
    first = next((e for e in found if e["type"] == "extra_forbidden"), found[0])
    where = " ".join([shape, *(str(part) for part in first["loc"])])
    if first["type"] == "extra_forbidden":
        return f"{where}: {not_known(str(first['loc'][-1]), SHAPES[shape].model_fields)}"
    return f"{where}: {first['msg'].removeprefix('Value error, ')}"
