"""Comparison of a change within the record of a demo, as `diagnose` finds it in the log, with the scenario."""

from daq.notebook import number_text
from monitor.cli.demo.scenario_score import MASS, SIGMAS, ScoredEvent, distance, is_near
from monitor.results.comparison import WithinRecord
from monitor.rig import RigEvent
from monitor.text.causes import cause_text

_HOUR = 3600.0


def score_course(event: RigEvent, found: WithinRecord | None) -> ScoredEvent:
    """Compare the cause of a gradual change, its place and its rate with an event that takes some time.

    Parameters
    ----------
    event : body that comes little by little
    found : change within the record; None: nothing was found
    """
    assert event.body
    rate = event.body.mass / event.over * _HOUR
    what = "body that comes gradually"
    truth = f"{rate:.2f} kg/h at ({', '.join(f'{x:.3g}' for x in event.body.at)}) m"
    if found is None or len(found.causes) != 1:
        named = "no change within the record" if found is None else f"{len(found.causes)} causes, {found.kind}"
        return ScoredEvent(what, truth, named, "", right=False)
    (cause,) = found.causes
    rates = [r for r in found.rates if (r.cause, r.parameter) == ("added_mass", "mass")]
    if not rates:
        return ScoredEvent(what, truth, f"{cause_text(cause)}, {found.kind}", "", right=False)
    off = rates[0].per_hour - rate
    answer = f"{cause_text(cause)}; {number_text(rates[0].per_hour, rates[0].std)} kg/h"
    right = is_near(cause, event.body.at) and abs(off) <= max(MASS * rate, SIGMAS * rates[0].std)
    away = f"{1000 * distance(cause, event.body.at):.0f} mm; {off:+.2f} kg/h"
    return ScoredEvent(what, truth, answer, away, right)
