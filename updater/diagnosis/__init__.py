"""Diagnosis: causes fitted and compared, combined, named, and checked on data not used."""

from updater.diagnosis.case import DiagnosisResult
from updater.diagnosis.explanation import diagnose
from updater.diagnosis.naming import ODD
from updater.diagnosis.places import Density, densities
from updater.diagnosis.schema import (
    CalibrationSummary,
    Cause,
    Diagnosis,
    Failed,
    FrequencyFit,
    Gain,
    Instrument,
    KnownMass,
    LongerRecord,
    Measurements,
    Misfit,
    ModeFit,
    NewSensor,
    NextMeasurement,
    Pair,
    ReferenceStep,
    Rejected,
    Situation,
    Verdict,
)
from updater.diagnosis.weighing import allowed_causes

__all__ = [
    "ODD",
    "CalibrationSummary",
    "Cause",
    "Density",
    "Diagnosis",
    "DiagnosisResult",
    "Failed",
    "FrequencyFit",
    "Gain",
    "Instrument",
    "KnownMass",
    "LongerRecord",
    "Measurements",
    "Misfit",
    "ModeFit",
    "NewSensor",
    "NextMeasurement",
    "Pair",
    "ReferenceStep",
    "Rejected",
    "Situation",
    "Verdict",
    "allowed_causes",
    "densities",
    "diagnose",
]
