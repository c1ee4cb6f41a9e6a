"""Place of the mass: the posterior along the members, and its accuracy over time."""

from functools import partial

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.run_results import RunResults, thin
from monitor.results.windows import MassAnswer
from monitor.views.member_axis import Unrolled, axis_of, has_profile, sigmas, ticks
from monitor.views.palette import ALARM, REGION, TEXT, WARN, Colour
from monitor.views.viewer.components import write_posterior
from monitor.views.viewer.primitives import Axes, at, band, line, readable_ticks, text, times

BOUNDS = ((-24.0, 208.0), (-28.0, 132.0))  # of the drawing, x and y
_WIDTH, _TOP, _LOWER = 200.0, 70.0, 34.0
_NAME_ROWS, _ROW_HEIGHT = 2, 12.0  # of the names of members
_CHARACTER = 3.6  # width of a character in the drawing, at its usual size on a screen
_BETWEEN = 20.0  # upper and lower panel
_MAX_SIGMAS = 30.0  # that are drawn, if there is a place so bad
_MIN_SIGMAS = 3.0
_ALLOWED = 12.0  # sigmas: masses of worse places do not set the scale
_MARGIN = 0.35  # of the masses that the data allow, above and below them
_MEMBERS: tuple[Colour, ...] = ((120, 190, 255), (255, 176, 96), (130, 220, 160), (206, 160, 255))


def draw_answers(recording: rr.RecordingStream, run_results: RunResults, *, static: bool = True) -> None:
    """Draw mass and place over time, and the posterior window by window; axes for ever, or for now if not `static`."""
    if not run_results.answers:
        return
    column = times([w.end for w, _ in run_results.answers])
    answers = [a for _, a in run_results.answers]
    scale, unit = run_results.mass_unit
    mass, spread = (scale * np.array([getattr(a, name) for a in answers]) for name in ("mass", "mass_std"))
    band(recording, "/answer/mass", f"mass ± 2σ [{unit}]", TEXT, column, mass, 2 * spread)
    place = [1000 * a.position_std for a in answers]
    line(recording, "/answer/place", "place, standard deviation [mm]", WARN, column, place)
    drawn = [(w, a) for w, a in thin(run_results.answers) if has_profile(a)]
    if drawn:
        unrolled = axis_of(drawn[-1][1], run_results.geometry)
        draw_posteriors(recording, unrolled, [(w.end, a) for w, a in drawn], run_results.mass_unit, static=static)


def mass_span(run_results: RunResults) -> tuple[float, float]:
    """Return lowest and highest value of the plot of masses in the run's unit, +-2 sigma included."""
    ends = [
        run_results.mass_unit[0] * (a.mass + sign * 2 * a.mass_std) for _, a in run_results.answers for sign in (-1, 1)
    ]
    return min(ends), max(ends)


def draw_posteriors(
    recording: rr.RecordingStream,
    unrolled: Unrolled,
    answers: list[tuple[int, MassAnswer]],
    unit: tuple[float, str],
    *,
    static: bool,
) -> None:
    """Draw how many standard deviations worse each place is, and under it the mass that would fit best there.

    Parameters
    ----------
    unrolled : axis of the members
    answers : with their times [ns UTC]
    unit : of mass: how many are a kilogram, and its name
    static : whether the axes are permanent
    """
    top, low = _panels(unrolled, [a for _, a in answers], unit[0])
    _frames(recording, unrolled, (top, low), unit[1], static=static)
    for time, answer in answers:
        at(recording, time)
        _posterior(recording, unrolled, top, low, scaled(answer, unit[0]))
        write_posterior(recording, answer)


def scaled(answer: MassAnswer, scale: float) -> MassAnswer:
    """Return the answer with its masses in another unit."""
    profile = [p.model_copy(update={"mass": scale * p.mass}) for p in answer.profile]
    return answer.model_copy(update={"mass": scale * answer.mass, "profile": profile})


def _panels(unrolled: Unrolled, answers: list[MassAnswer], scale: float) -> tuple[Axes, Axes]:
    far = [sigmas(a.profile) for a in answers]
    worst = min(_MAX_SIGMAS, max(_MIN_SIGMAS, *(float(f.max()) for f in far)))
    allowed = [scale * p.mass for a, f in zip(answers, far, strict=True) for p in np.array(a.profile)[f <= _ALLOWED]]
    span = min(0.0, *allowed), max(0.0, *allowed)
    room = _MARGIN * (span[1] - span[0]) or 1.0
    panel = partial(Axes, left=0.0, width=_WIDTH, x_range=(0.0, unrolled.total))
    masses = (span[0] - room * (span[0] < 0), span[1] + room * (span[1] > 0))
    return (
        panel(top=0.0, height=_TOP, y_range=(worst, 0.0)),
        panel(top=_TOP + _BETWEEN, height=_LOWER, y_range=masses),
    )


def _frames(
    recording: rr.RecordingStream, unrolled: Unrolled, panels: tuple[Axes, Axes], unit: str, *, static: bool
) -> None:
    top, low = panels
    x = readable_ticks(top, unrolled.ticks(), _CHARACTER)
    top.grid(
        recording,
        "/posterior/place",
        x,
        {float(v): f"{v:g} σ" for v in ticks(0.0, top.y_range[0], 6)},
        room=9.0,
        static=static,
    )
    masses = {float(v): f"{v:g} {unit}" for v in ticks(*low.y_range, 3)}
    low.grid(recording, "/posterior/mass", dict.fromkeys(x, ""), masses, room=10.0, static=static)
    names = unrolled.names(_CHARACTER * unrolled.total / _WIDTH, _NAME_ROWS)
    places = [[float(top.x(middle)), -11.0 - _ROW_HEIGHT * row] for _, middle, row in names]
    colours = [_colour(unrolled, name) for name, _, _ in names]
    text(recording, "/posterior/members", places, [name for name, _, _ in names], colours, static=static)


def _colour(unrolled: Unrolled, member: str) -> Colour:
    return _MEMBERS[list(unrolled.length).index(member) % len(_MEMBERS)]


def _posterior(recording: rr.RecordingStream, unrolled: Unrolled, top: Axes, low: Axes, answer: MassAnswer) -> None:
    curves: list[FloatArray] = []
    masses: list[FloatArray] = []
    colours: tuple[list[Colour], list[Colour]] = ([], [])
    far = sigmas(answer.profile)
    for member in unrolled.length:
        mine = [i for i, p in enumerate(answer.profile) if p.member == member]
        points = [answer.profile[i] for i in mine]
        x = unrolled.along(member, np.array([p.position for p in points]).reshape(-1, 3))
        mass = low.runs(x, np.array([p.mass for p in points]))
        found = top.runs(x, far[mine]), [run for run in mass if len(run) > 2]  # no upright line where it leaves at once
        curves += found[0]
        masses += found[1]
        for runs, colour in zip(found, colours, strict=True):
            colour += [_colour(unrolled, member)] * len(runs)
    for name, strips, colour in zip(("place", "mass"), (curves, masses), colours, strict=True):
        drawn = rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(1.3), draw_order=10.0)
        recording.log(f"/posterior/{name}/curves", drawn)
    _region(recording, unrolled, top, low, answer)


def _region(recording: rr.RecordingStream, unrolled: Unrolled, top: Axes, low: Axes, answer: MassAnswer) -> None:
    """Mark the best place, and the 95 % region under the curve."""
    bottom = top.top + top.height
    stretches = [
        [[float(top.x(unrolled.along(r.member, np.array(p)))), bottom] for p in (r.start, r.end)]
        for r in answer.region
        if r.member in unrolled.offset
    ]
    bars = rr.LineStrips2D(stretches, colors=[REGION], radii=rr.Radius.ui_points(3.5), draw_order=15.0)
    recording.log("/posterior/region", bars)
    if answer.member not in unrolled.offset:
        return
    x = float(top.x(unrolled.along(answer.member, np.array(answer.position))))
    mark = rr.LineStrips2D(
        [[[x, 0.0], [x, bottom]], [[x, low.top], [x, low.top + low.height]]],
        colors=[ALARM],
        radii=rr.Radius.ui_points(0.7),
        draw_order=5.0,
    )
    recording.log("/posterior/best", mark)
    level = float(low.y(np.clip(answer.mass, *low.y_range)))
    dot = rr.Points2D([[x, level]], colors=[ALARM], radii=rr.Radius.ui_points(4.0), draw_order=20.0)
    recording.log("/posterior/mass/best", dot)
