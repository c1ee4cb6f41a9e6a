"""Events as sentences: every event of the package has one that its fields fill."""

from dataclasses import fields

import pytest

from daq import events as devices
from daq.events import EventPayload
from monitor.results import service_events as service
from monitor.text.events import event_name, event_sentence, event_text

EVENTS = sorted(
    {c for module in (devices, service) for c in vars(module).values() if isinstance(c, type) and hasattr(c, "topic")},
    key=lambda c: c.topic,
)


@pytest.mark.parametrize("kind", EVENTS, ids=lambda c: event_name(c.topic))
def test_every_event_has_a_sentence(kind: type[EventPayload]) -> None:
    numbers = {"float", "int", "float | None", "int | None", float, int}
    payload = {f.name: 3 if f.type in numbers else f"<{f.name}>" for f in fields(kind)}
    sentence = event_sentence(kind.topic, payload)
    assert sentence != f"{event_name(kind.topic)} {event_text(payload)}".strip()
    assert not sentence[0].islower()
    if "why" in payload:
        assert sentence.endswith(": <why>")


def test_optional_fields_may_be_absent() -> None:
    assert event_sentence("/event/acknowledge", {"by": "", "note": ""}) == "The alarm was acknowledged by a person"
    assert event_sentence("/event/acknowledge", {"by": "Ada", "note": "on my way"}).endswith("by Ada: on my way")
    assert event_sentence("/event/device_failed", {"device": "left"}) == "Device left is lost"


def test_event_of_another_version_is_shown_with_its_fields() -> None:
    assert event_sentence("/event/new_thing", {"device": "{x}", "n": 3}) == "new thing device {x}, n 3"
    assert event_sentence("/event/gap", {"device": "left"}) == "gap device left"
    assert event_sentence("/event/disk_low", {"free_gb": "much"}) == "disk low free gb much"
