"""Modes and a structure in; a calibrated reference, mass updates and located changes out."""

from updater.accumulation import Sharpening, locate_and_sharpen, sharpening
from updater.baseline import learn_reference
from updater.calibration import Calibration, Parameter, calibrate, channel_rows
from updater.candidates import allowed_causes
from updater.causes.base import Discrete
from updater.change_point import ChangePoint, find_change, windows_of_one_state
from updater.channel_health import SensorHealth, sensor_health
from updater.circumstances import NOTHING_KNOWN, Circumstances, Trend, tone_ratios, trend_of
from updater.comparison import Comparison
from updater.delays import NO_DELAYS, DeviceDelays, estimate_delays, learn_delays, real_shape, remove_delays
from updater.detectability import Outlook, foresee, with_sensors
from updater.diagnosis import Explained, diagnose
from updater.discrepancy import Discrepancy, as_before, as_extended, as_written, set_beside
from updater.entries import Body, External, Joint, Material, Member, Oscillator, Recorder, Segment, Support, Updating
from updater.errors import (
    MechanismError,
    ModalDataError,
    ModelError,
    PairingError,
    SelectionError,
    StructureError,
    UpdaterError,
)
from updater.expected_noise import Record
from updater.expected_reference import UNSEEN, largest_motion, motion, seen_by
from updater.fe.assembly import build_model
from updater.fe.matrices import Matrices, read_matrices, save_matrices
from updater.fe.model import Model
from updater.fe.modes import Modes
from updater.fe.simulate import Ambient, AmbientResponse
from updater.fit import Fit
from updater.foresight import Foresight, Target
from updater.hinges import Hinges, hinges_of
from updater.increment_location import IncrementLocation
from updater.increments import Expansion, expand_changes, expand_shapes
from updater.knobs import check_updating
from updater.known_places import BodyRecord, BodySelection, select_bodies
from updater.localization import Alternative, BodyShape, MassChange, Stretch, locate_mass, open_question
from updater.mass_update import Flag, MassUpdate, MassUpdater
from updater.matching import match_modes, matched
from updater.modal_checks import doubles
from updater.modal_mass import ModalMass, mass_of_modes
from updater.new_modes import matched_and_new, matched_surely
from updater.nodal_masses import NodalMasses, spread_mass
from updater.nominal import nominal_reference
from updater.parameter_sensitivity import ParameterSensitivity, parameter_sensitivities
from updater.place_density import Density, densities
from updater.quantities import ParameterChange, Quantity, Where
from updater.reanalysis import Effect, no_effect
from updater.reference import Reference
from updater.residual_forces import ForceBalance, force_balance
from updater.scatter import Scatter, learn_scatter
from updater.section import Section
from updater.sensitivity import Prior, SensitivityFit, fit_parameters
from updater.sensor import Correction, Sensor
from updater.sensor_choice import Choice, ever_fewer, one_more, vagueness
from updater.several import MassChanges, locate_masses
from updater.steadiness import is_steady
from updater.stiffness_update import StiffnessUpdate, StiffnessUpdater
from updater.structure import Structure
from updater.structure_file import dump_structure, load_structure, parse_structure, portable_text, t_structure_toml
from updater.tracked import ModalMean, TrackedModes, mean_modes, stack_tracks
from updater.verdict import (
    CalibrationSummary,
    Cause,
    Diagnosis,
    Failed,
    FrequencyFit,
    Gain,
    ModeFit,
    Pair,
    ReferenceStep,
    Rejected,
    Verdict,
)
from updater.virtual_sensors import VirtualSensing, virtual_sensing

__all__ = [
    "NOTHING_KNOWN",
    "NO_DELAYS",
    "UNSEEN",
    "Alternative",
    "Ambient",
    "AmbientResponse",
    "Body",
    "BodyRecord",
    "BodySelection",
    "BodyShape",
    "Calibration",
    "CalibrationSummary",
    "Cause",
    "ChangePoint",
    "Choice",
    "Circumstances",
    "Comparison",
    "Correction",
    "Density",
    "DeviceDelays",
    "Diagnosis",
    "Discrepancy",
    "Discrete",
    "Effect",
    "Expansion",
    "Explained",
    "External",
    "Failed",
    "Fit",
    "Flag",
    "ForceBalance",
    "Foresight",
    "FrequencyFit",
    "Gain",
    "Hinges",
    "IncrementLocation",
    "Joint",
    "MassChange",
    "MassChanges",
    "MassUpdate",
    "MassUpdater",
    "Material",
    "Matrices",
    "MechanismError",
    "Member",
    "ModalDataError",
    "ModalMass",
    "ModalMean",
    "ModeFit",
    "Model",
    "ModelError",
    "Modes",
    "NodalMasses",
    "Oscillator",
    "Outlook",
    "Pair",
    "PairingError",
    "Parameter",
    "ParameterChange",
    "ParameterSensitivity",
    "Prior",
    "Quantity",
    "Record",
    "Recorder",
    "Reference",
    "ReferenceStep",
    "Rejected",
    "Scatter",
    "Section",
    "Segment",
    "SelectionError",
    "SensitivityFit",
    "Sensor",
    "SensorHealth",
    "Sharpening",
    "StiffnessUpdate",
    "StiffnessUpdater",
    "Stretch",
    "Structure",
    "StructureError",
    "Support",
    "Target",
    "TrackedModes",
    "Trend",
    "UpdaterError",
    "Updating",
    "Verdict",
    "VirtualSensing",
    "Where",
    "allowed_causes",
    "as_before",
    "as_extended",
    "as_written",
    "build_model",
    "calibrate",
    "channel_rows",
    "check_updating",
    "densities",
    "diagnose",
    "doubles",
    "dump_structure",
    "estimate_delays",
    "ever_fewer",
    "expand_changes",
    "expand_shapes",
    "find_change",
    "fit_parameters",
    "force_balance",
    "foresee",
    "hinges_of",
    "is_steady",
    "largest_motion",
    "learn_delays",
    "learn_reference",
    "learn_scatter",
    "load_structure",
    "locate_and_sharpen",
    "locate_mass",
    "locate_masses",
    "mass_of_modes",
    "match_modes",
    "matched",
    "matched_and_new",
    "matched_surely",
    "mean_modes",
    "motion",
    "no_effect",
    "nominal_reference",
    "one_more",
    "open_question",
    "parameter_sensitivities",
    "parse_structure",
    "portable_text",
    "read_matrices",
    "real_shape",
    "remove_delays",
    "save_matrices",
    "seen_by",
    "select_bodies",
    "sensor_health",
    "set_beside",
    "sharpening",
    "spread_mass",
    "stack_tracks",
    "t_structure_toml",
    "tone_ratios",
    "trend_of",
    "vagueness",
    "virtual_sensing",
    "windows_of_one_state",
    "with_sensors",
]
