"""Finite elements of a frame: elements, assembly, modes and response."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.fe.assembly import build_model as build_model
    from updater.fe.crack import Crack as Crack
    from updater.fe.eigen import Modes as Modes
    from updater.fe.element import Element as Element
    from updater.fe.external.files import Matrices as Matrices
    from updater.fe.external.files import read_matrices as read_matrices
    from updater.fe.external.files import save_matrices as save_matrices
    from updater.fe.external.groups import group_strains as group_strains
    from updater.fe.external.programs.conversion import ProgramFiles as ProgramFiles
    from updater.fe.external.programs.conversion import read_program_files as read_program_files
    from updater.fe.external.programs.opensees import opensees_matrices as opensees_matrices
    from updater.fe.model import Model as Model
    from updater.fe.redundants import self_stress as self_stress
    from updater.fe.response import Ambient as Ambient
    from updater.fe.response import AmbientResponse as AmbientResponse
    from updater.fe.rotations import Hinges as Hinges
    from updater.fe.rotations import flexibility as flexibility
    from updater.fe.rotations import hinges_of as hinges_of
    from updater.fe.section_forces import elastic_energy as elastic_energy
    from updater.fe.section_forces import parts_between as parts_between
    from updater.fe.section_forces import section_rigidity as section_rigidity
    from updater.fe.section_forces import weighted_actions as weighted_actions
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
