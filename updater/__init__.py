"""Modes and a structure in; a calibrated reference, mass updates and located changes out."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.baseline import learn_reference as learn_reference
    from updater.baseline import nominal_reference as nominal_reference
    from updater.diagnosis import Cause as Cause
    from updater.diagnosis import Diagnosis as Diagnosis
    from updater.diagnosis import DiagnosisResult as DiagnosisResult
    from updater.diagnosis import Gain as Gain
    from updater.diagnosis import diagnose as diagnose
    from updater.errors import ModalDataError as ModalDataError
    from updater.errors import ModelError as ModelError
    from updater.errors import PairingError as PairingError
    from updater.errors import StructureError as StructureError
    from updater.errors import UpdaterError as UpdaterError
    from updater.fe import Matrices as Matrices
    from updater.fe import Model as Model
    from updater.fe import ProgramFiles as ProgramFiles
    from updater.fe import build_model as build_model
    from updater.fe import opensees_matrices as opensees_matrices
    from updater.fe import read_matrices as read_matrices
    from updater.fe import read_program_files as read_program_files
    from updater.fe import save_matrices as save_matrices
    from updater.localization import MassChange as MassChange
    from updater.localization import locate_mass as locate_mass
    from updater.localization import locate_mass_with_forecast as locate_mass_with_forecast
    from updater.localization import locate_masses as locate_masses
    from updater.modal_data import Circumstances as Circumstances
    from updater.modal_data import ModalMean as ModalMean
    from updater.modal_data import Scatter as Scatter
    from updater.modal_data import TrackedModes as TrackedModes
    from updater.modal_data import estimate_delays as estimate_delays
    from updater.modal_data import learn_delays as learn_delays
    from updater.modal_data import learn_scatter as learn_scatter
    from updater.modal_data import match_modes as match_modes
    from updater.modal_data import matched as matched
    from updater.modal_data import mean_modes as mean_modes
    from updater.modal_data import remove_delays as remove_delays
    from updater.modal_data import stack_tracks as stack_tracks
    from updater.one_step import MassUpdate as MassUpdate
    from updater.one_step import MassUpdater as MassUpdater
    from updater.one_step import StiffnessUpdater as StiffnessUpdater
    from updater.planning import Record as Record
    from updater.planning import study_detectability as study_detectability
    from updater.reference import Reference as Reference
    from updater.reference import calibrate as calibrate
    from updater.structure import Body as Body
    from updater.structure import Structure as Structure
    from updater.structure import dump_structure as dump_structure
    from updater.structure import load_structure as load_structure
    from updater.structure import parse_structure as parse_structure
    from updater.structure import t_structure_toml as t_structure_toml
    from updater.validation import correlate_modes as correlate_modes
    from updater.validation import force_balance as force_balance
    from updater.validation import sensor_health as sensor_health
    from updater.validation import virtual_sensing as virtual_sensing
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
