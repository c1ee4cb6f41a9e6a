"""[[sensor]]: positions of channels, for pictures of a site without a model."""

from typing import Annotated

from pydantic import AfterValidator, Field

from monitor.settings.section import Section
from updater.quantities import Vector


def _not_zero(direction: Vector) -> Vector:
    if not any(direction):
        raise ValueError("expected a direction, found [0, 0, 0]")
    return direction


class SensorSettings(Section):
    """Position of a channel, as in a structure file: mode shapes are drawn there. Not used with `structure`."""

    channel: Annotated[str, Field(examples=["beam_left_y"])]
    """Name of the channel, as in `channels` of a device."""
    at: Annotated[Vector, Field(examples=[[0.0, 0.0, 0.9]])]
    """Position x, y, z [m]; z is up."""
    direction: Annotated[Vector, AfterValidator(_not_zero), Field(examples=[[0.0, 1.0, 0.0]])]
    """Direction of positive values, along x, y, z; of any length."""
