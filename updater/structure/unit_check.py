"""Check of a structure file for values that are legal but probably in other units than SI."""

import math

from updater.structure.structure import Structure

_SLOWEST, _FASTEST = 100.0, 30_000.0  # m/s: rubber, and twice diamond


def odd_units(structure: Structure) -> list[str]:
    """Return a line for each material and section that no structure is built of.

    A material is judged by the speed of waves along a bar, in which megapascals and g/cm3 show; a section by how far
    from its axis it lies, over the largest extent of the structure, in which millimetres show.
    """
    ends = [point for member in structure.member for point in (member.start, member.end)]
    extent = max(max(axis) - min(axis) for axis in zip(*ends, strict=True))
    notes = []
    for name, material in structure.material.items():
        speed = math.sqrt(material.youngs_modulus / material.density)
        if not _SLOWEST < speed < _FASTEST:
            notes.append(
                f"material {name}: waves would run through it at {speed:.2g} m/s (steel: 5200); "
                "is youngs_modulus in Pa, density in kg/m3?"
            )
    for name, section in structure.section.items():
        radius = math.sqrt(max(section.second_moment) / section.area)
        if radius > extent:
            notes.append(
                f"section {name}: its radius of gyration is {radius:.3g} m, the whole structure {extent:.3g} m long; "
                "is it in m, m2, m4?"
            )
    return notes
