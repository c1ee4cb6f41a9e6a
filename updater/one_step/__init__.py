"""The paper's one-step update: lumped masses, increments, their significance and location."""

from updater.one_step.increments import Expansion, expand_changes, expand_shapes
from updater.one_step.location import IncrementLocation
from updater.one_step.mass_update import MassUpdate, MassUpdater
from updater.one_step.stiffness_update import StiffnessUpdater

__all__ = [
    "Expansion",
    "IncrementLocation",
    "MassUpdate",
    "MassUpdater",
    "StiffnessUpdater",
    "expand_changes",
    "expand_shapes",
]
