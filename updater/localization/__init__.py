"""Location of one or several masses."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.localization.known_places import BodyRecord, BodySelection, select_bodies
    from updater.localization.more_windows import AccuracyForecast, locate_mass_with_forecast, sharpening
    from updater.localization.nodal_masses import spread_mass
    from updater.localization.one_mass import MassChange, locate_mass
    from updater.localization.several_masses import MassChanges, locate_masses
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "AccuracyForecast",
    "BodyRecord",
    "BodySelection",
    "MassChange",
    "MassChanges",
    "locate_mass",
    "locate_mass_with_forecast",
    "locate_masses",
    "select_bodies",
    "sharpening",
    "spread_mass",
]
