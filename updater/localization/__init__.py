"""Location of one or several masses."""

from updater.localization.known_places import BodyRecord, BodySelection, select_bodies
from updater.localization.more_windows import AccuracyForecast, locate_mass_with_forecast, sharpening
from updater.localization.nodal_masses import NodalMasses, spread_mass
from updater.localization.one_mass import Alternative, BodyShape, MassChange, Stretch, locate_mass, mirrored
from updater.localization.several_masses import MassChanges, locate_masses

__all__ = [
    "AccuracyForecast",
    "Alternative",
    "BodyRecord",
    "BodySelection",
    "BodyShape",
    "MassChange",
    "MassChanges",
    "NodalMasses",
    "Stretch",
    "locate_mass",
    "locate_mass_with_forecast",
    "locate_masses",
    "mirrored",
    "select_bodies",
    "sharpening",
    "spread_mass",
]
