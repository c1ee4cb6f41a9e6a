"""Tables of the response where there is no sensor."""

from collections.abc import Sequence

from rich.console import Console

from daq.notebook import number_text, rounded_text
from monitor.cli.terminal import new_table
from monitor.results.response import Motion, ResponseFound, SectionStress, SensorError
from monitor.text.quantities import aligned_numbers, duration_words, two_digits

_PREFIXES = (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9))  # of units, and the factor of a value in SI units
_LEAST_SHOWN = 0.1  # of the rms in the unit that is printed
_LONGEST = 1e4  # years, beyond which no life is printed
_MPA = 1e-6


def say_response(console: Console, found: ResponseFound) -> None:
    """Print the motion at points, the stresses of sections and their fatigue."""
    low, high = found.band
    console.print(
        f"vibration between {low:.3g} and {high:.3g} Hz, {duration_words(found.seconds)}, "
        f"at {two_digits(found.level)} times the level of the reference",
    )
    if found.motions:
        _say_motions(console, found.motions)
    if found.sections:
        _say_sections(console, found.sections)
    if found.sensors:
        _say_sensors(console, found.sensors)


def _say_motions(console: Console, motions: Sequence[Motion]) -> None:
    table = new_table(("position [m]", "motion", "unit"), ("rms", "largest"), no_wrap=True)
    prefixes = [_prefix(motion.rms.value) for motion in motions]
    pairs = [(k * m.rms.value, k * m.rms.std) for m, (_, k) in zip(motions, prefixes, strict=True)]
    for motion, (prefix, scale), rms in zip(motions, prefixes, aligned_numbers(pairs), strict=True):
        place = ", ".join(f"{value:.3f}" for value in motion.position)
        table.add_row(
            place,
            f"{motion.quantity} {motion.axis}",
            prefix + motion.rms.unit,
            rms,
            rounded_text(scale * motion.largest, scale * motion.rms.std),
        )
    console.print(table)


def _prefix(value: float) -> tuple[str, float]:
    """Return the prefix of the unit in which a value has digits before, or just behind, its point; and its factor."""
    return next((one for one in _PREFIXES if one[1] * value >= _LEAST_SHOWN), _PREFIXES[-1])


def _say_sections(console: Console, sections: Sequence[SectionStress]) -> None:
    names = ("rms [MPa]", "largest [MPa]", "cycles per h", "life [years]", "from", "to")
    table = new_table(("section",), names, overflow="fold")
    for own in sections:
        table.add_row(
            f"{own.member} at {own.distance:g} m",
            number_text(_MPA * own.rms.value, _MPA * own.rms.std),
            rounded_text(_MPA * own.largest_range, _MPA * own.rms.std),
            f"{own.cycles_per_hour:.0f}",
            *(two_digits(years) if years < _LONGEST else f"> {_LONGEST:.0f}" for years in own.life),
        )
    console.print(table)
    console.print(
        f"largest: range from valley to peak; life: at detail category {_MPA * sections[0].category:g} of EN 1993-1-9, "
        "by the vibration of these logs alone, without partial factors; from and to with stresses a standard deviation "
        "larger and smaller",
        style="dim",
    )


def _say_sensors(console: Console, sensors: Sequence[SensorError]) -> None:
    table = new_table(("sensor",), ("rms [m/s2]", "error", "stated deviation", "within 2 deviations"))
    for own in sensors:
        shares = (own.error / own.rms, own.std / own.rms, own.within_two) if own.rms else ()
        table.add_row(own.channel, f"{own.rms:.3g}", *(f"{100 * share:.0f} %" for share in shares))
    console.print(table)
    console.print(
        "error: root mean square of the difference from the prediction by the sensors at other places, and stated "
        "deviation, both relative to the signal; about 95 % of the samples are expected within 2 deviations",
        style="dim",
    )
