"""The catalogue: every cause that a diagnosis may name, one file each."""

from updater.causes.base import CatalogueEntry, Cause, Discrete, Nothing, Parametric, Placed, Propose, Sized
from updater.causes.catalogue import CATALOGUE
from updater.causes.composite import JointHypothesis, SelectedCause
from updater.causes.joint_prediction import effect_of, mac_of, prediction
from updater.causes.mass.added_mass import DENSITY_STD, LARGEST_REMOVED, AddedMass, propose_added_mass
from updater.causes.mass.attached_oscillator import has_unobserved_mode
from updater.causes.mass.several_bodies import PER_BODY, Bodies
from updater.causes.modal_loads import modal_section_forces
from updater.causes.model.parameters import ModelParameters, propose_model_parameters
from updater.causes.overall.common_factor import CommonFactor
from updater.causes.sensors.delay import begin_at
from updater.causes.sensors.gain_polarity_swap import SensorGain
from updater.causes.sensors.position import SensorPosition
from updater.causes.stiffness.connections import CONNECTIONS
from updater.causes.stiffness.local_stiffness import LocalStiffness

__all__ = [
    "CATALOGUE",
    "CONNECTIONS",
    "DENSITY_STD",
    "LARGEST_REMOVED",
    "PER_BODY",
    "AddedMass",
    "Bodies",
    "CatalogueEntry",
    "Cause",
    "CommonFactor",
    "Discrete",
    "JointHypothesis",
    "LocalStiffness",
    "ModelParameters",
    "Nothing",
    "Parametric",
    "Placed",
    "Propose",
    "SelectedCause",
    "SensorGain",
    "SensorPosition",
    "Sized",
    "begin_at",
    "effect_of",
    "has_unobserved_mode",
    "mac_of",
    "modal_section_forces",
    "prediction",
    "propose_added_mass",
    "propose_model_parameters",
]
