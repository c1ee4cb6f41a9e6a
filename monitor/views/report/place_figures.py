"""Place of the change: best place, profile of the likelihood, and increments of the one-step update."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq import FloatArray
from monitor.results.windows import MassAnswer, MassIncrements, ReferenceResult
from monitor.views.member_axis import Unrolled, axis_of, has_profile, sigmas
from monitor.views.report.structure_figure import Frame
from monitor.views.report.svg import ADDED, REGION, mode_colour
from oma.plots import SOFT, new_figure

_DIRECTIONS = ("x", "y", "z")
_MAX_SIGMAS = 12.0
_ALLOWED = 6.0  # sigmas: masses of worse places are not drawn


def structure_figure(reference: ReferenceResult, answer: MassAnswer | None) -> Figure:
    """Return the structure, with the place and its 95 % region if there is an answer."""
    figure = new_figure(4.6, 4.4)
    axes, frame = figure.subplots(), Frame(reference)
    bare = "Structure and sensors" if reference.has_model else "Sensors"
    axes.set_title("Position of the mass" if answer else bare)
    frame.draw(axes, names=True)
    if answer:
        frame.draw_answer(axes, answer)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=3, fontsize=7)
    return figure


def profile_figure(answer: MassAnswer, reference: ReferenceResult | None, unit: tuple[float, str]) -> Figure | None:
    """Return how much worse each place is and the mass that would fit best there, along all members."""
    if not has_profile(answer):
        return None
    figure = new_figure(5.2, 4.4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.7, 1.0])
    unrolled, far = axis_of(answer, reference), sigmas(answer.profile)
    worst = min(_MAX_SIGMAS, max(3.0, float(far.max())))
    for number, member in enumerate(unrolled.length):
        mine = [i for i, p in enumerate(answer.profile) if p.member == member]
        points = [answer.profile[i] for i in mine]
        x = unrolled.along(member, np.array([p.position for p in points]))
        colour = mode_colour(number + 1)
        upper.plot(x, far[mine], color=colour, linewidth=1.4)
        mass = np.where(far[mine] <= _ALLOWED, [unit[0] * p.mass for p in points], np.nan)
        lower.plot(x, mass, color=colour, linewidth=1.4)
        middle = unrolled.offset[member] + unrolled.length[member] / 2
        upper.text(middle, 1.01, member, transform=upper.get_xaxis_transform(), ha="center", color=colour)
    figure.suptitle("Misfit and best mass along the members", fontsize=9, fontweight="bold", x=0.02, ha="left")
    _mark_best(upper, lower, unrolled, answer, unit[0])
    upper.set_ylim(worst, -0.4)
    upper.set_ylabel("misfit compared with the best place [σ]")
    lower.set_ylabel(f"best mass there [{unit[1]}]")
    ticks = list(unrolled.ticks())
    lower.set_xticks([x for x, _ in ticks], [text for _, text in ticks])
    lower.set_xlabel("along each member, from its start [m]")
    return figure


def _mark_best(upper: Axes, lower: Axes, unrolled: Unrolled, answer: MassAnswer, scale: float) -> None:
    for r in (r for r in answer.region if r.member in unrolled.offset):
        ends = [float(unrolled.along(r.member, np.array(p))) for p in (r.start, r.end)]
        for axes in (upper, lower):
            axes.axvspan(min(ends), max(ends), color=REGION, alpha=0.35, linewidth=0)
    if answer.member in unrolled.offset:
        x = float(unrolled.along(answer.member, np.array(answer.position)))
        upper.plot([x], [0.0], "o", color=ADDED, markersize=6)
        lower.errorbar([x], [scale * answer.mass], [2 * scale * answer.mass_std], fmt="o", color=ADDED, capsize=3)


def increments_figure(reference: ReferenceResult, increments: MassIncrements) -> Figure:
    """Return the paper's picture: increments along the members, raw above, normalised below, a column a direction."""
    figure = new_figure(10.0, 5.6)
    frame, grid = Frame(reference), figure.subplots(2, 3)
    normalised = np.array([[np.nan if v is None else v for v in row] for row in increments.normalised], float)
    rows = (("raw", np.array(increments.increment, float)), ("normalised", normalised))
    for (name, values), row in zip(rows, grid, strict=True):
        for column, (direction, axes) in enumerate(zip(_DIRECTIONS, row, strict=True)):
            seen = np.abs(values[np.isfinite(values[:, column]), column])
            frame.draw_increments(axes, values[:, column], float(seen.max(initial=0.0)) or 1.0)
            frame.draw_flags(axes, increments, direction, values[:, column])
            axes.set_title(f"{direction}, {name}: {_total(increments, values, column, name)}", fontsize=8.5)
            text = f"largest {1000 * seen.max():.1f} g per node" if len(seen) else "nothing known in this direction"
            axes.annotate(text, (0.5, -0.02), xycoords="axes fraction", ha="center", fontsize=7, color=SOFT)
    return figure


def _total(increments: MassIncrements, values: FloatArray, column: int, name: str) -> str:
    if name == "raw":
        return f"total {1000 * np.nansum(values[:, column]):z.0f} g"
    return f"total {1000 * increments.totals[column]:z.0f} ± {1000 * increments.totals_std[column]:.0f} g"
