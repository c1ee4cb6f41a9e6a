"""How large a structure is: lengths that are usual on one of 1.5 m are not on a bridge or on a bracket of 5 cm."""

from updater.structure import Structure

_USUAL = 1.48  # m, the longest member of the frame that lengths were chosen on


def size(structure: Structure) -> float:
    """Return the longest member over that of the usual frame: what a body's offset or a neighbourhood scales by."""
    return max(member.length for member in structure.member) / _USUAL


def fineness(structure: Structure) -> float:
    """Return what spacings of places scale by: small structures need smaller ones, large ones bear the usual."""
    return min(1.0, size(structure))
