"""Finite elements of a frame: elements, assembly, modes and response."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.fe.assembly import build_model
    from updater.fe.eigen import Modes
    from updater.fe.element import Element
    from updater.fe.external.files import Matrices, read_matrices, save_matrices
    from updater.fe.external.groups import group_strains
    from updater.fe.external.programs.conversion import ProgramFiles, read_program_files
    from updater.fe.external.programs.opensees import opensees_matrices
    from updater.fe.model import Model
    from updater.fe.redundants import self_stress
    from updater.fe.response import Ambient, AmbientResponse
    from updater.fe.rotations import Hinges, flexibility, hinges_of
    from updater.fe.section_forces import elastic_energy, parts_between, section_rigidity, weighted_actions
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "Ambient",
    "AmbientResponse",
    "Element",
    "Hinges",
    "Matrices",
    "Model",
    "Modes",
    "ProgramFiles",
    "build_model",
    "elastic_energy",
    "flexibility",
    "group_strains",
    "hinges_of",
    "opensees_matrices",
    "parts_between",
    "read_matrices",
    "read_program_files",
    "save_matrices",
    "section_rigidity",
    "self_stress",
    "weighted_actions",
]
