"""Cross-sections: by their constants, or by a shape that gives them.

Local axes: x along the member, y across (horizontal, unless the member states it), z orthogonal to both. A shape's
width is along y and its height along z.
"""

from pydantic import ValidationError, model_validator

from updater.structure.base import Entry, Positive, meant, not_known
from updater.structure.section_shapes import SHAPES


class Section(Entry):
    """A cross-section's constants; in a file, `shape = "box"` and its measures give them as well."""

    area: Positive  #: [m2]
    second_moment: tuple[Positive, Positive]  #: about the local y and z axes [m4]
    torsion_constant: Positive  #: [m4]
    shear_factor: Positive | tuple[Positive, Positive] = 5 / 6  #: effective shear area over area, y and z or both [-]

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
