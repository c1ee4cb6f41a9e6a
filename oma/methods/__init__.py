"""Identification methods behind one interface: SSI, pLSCF, FDD and its kin."""

from oma.methods.base import LevelModes, Method
from oma.methods.efdd import EFDD
from oma.methods.fdd import FDD
from oma.methods.fsdd import FSDD
from oma.methods.plscf import PLSCF
from oma.methods.response_modes import identify_responses
from oma.methods.ssi import CovarianceSSI, DataSSI

__all__ = ["EFDD", "FDD", "FSDD", "PLSCF", "CovarianceSSI", "DataSSI", "LevelModes", "Method", "identify_responses"]
