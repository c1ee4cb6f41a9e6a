"""Parts of the page with measured and simulated modes: their texts, and the reading of the forces that they show."""

from html.parser import HTMLParser
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from monitor.cli.data.diagnose.diagnosis_output import say_evidence
from monitor.results.comparison import DiscrepancyResult
from monitor.views.report import diagnosis_report
from tests.support.monitor import answers
from tests.support.monitor.comparison import NODES, STRUCTURE, shown


class Page(HTMLParser):
    def __init__(self, path: Path) -> None:
        super().__init__()
        self.words, self.pictures = "", list[str]()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.pictures.append(dict(attrs)["alt"] or "")

    def handle_data(self, data: str) -> None:
        self.words += " " + data


def page_of(found: DiscrepancyResult, folder: Path) -> Page:
    diagnosis_report(answers.diagnosis(), folder / "page.html", title="T", structure=STRUCTURE, found=found)
    return Page(folder / "page.html")


@pytest.mark.usefixtures("undrawn")
def test_page_shows_modes_sensors_and_locations(tmp_path: Path) -> None:
    page = page_of(shown(), tmp_path)
    for words in (
        "-3.70\u00a0±\u00a00.10",
        "-37.0",
        "not identified",
        "71.5 ",
        "Largest deviation from the shapes without the causes: beam_left_z,",
        "7.4 % rms.",
    ):
        assert words in page.words
    for start in ("Measured frequencies", "MAC of", "Residual", "Frequencies over temp", "Where along", "beam_left_z"):
        assert any(text.startswith(start) for text in page.pictures), start


@pytest.mark.usefixtures("undrawn")
def test_unused_mode_is_marked_on_page_and_terminal(tmp_path: Path) -> None:
    found, why = shown(), "* not used: no confident match in the reference"
    terminal = Console(record=True, width=200, force_terminal=True, file=StringIO())
    say_evidence(terminal, answers.diagnosis(), found, STRUCTURE)
    assert "on data not used (held-out logs): " in (reported := terminal.export_text(clear=False))
    assert "each mode predicted" not in reported
    assert why not in page_of(found, tmp_path).words + terminal.export_text()
    first, *others = found.modes
    marked = found.model_copy(update={"modes": (first.model_copy(update={"compared": False}), *others)})
    say_evidence(terminal, answers.diagnosis(), marked, STRUCTURE)
    stated = terminal.export_text()
    assert stated.count("* 10.800") == stated.count(why) == 1
    page = page_of(marked, tmp_path)
    assert page.words.count("* 10.800") == page.words.count(why) == 1


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("log_odds", "readings"), [(40.0, ["mass"]), (-40.0, ["stiffness"]), (1.0, ["mass", "stiffness"])]
)
def test_only_the_clearly_better_interpretation_of_residual_forces_is_shown(
    log_odds: float, readings: list[str], tmp_path: Path
) -> None:
    page = page_of(shown(log_odds), tmp_path)
    found = [text for text in page.pictures if text.startswith("Residual forces")]
    names = {"mass": "excess mass", "stiffness": "missing stiffness"}
    assert [text.split("forces as ")[1].split(" (")[0].split(":")[0] for text in found] == [names[r] for r in readings]
    x, y, z = NODES[7]
    assert all("+12.0 ± 0.2 % " in text and f"({x:.3f}, {y:.3f}, {z:.3f}) m" in text for text in found)


@pytest.mark.thorough
def test_failed_picture_does_not_affect_the_others(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A spectrum whose curves differ in length, as they did where windows paired other modes with the causes."""
    whole = page_of(shown(), tmp_path).pictures
    assert not caplog.records
    (signal,) = shown().signals
    broken = signal.model_copy(update={"missed_after": signal.missed[:-1]})
    page = page_of(shown().model_copy(update={"signals": (broken,)}), tmp_path)
    assert [text for text in whole if text not in page.pictures] == ["beam_left_z: spectrum"]
    (record,) = caplog.records
    assert record.getMessage().startswith("internal error, picture (beam_left_z: spectrum) is left out: ValueError: ")


@pytest.mark.usefixtures("undrawn")
def test_missing_results_omit_their_part_of_the_page(tmp_path: Path) -> None:
    bare = shown().model_copy(update={"balance": None, "signals": (), "trends": (), "places": (), "note": "too short"})
    page = page_of(bare, tmp_path)
    assert "too short" in page.words
    assert not any(text.startswith(("Forces", "Where along", "Frequencies over")) for text in page.pictures)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("frequencies", "text"), [((77.5, 61.25), "61.25 to 77.5 Hz"), ((10.651, 10.652), "both at 10.65 Hz")]
)
def test_modes_of_the_model_that_were_never_measured_are_counted_not_listed(
    frequencies: tuple[float, ...], text: str, tmp_path: Path
) -> None:
    found = shown()
    empty = {"measured": None, "off_percent": None, "std_percent": None, "mac": None, "compared": False}
    never = [found.modes[0].model_copy(update=empty | {"simulated": f}) for f in frequencies]
    terminal = Console(record=True, width=200, force_terminal=True, file=StringIO())
    more = found.model_copy(update={"modes": (*found.modes, *never)})
    say_evidence(terminal, answers.diagnosis(), more, STRUCTURE)
    for words in (terminal.export_text(), page_of(more, tmp_path).words):
        assert f"ot measured, neither before nor now: 2 modes of the model, {text}" in words
        assert "* 61.25" not in words
