"""The paper's one-step update: lumped masses, increments, their significance and location."""

from updater.one_step.increments import Expansion as Expansion
from updater.one_step.increments import expand_changes as expand_changes
from updater.one_step.increments import expand_shapes as expand_shapes
from updater.one_step.location import IncrementLocation as IncrementLocation
from updater.one_step.mass_update import MassUpdate as MassUpdate
from updater.one_step.mass_update import MassUpdater as MassUpdater
from updater.one_step.stiffness_update import StiffnessUpdater as StiffnessUpdater
