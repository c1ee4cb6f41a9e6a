"""Structure: the checked entries of a structure file."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Self

import numpy as np
from pydantic import model_validator

from updater.errors import ModelError
from updater.structure.entries import Body, Entries, Mesh
from updater.structure.validation import check_names, check_places, check_size

_USUAL = 1.48  # m, the longest member of the frame that lengths were chosen on


class Structure(Entries):
    """A frame of straight members with everything fixed to it."""

    @model_validator(mode="before")
    @classmethod
    def _cut_members(cls, content: object) -> object:
        """Count the elements of members without a stated number; their errors are found later."""
        if not isinstance(content, dict) or "mesh" not in content:
            return content
        try:
            length = Mesh.model_validate(content["mesh"]).element_length
            with np.errstate(over="ignore"):
                return content | {"member": [_cut(member, length) for member in content["member"]]}
        except (KeyError, OverflowError, TypeError, ValueError):
            return content

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        check_size(self)
        check_names(self)
        check_places(self)
        return self

    def beside(self, folder: Path) -> "Structure":
        """Return the same structure, files it names taken as relative to a folder."""
        return self if self.external is None else self.model_copy(update={"external": self.external.beside(folder)})

    def with_mesh(self, element_length: float) -> "Structure":
        """Return the same structure with elements no longer than `element_length` [m].

        Raises
        ------
        ModelError
            If there would be too many of them.
        """
        members = tuple(
            member.model_copy(update={"elements": _count(member.length, element_length)}) for member in self.member
        )
        finer = self.model_copy(update={"member": members})
        try:
            check_size(finer)
        except ValueError as error:
            raise ModelError(f"elements of {element_length:g} m: {error}") from error
        return finer

    def with_bodies(self, bodies: Iterable[Body]) -> "Structure":
        """Return the same structure with bodies added."""
        return self.model_copy(update={"body": (*self.body, *bodies)})


def _count(length: float, element_length: float) -> int:
    return max(1, int(np.ceil(length / element_length - 1e-9)))


def _cut(member: dict[str, Any], element_length: float) -> dict[str, Any]:
    if "elements" in member:
        return member
    length = float(np.linalg.norm(np.subtract(member["to"], member["from"])))
    return member | {"elements": _count(length, element_length)}


def size(structure: Structure) -> float:
    """Return the length of the longest member, relative to 1.48 m [-]: the scale of offsets and neighbourhoods."""
    return max(member.length for member in structure.member) / _USUAL


def extent(structure: Structure) -> float:
    """Return the largest dimension along a global axis, relative to 1.48 m [-]; it does not depend on members' ends."""
    ends = np.array([end for member in structure.member for end in (member.start, member.end)])
    return float(np.ptp(ends, axis=0).max()) / _USUAL


def fineness(structure: Structure) -> float:
    """Return the scale [-] of spacings of places: `size`, at most 1."""
    return min(1.0, size(structure))
