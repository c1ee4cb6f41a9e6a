"""Every cause that a diagnosis may name, by its name; a new one is a line here and is tested with the others."""

from collections.abc import Mapping

from updater.causes.added_mass import propose_added_mass
from updater.causes.amplitude_softening import propose_amplitude_softening
from updater.causes.attached_oscillator import propose_attached_oscillator
from updater.causes.axial_force import propose_axial_force
from updater.causes.base import Cause, Propose
from updater.causes.damping_change import propose_damping_change
from updater.causes.distributed_mass import propose_distributed_mass
from updater.causes.global_density import propose_global_density
from updater.causes.global_stiffness import propose_global_stiffness
from updater.causes.local_stiffness import propose_local_stiffness
from updater.causes.mesh_error import propose_mesh_error
from updater.causes.model_parameters import propose_model_parameters
from updater.causes.plugins import Catalogue
from updater.causes.sampling_clock import propose_sampling_clock
from updater.causes.sensor_dead import propose_sensor_dead
from updater.causes.sensor_delay import propose_sensor_delay
from updater.causes.sensor_orientation import propose_sensor_orientation
from updater.causes.sensors import propose_sensor_gain, propose_sensor_polarity, propose_sensor_swap
from updater.causes.springs import propose_joint_stiffness, propose_support_stiffness
from updater.causes.support_spring import propose_support_spring
from updater.causes.temperature import propose_temperature

_OWN: dict[str, Propose[Cause]] = {
    "added_mass": propose_added_mass,
    "global_stiffness": propose_global_stiffness,
    "global_density": propose_global_density,
    "temperature": propose_temperature,
    "sampling_clock": propose_sampling_clock,
    "local_stiffness": propose_local_stiffness,
    "distributed_mass": propose_distributed_mass,
    "axial_force": propose_axial_force,
    "support_spring": propose_support_spring,
    "attached_oscillator": propose_attached_oscillator,
    "mesh_error": propose_mesh_error,
    "model_parameters": propose_model_parameters,
    "damping_change": propose_damping_change,
    "amplitude_softening": propose_amplitude_softening,
    "support_stiffness": propose_support_stiffness,
    "joint_stiffness": propose_joint_stiffness,
    "sensor_gain": propose_sensor_gain,
    "sensor_polarity": propose_sensor_polarity,
    "sensor_swap": propose_sensor_swap,
    "sensor_orientation": propose_sensor_orientation,
    "sensor_delay": propose_sensor_delay,
    "sensor_dead": propose_sensor_dead,
}

CATALOGUE: Mapping[str, Propose[Cause]] = Catalogue(_OWN)

#: prior probability over that of any other cause: a body clamped on is twenty times as common as one laid along a
#: member, and what is laid there lies on the axis here, where a body must find its offsets (1 / 15, by what they cost)
RARITY: Mapping[str, float] = {"distributed_mass": 1 / 300}
