"""Modes and a structure in; a calibrated reference, mass updates and located changes out."""

from updater.baseline.learned_reference import learn_reference
from updater.baseline.nominal_reference import nominal_reference
from updater.causes.base import Discrete
from updater.diagnosis.diagnose import Explained, diagnose
from updater.diagnosis.places import Density, densities
from updater.diagnosis.schema import (
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
from updater.diagnosis.weighing import allowed_causes
from updater.errors import (
    MechanismError,
    ModalDataError,
    ModelError,
    PairingError,
    SelectionError,
    StructureError,
    UpdaterError,
)
from updater.fe.assembly import build_model
from updater.fe.eigen import Modes
from updater.fe.external.files import Matrices, read_matrices, save_matrices
from updater.fe.model import Model
from updater.fe.response import Ambient, AmbientResponse
from updater.fe.rotations import Hinges, hinges_of
from updater.inference.comparison import Comparison
from updater.inference.fit import Fit
from updater.inference.reanalysis import Effect, no_effect
from updater.localization.known_places import BodyRecord, BodySelection, select_bodies
from updater.localization.more_windows import Sharpening, locate_and_sharpen, sharpening
from updater.localization.nodal_masses import NodalMasses, spread_mass
from updater.localization.one_mass import Alternative, BodyShape, MassChange, Stretch, locate_mass, open_question
from updater.localization.several_masses import MassChanges, locate_masses
from updater.modal_data.change_point import ChangePoint, find_change, windows_of_one_state
from updater.modal_data.conditions import NOTHING_KNOWN, Circumstances, Trend, tone_ratios, trend_of
from updater.modal_data.device_delays import (
    NO_DELAYS,
    DeviceDelays,
    estimate_delays,
    learn_delays,
    real_shape,
    remove_delays,
)
from updater.modal_data.mass_from_modes import ModalMass, mass_of_modes
from updater.modal_data.matching import match_modes, matched
from updater.modal_data.plausibility import doubles
from updater.modal_data.scatter import Scatter, learn_scatter
from updater.modal_data.stationarity import is_steady
from updater.modal_data.tracked import ModalMean, TrackedModes, mean_modes, stack_tracks
from updater.one_step.increments import Expansion, expand_changes, expand_shapes
from updater.one_step.location import IncrementLocation
from updater.one_step.mass_update import Flag, MassUpdate, MassUpdater
from updater.one_step.stiffness_update import StiffnessUpdate, StiffnessUpdater
from updater.planning.detectability import Outlook, foresee, with_sensors
from updater.planning.expected_reference import UNSEEN, largest_motion, motion, seen_by
from updater.planning.record_length import Foresight, Target
from updater.planning.record_noise import Record
from updater.planning.sensor_placement import Choice, ever_fewer, one_more, vagueness
from updater.quantities import ParameterChange, Quantity, Where
from updater.reference.calibration import Calibration, Parameter, calibrate, channel_rows
from updater.reference.new_modes import matched_and_new, matched_surely
from updater.reference.parameter_sensitivity import ParameterSensitivity, parameter_sensitivities
from updater.reference.reference import Reference
from updater.reference.sensitivity_method import Prior, SensitivityFit, fit_parameters
from updater.structure.entries import (
    Body,
    External,
    Joint,
    Material,
    Member,
    Oscillator,
    Recorder,
    Segment,
    Support,
    Updating,
)
from updater.structure.parameters import check_updating
from updater.structure.sections import Section
from updater.structure.sensors import Correction, Sensor
from updater.structure.structure import Structure
from updater.structure.toml_file import dump_structure, load_structure, parse_structure, portable_text, t_structure_toml
from updater.validation.modal_correlation import Discrepancy, as_before, as_extended, as_written, set_beside
from updater.validation.residual_forces import ForceBalance, force_balance
from updater.validation.sensor_health import SensorHealth, sensor_health
from updater.validation.virtual_sensing import VirtualSensing, virtual_sensing

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
