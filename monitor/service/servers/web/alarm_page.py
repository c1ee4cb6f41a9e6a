"""Page of one alarm, made from the history by the process that draws it."""

import json
import os
import sys

from monitor.outputs.history import AlarmRow, Reader
from monitor.results.comparison import DiagnosisAnswer
from monitor.results.windows import ReferenceResult
from monitor.text.quantities import duration_text, utc
from monitor.views.report import alarm_report


def main() -> None:
    """Read the request from the standard input, write the page to the standard output; nothing if there is none."""
    os.nice(10)  # acquisition and analysis come first
    request = json.load(sys.stdin)
    page = alarm_page(request["name"], request["url"], request["site"], request["raised"])
    sys.stdout.buffer.write((page or "").encode())


def alarm_page(name: str, url: str, site: str, raised: int) -> str | None:
    """Return the page of the alarm that was raised at a time [ns UTC]; None if there is no diagnosis of it.

    Parameters
    ----------
    name : of the site
    url, site : address of the history, with its password, and name of the site in it
    raised : time [ns UTC]

    Raises
    ------
    HistoryError
        If the history cannot be read.
    """
    with Reader(url, site) as reader:
        span = reader.span()
        alarm = next((row for row in (reader.alarms(span) if span else []) if row.raised == raised), None)
        found = reader.diagnosis(raised, alarm.cleared) if alarm else None
        reference = reader.reference()
    if alarm is None or found is None:
        return None
    diagnosis = DiagnosisAnswer.model_validate_json(found)
    drawn = ReferenceResult.model_validate_json(reference) if reference else None
    return alarm_report(diagnosis, title=name, facts=_facts(alarm), reference=drawn)


def _facts(alarm: AlarmRow) -> list[tuple[str, str]]:
    ended = "not yet" if alarm.cleared is None else f"{utc(alarm.cleared)}, after {duration_text(alarm.lasted or 0.0)}"
    facts = [("Alarm raised", utc(alarm.raised)), ("Alarm ended", ended)]
    if alarm.acknowledged:
        facts.append(("Acknowledged", utc(alarm.acknowledged)))
    return [*facts, ("Last message", alarm.text)]
