"""Response where there is no sensor, as plain values: in JSON files."""

from typing import Literal

from updater.quantities import PlainValue, Quantity, Vector


class Motion(PlainValue):
    """Motion at a point, in the band."""

    position: Vector  #: [m]
    axis: Literal["x", "y", "z"]
    quantity: Literal["acceleration", "velocity", "displacement"]
    rms: Quantity  #: root mean square
    largest: float  #: largest absolute value, in the unit of `rms`


class SectionStress(PlainValue):
    """Normal stress of the vibration at the fibre of a section with the largest damage."""

    member: str
    distance: float  #: from the start of the member [m]
    fibre: tuple[float, float]  #: from the centroid along the local y and z axes [m]
    rms: Quantity  #: root mean square [Pa]
    equivalent_range: Quantity  #: constant range of the same damage, by a slope of 5 [Pa]
    largest_range: float  #: [Pa]
    cycles_per_hour: float
    category: float  #: of the detail: range at 2 million cycles [Pa]
    damage_per_year: float  #: 1 at failure
    damage_per_year_range: tuple[float, float]  #: with stresses a standard deviation smaller, and larger

    @property
    def life(self) -> tuple[float, float, float]:
        """Years to a damage of 1: of the estimate, and of stresses a standard deviation larger, and smaller."""
        low, high = self.damage_per_year_range
        years = [1 / damage if damage else float("inf") for damage in (self.damage_per_year, high, low)]
        return years[0], years[1], years[2]


class SensorError(PlainValue):
    """Prediction of a sensor from those at other places, compared with its signal in the band."""

    channel: str
    rms: float  #: root mean square of the signal [m/s2]
    error: float  #: root mean square of the difference [m/s2]
    std: float  #: stated standard deviation of the prediction [m/s2]
    within_two: float  #: share of the samples within two standard deviations [-]


class ResponseFound(PlainValue):
    """Response of logs at points and sections."""

    band: tuple[float, float]  #: of the signals [Hz]
    level: float  #: of the vibration over that of the reference [-]
    seconds: float  #: length of the estimated signals [s]
    motions: list[Motion]
    sections: list[SectionStress]
    sensors: list[SensorError]  #: empty unless they are predicted
