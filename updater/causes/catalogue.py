"""Every cause that a diagnosis may name, by its name; a new one is a line here and is tested with the others."""

import logging
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points

from updater.causes.base import CatalogueEntry, Cause
from updater.causes.mass.added_mass import propose_added_mass
from updater.causes.mass.attached_oscillator import propose_attached_oscillator
from updater.causes.mass.distributed_mass import propose_distributed_mass
from updater.causes.model.coarse_mesh import propose_mesh_error
from updater.causes.model.parameters import propose_model_parameters
from updater.causes.overall.amplitude_softening import propose_amplitude_softening
from updater.causes.overall.damping_change import propose_damping_change
from updater.causes.overall.density import propose_global_density
from updater.causes.overall.sampling_clock import propose_sampling_clock
from updater.causes.overall.stiffness import propose_global_stiffness
from updater.causes.overall.temperature import propose_temperature
from updater.causes.sensors.dead import propose_sensor_dead
from updater.causes.sensors.delay import propose_sensor_delay
from updater.causes.sensors.gain_polarity_swap import propose_sensor_gain, propose_sensor_polarity, propose_sensor_swap
from updater.causes.sensors.orientation import propose_sensor_orientation
from updater.causes.sensors.position import propose_sensor_position
from updater.causes.stiffness.added_support import propose_support_spring
from updater.causes.stiffness.axial_force import propose_axial_force
from updater.causes.stiffness.connections import propose_joint_stiffness, propose_support_stiffness
from updater.causes.stiffness.ground_mode import propose_ground_mode
from updater.causes.stiffness.group_stiffness import propose_group_stiffness
from updater.causes.stiffness.local_stiffness import propose_local_stiffness
from updater.causes.stiffness.member_temperature import propose_member_temperature
from updater.causes.stiffness.one_axis_stiffness import propose_one_sided_stiffness
from updater.inference import Comparison
from updater.reference import Reference

GROUP = "modalwatch.causes"
_log = logging.getLogger(__name__)


class Catalogue(Mapping[str, CatalogueEntry]):
    """Built-in causes, followed by installed ones, which are loaded at first use.

    Parameters
    ----------
    own : causes by name, which no other can replace
    """

    def __init__(self, own: Mapping[str, CatalogueEntry]) -> None:
        self._own = own

    @cached_property
    def _all(self) -> Mapping[str, CatalogueEntry]:
        found = dict(self._own)
        for entry in sorted(entry_points(group=GROUP), key=lambda e: e.name):
            propose = _usable(entry, found)
            if propose is not None:
                found[entry.name] = propose
        return found

    def __getitem__(self, name: str) -> CatalogueEntry:
        """Return a cause and its relations."""
        return self._all[name]

    def __iter__(self) -> Iterator[str]:
        """Go through the names, our own first."""
        return iter(self._all)

    def __len__(self) -> int:
        """Count them."""
        return len(self._all)


def _usable(entry: EntryPoint, known: Mapping[str, object]) -> CatalogueEntry | None:
    """Load a cause; one that cannot be used is named and left out, so that the others can be."""
    try:
        propose = entry.load()
    except Exception as error:  # noqa: BLE001 - a stranger's module may raise anything at all
        problem = f"{type(error).__name__}: {error}"
    else:
        made = propose if isinstance(propose, CatalogueEntry) else None
        if made is None and callable(propose):
            made = CatalogueEntry(propose=propose)
        if entry.name not in known and made is not None:
            return made
        problem = "that name is taken" if entry.name in known else f"expected a function, found {propose!r}"
    _log.warning("cause %s (%s) is left out: %s", entry.name, entry.value, " ".join(problem.split()))
    return None


def _propose_local_stiffness(reference: Reference, comparison: Comparison) -> Cause | None:
    """Return stretches of members, or the groups of external matrices."""
    return propose_local_stiffness(reference, comparison) or propose_group_stiffness(reference, comparison)


_OWN: dict[str, CatalogueEntry] = {
    "added_mass": CatalogueEntry(propose=propose_added_mass),
    "global_stiffness": CatalogueEntry(propose=propose_global_stiffness),
    "global_density": CatalogueEntry(propose=propose_global_density),
    "temperature": CatalogueEntry(propose=propose_temperature),
    "sampling_clock": CatalogueEntry(propose=propose_sampling_clock),
    "local_stiffness": CatalogueEntry(propose=_propose_local_stiffness, relaxed=propose_one_sided_stiffness),
    # a body at a point is twenty times as common as a distributed mass, which lies on the axis here, whereas the
    # offsets of a body are fitted (1 / 15, the prior volume of the offsets)
    "distributed_mass": CatalogueEntry(propose=propose_distributed_mass, rarity=1 / 300, common_form="added_mass"),
    "axial_force": CatalogueEntry(propose=propose_axial_force),
    "member_temperature": CatalogueEntry(propose=propose_member_temperature),
    "support_spring": CatalogueEntry(propose=propose_support_spring),
    "attached_oscillator": CatalogueEntry(propose=propose_attached_oscillator),
    "ground_mode": CatalogueEntry(propose=propose_ground_mode),
    "mesh_error": CatalogueEntry(propose=propose_mesh_error),
    "model_parameters": CatalogueEntry(propose=propose_model_parameters, of_the_file=True),
    "damping_change": CatalogueEntry(propose=propose_damping_change),
    "amplitude_softening": CatalogueEntry(propose=propose_amplitude_softening),
    "support_stiffness": CatalogueEntry(propose=propose_support_stiffness),
    "joint_stiffness": CatalogueEntry(propose=propose_joint_stiffness),
    "sensor_gain": CatalogueEntry(propose=propose_sensor_gain),
    "sensor_polarity": CatalogueEntry(propose=propose_sensor_polarity),
    "sensor_swap": CatalogueEntry(propose=propose_sensor_swap),
    "sensor_orientation": CatalogueEntry(propose=propose_sensor_orientation),
    "sensor_position": CatalogueEntry(propose=propose_sensor_position),
    "sensor_delay": CatalogueEntry(propose=propose_sensor_delay),
    "sensor_dead": CatalogueEntry(propose=propose_sensor_dead),
}

CATALOGUE: Mapping[str, CatalogueEntry] = Catalogue(_OWN)
