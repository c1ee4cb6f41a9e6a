"""References learned from baseline windows, or taken from the structure file."""

from updater.baseline.learned_reference import learn_reference, with_bodies_on
from updater.baseline.nominal import nominal_reference

__all__ = ["learn_reference", "nominal_reference", "with_bodies_on"]
