"""Diagnosis: causes fitted and compared, combined, named, and checked on data not used."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.diagnosis.case import DiagnosisResult
    from updater.diagnosis.explanation import diagnose
    from updater.diagnosis.places import Density, densities
    from updater.diagnosis.schema import (
        Alternative,
        CalibrationSummary,
        Cause,
        Diagnosis,
        Failed,
        FittedCause,
        FrequencyFit,
        Gain,
        Measurement,
        Misfit,
        ModeFit,
        NextMeasurement,
        Pair,
        ReferenceStep,
        Rejected,
        Separation,
        SmallestChange,
        Verdict,
    )
    from updater.diagnosis.weighing import OnCause, allowed_causes, say_nothing
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "Alternative",
    "CalibrationSummary",
    "Cause",
    "Density",
    "Diagnosis",
    "DiagnosisResult",
    "Failed",
    "FittedCause",
    "FrequencyFit",
    "Gain",
    "Measurement",
    "Misfit",
    "ModeFit",
    "NextMeasurement",
    "OnCause",
    "Pair",
    "ReferenceStep",
    "Rejected",
    "Separation",
    "SmallestChange",
    "Verdict",
    "allowed_causes",
    "densities",
    "diagnose",
    "say_nothing",
]
