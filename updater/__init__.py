"""Modes and a structure in; a calibrated reference, mass updates and located changes out."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.baseline import learn_reference, nominal_reference
    from updater.diagnosis import Cause, Diagnosis, DiagnosisResult, Gain, diagnose
    from updater.errors import ModalDataError, ModelError, PairingError, StructureError, UpdaterError
    from updater.fe import (
        Matrices,
        Model,
        ProgramFiles,
        build_model,
        opensees_matrices,
        read_matrices,
        read_program_files,
        save_matrices,
    )
    from updater.localization import MassChange, locate_mass, locate_mass_with_forecast, locate_masses
    from updater.modal_data import (
        Circumstances,
        ModalMean,
        Scatter,
        TrackedModes,
        estimate_delays,
        learn_delays,
        learn_scatter,
        match_modes,
        matched,
        mean_modes,
        remove_delays,
        stack_tracks,
    )
    from updater.one_step import MassUpdate, MassUpdater, StiffnessUpdater
    from updater.planning import Record, study_detectability
    from updater.reference import Reference, calibrate
    from updater.structure import Body, Structure, dump_structure, load_structure, parse_structure, t_structure_toml
    from updater.validation import correlate_modes, force_balance, sensor_health, virtual_sensing
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "Body",
    "Cause",
    "Circumstances",
    "Diagnosis",
    "DiagnosisResult",
    "Gain",
    "MassChange",
    "MassUpdate",
    "MassUpdater",
    "Matrices",
    "ModalDataError",
    "ModalMean",
    "Model",
    "ModelError",
    "PairingError",
    "ProgramFiles",
    "Record",
    "Reference",
    "Scatter",
    "StiffnessUpdater",
    "Structure",
    "StructureError",
    "TrackedModes",
    "UpdaterError",
    "build_model",
    "calibrate",
    "correlate_modes",
    "diagnose",
    "dump_structure",
    "estimate_delays",
    "force_balance",
    "learn_delays",
    "learn_reference",
    "learn_scatter",
    "load_structure",
    "locate_mass",
    "locate_mass_with_forecast",
    "locate_masses",
    "match_modes",
    "matched",
    "mean_modes",
    "nominal_reference",
    "opensees_matrices",
    "parse_structure",
    "read_matrices",
    "read_program_files",
    "remove_delays",
    "save_matrices",
    "sensor_health",
    "stack_tracks",
    "study_detectability",
    "t_structure_toml",
    "virtual_sensing",
]
