"""Reference with the diagnosed structural causes applied; sensor health is evaluated against it."""

from dataclasses import replace

import numpy as np

from updater.modal_data import match_modes
from updater.reference import Reference
from updater.structure import Correction, Structure
from updater.validation.modal_correlation import modes_with_causes

# parts of a structure that belong to the measuring chain, in addition to `sensors`
_OF_THE_CHAIN = ("sensor", "recorder")


def with_acting(reference: Reference, extended: Structure) -> Reference:
    """Return a reference whose baseline has the shapes expected with the causes in the structure.

    Frequencies are unchanged: their shift measures how much of a change is unknown. Effects of causes on the measuring
    chain are left out, except exchanged channels: each is evaluated with its actual sensor, or both would appear
    faulty.

    Parameters
    ----------
    reference : that was diagnosed
    extended : its structure with the causes written in
    """
    own, base = reference.structure, reference.baseline
    kept: dict[str, object] = {name: getattr(own, name) for name in _OF_THE_CHAIN}
    carriers = {name: correction.channel for name, correction in extended.sensors.items()}
    kept["sensors"] = {
        sensor.channel: own.sensors.get(sensor.channel, Correction()).model_copy(
            update={"channel": carriers.get(sensor.channel)}
        )
        for sensor in own.sensor
    }
    acted = extended.model_copy(update=kept)
    after = modes_with_causes(reference, acted, base)
    partner = match_modes(base, after)
    shape = np.where((partner >= 0)[:, None], after.shape[partner], base.shape)
    return replace(reference, baseline=replace(base, shape=shape))
