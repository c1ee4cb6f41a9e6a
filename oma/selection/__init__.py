"""Selection of modes among the poles of all model orders."""

from oma.selection.modes import Mode, candidates, distinct, physical, repeats_of_tones
from oma.selection.pole_uncertainty import PoleInfluence, block_std, normalised_move, pole_moves
from oma.selection.selection import BAND, Selection, groups, uncertainty_law
from oma.selection.stabilization_diagram import IndexArray, Stabilization, join, stabilization

__all__ = [
    "BAND",
    "IndexArray",
    "Mode",
    "PoleInfluence",
    "Selection",
    "Stabilization",
    "block_std",
    "candidates",
    "distinct",
    "groups",
    "join",
    "normalised_move",
    "physical",
    "pole_moves",
    "repeats_of_tones",
    "stabilization",
    "uncertainty_law",
]
