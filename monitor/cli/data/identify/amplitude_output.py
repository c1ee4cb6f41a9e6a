"""Dependence of modes on their amplitude as a table and as JSON."""

from collections.abc import Iterator, Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from daq.notebook import rounded_text
from monitor.cli.terminal import console, new_table
from monitor.text.quantities import aligned_numbers
from oma import AmplitudeDependence, ModalEstimate

_LEVEL = 0.01  # probability that any mode of a linear structure is marked


def dependence_json(found: AmplitudeDependence | None) -> dict[str, Any] | None:
    """Return the dependence of one mode for other programs; None if it could not be tested."""
    if found is None:
        return None
    return {"rms": found.amplitude, "channel": found.channel} | {
        name: {"slope": slope.value, "std": slope.std, "p_value": slope.p_value}
        for name, slope in (("frequency", found.frequency), ("damping", found.damping))
    }


def say_dependence(estimate: ModalEstimate, found: Sequence[AmplitudeDependence | None]) -> None:
    """Print the slopes of all modes, and the values at small and large amplitude where a slope is significant."""
    tested = {i: one for i, one in enumerate(found) if one}
    if tested:
        console.print(_table(tested))
    sentences = list(_sentences(estimate, tested))
    for sentence in sentences:
        console.print(escape(sentence))
    if tested and not sentences:
        console.print("no mode depends significantly on its amplitude")
    if missing := [str(i + 1) for i in range(estimate.n_modes) if i not in tested]:
        reasons = "the record is too short, noise is too strong, or blows excite the mode"
        console.print(f"not tested: mode{'s' * (len(missing) > 1)} {', '.join(missing)} ({reasons})")


def _table(tested: dict[int, AmplitudeDependence]) -> Table:
    table = new_table(
        left=["mode", "channel"],
        right=["rms [m/s²]", "frequency [%]", "p", "damping [%]", "p"],
        no_wrap=True,
        title="change with the amplitude, per rms amplitude",
    )
    frequencies = aligned_numbers(one.frequency.scaled(100.0) for one in tested.values())
    dampings = aligned_numbers(one.damping.scaled(100.0) for one in tested.values())
    for (i, one), frequency, damping in zip(tested.items(), frequencies, dampings, strict=True):
        p_values = (one.frequency.p_value, one.damping.p_value)
        p_frequency, p_damping = (f"{p:.2f}" if p >= 0.01 else f"{p:.1g}" for p in p_values)
        table.add_row(
            str(i + 1), escape(one.channel), f"{one.amplitude:.2g}", frequency, p_frequency, damping, p_damping
        )
    return table


def _sentences(estimate: ModalEstimate, tested: dict[int, AmplitudeDependence]) -> Iterator[str]:
    """Yield the values at the first and last tenth of the amplitudes for each significant slope."""
    level = _LEVEL / (2 * max(len(tested), 1))
    for i, one in tested.items():
        frequency, damping = float(estimate.frequency[i]), 100 * float(estimate.damping[i])
        both = (
            ("frequency", "Hz", frequency, one.frequency.scaled(frequency)),
            ("damping", "%", damping, one.damping.scaled(100.0)),
        )
        for name, unit, value, slope in both:
            if slope.p_value < level:
                ends = (
                    f"{rounded_text(value + slope.value * one.change(at), slope.std)} {unit} at {at:.2g} m/s²"
                    for at in (one.low, one.high)
                )
                yield f"mode {i + 1}: {name} {', '.join(ends)} ({one.channel})"
