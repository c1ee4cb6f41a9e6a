"""Events as typed fields: to the log's JSON values and back; each topic once, and in the documentation."""

from pathlib import Path

import pytest

import monitor.results.service_events as service_events
from daq import DeviceIdentity, events
from daq.events import DeviceOpened, EventPayload, LogFileLost, ScansMissing

DOCS = Path(__file__).parents[2] / "docs"
KINDS = [
    kind
    for module in (events, service_events)
    for kind in vars(module).values()
    if isinstance(kind, type) and issubclass(kind, EventPayload) and hasattr(kind, "topic")
]


def test_payload_is_read_back_from_the_event() -> None:
    gap = ScansMissing(device="left", first_index=7, missing=3, exact=True)
    assert gap.event(5).payload == {"device": "left", "first_index": 7, "missing": 3, "exact": True}
    assert ScansMissing.read(gap.event(5)) == gap


def test_unknown_fields_of_a_log_are_left_out() -> None:
    event = ScansMissing(device="left", missing=3).event(5)
    event.payload["later"] = "field of a newer version"
    assert ScansMissing.read(event) == ScansMissing(device="left", missing=3)


def test_absent_values_are_not_in_the_log() -> None:
    moved = LogFileLost(file="a.mcap", how="moved", to="b.mcap")
    assert moved.event(5).payload == {"file": "a.mcap", "how": "moved", "to": "b.mcap"}


def test_field_named_by_a_keyword_is_read_back() -> None:
    cut = LogFileLost(file="a.mcap", how="cut short", bytes=9, from_=1, until=2)
    assert cut.event(5).payload == {"file": "a.mcap", "how": "cut short", "bytes": 9, "from": 1, "until": 2}
    assert LogFileLost.read(cut.event(5)) == cut


def test_identity_is_among_the_fields_of_an_opened_device() -> None:
    identity = DeviceIdentity(product="A352", serial="7", details={"baud": 9600})
    opened = DeviceOpened(device="left", identity=identity, filter_delay=0.1)
    assert opened.event(5).payload == {
        "device": "left",
        "product": "A352",
        "serial": "7",
        "baud": 9600,
        "filter_delay": 0.1,
    }


def test_each_topic_has_one_class() -> None:
    assert len({kind.topic for kind in KINDS}) == len(KINDS) > 40


@pytest.mark.parametrize("kind", KINDS)
def test_topic_is_documented(kind: type[EventPayload]) -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md"))
    name = kind.topic.removeprefix("/event/")
    assert kind.topic in text or f"`{name}`" in text, f"{kind.topic} is in no page of docs"
