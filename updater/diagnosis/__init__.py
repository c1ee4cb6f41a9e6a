"""Diagnosis: causes fitted and compared, combined, named, and checked on data not used."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.diagnosis.case import DiagnosisResult as DiagnosisResult
    from updater.diagnosis.explanation import diagnose as diagnose
    from updater.diagnosis.places import Density as Density
    from updater.diagnosis.places import densities as densities
    from updater.diagnosis.schema import Alternative as Alternative
    from updater.diagnosis.schema import CalibrationSummary as CalibrationSummary
    from updater.diagnosis.schema import Cause as Cause
    from updater.diagnosis.schema import Diagnosis as Diagnosis
    from updater.diagnosis.schema import Failed as Failed
    from updater.diagnosis.schema import FittedCause as FittedCause
    from updater.diagnosis.schema import FrequencyFit as FrequencyFit
    from updater.diagnosis.schema import Gain as Gain
    from updater.diagnosis.schema import MassTestFit as MassTestFit
    from updater.diagnosis.schema import Measurement as Measurement
    from updater.diagnosis.schema import Misfit as Misfit
    from updater.diagnosis.schema import ModeFit as ModeFit
    from updater.diagnosis.schema import NextMeasurement as NextMeasurement
    from updater.diagnosis.schema import OtherStiffness as OtherStiffness
    from updater.diagnosis.schema import Pair as Pair
    from updater.diagnosis.schema import ReferenceStep as ReferenceStep
    from updater.diagnosis.schema import Rejected as Rejected
    from updater.diagnosis.schema import Separation as Separation
    from updater.diagnosis.schema import SignalEvidence as SignalEvidence
    from updater.diagnosis.schema import SmallestChange as SmallestChange
    from updater.diagnosis.schema import Verdict as Verdict
    from updater.diagnosis.schema.figures import diagnosis_figure as diagnosis_figure
    from updater.diagnosis.schema.figures import evidence_figure as evidence_figure
    from updater.diagnosis.schema.figures import fits_figure as fits_figure
    from updater.diagnosis.weighing import OnCause as OnCause
    from updater.diagnosis.weighing import allowed_causes as allowed_causes
    from updater.diagnosis.weighing import say_nothing as say_nothing
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
