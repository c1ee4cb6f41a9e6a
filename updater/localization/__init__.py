"""Location of one or several masses."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.localization.known_places import BodyRecord as BodyRecord
    from updater.localization.known_places import BodySelection as BodySelection
    from updater.localization.known_places import select_bodies as select_bodies
    from updater.localization.more_windows import AccuracyForecast as AccuracyForecast
    from updater.localization.more_windows import locate_mass_with_forecast as locate_mass_with_forecast
    from updater.localization.more_windows import sharpening as sharpening
    from updater.localization.nodal_masses import spread_mass as spread_mass
    from updater.localization.one_mass import MassChange as MassChange
    from updater.localization.one_mass import locate_mass as locate_mass
    from updater.localization.several_masses import MassChanges as MassChanges
    from updater.localization.several_masses import locate_masses as locate_masses
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
