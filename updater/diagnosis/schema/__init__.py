"""Values of a diagnosis, and their figures."""

from updater.diagnosis.schema.diagnosis import Diagnosis as Diagnosis
from updater.diagnosis.schema.values import Alternative as Alternative
from updater.diagnosis.schema.values import CalibrationSummary as CalibrationSummary
from updater.diagnosis.schema.values import Cause as Cause
from updater.diagnosis.schema.values import Failed as Failed
from updater.diagnosis.schema.values import FittedCause as FittedCause
from updater.diagnosis.schema.values import FrequencyFit as FrequencyFit
from updater.diagnosis.schema.values import Gain as Gain
from updater.diagnosis.schema.values import MassShift as MassShift
from updater.diagnosis.schema.values import MassTestFit as MassTestFit
from updater.diagnosis.schema.values import Measurement as Measurement
from updater.diagnosis.schema.values import Misfit as Misfit
from updater.diagnosis.schema.values import ModeFit as ModeFit
from updater.diagnosis.schema.values import NextMeasurement as NextMeasurement
from updater.diagnosis.schema.values import OtherStiffness as OtherStiffness
from updater.diagnosis.schema.values import Pair as Pair
from updater.diagnosis.schema.values import PairedModes as PairedModes
from updater.diagnosis.schema.values import Reason as Reason
from updater.diagnosis.schema.values import ReferenceStep as ReferenceStep
from updater.diagnosis.schema.values import Rejected as Rejected
from updater.diagnosis.schema.values import Separation as Separation
from updater.diagnosis.schema.values import SignalEvidence as SignalEvidence
from updater.diagnosis.schema.values import SmallestChange as SmallestChange
from updater.diagnosis.schema.values import Verdict as Verdict
