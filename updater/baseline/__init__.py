"""References learned from baseline windows, or taken from the structure file."""

from updater.baseline.learned_reference import learn_reference as learn_reference
from updater.baseline.learned_reference import nominal_reference as nominal_reference
from updater.baseline.learned_reference import with_bodies_on as with_bodies_on
from updater.baseline.learned_reference import with_springs_at as with_springs_at
