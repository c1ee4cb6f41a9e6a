"""The page as a reader gets it: parsed as HTML, its words and its pictures."""

import base64
import html
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from monitor.errors import ResultsError
from monitor.results.run_results import RunResults
from monitor.results.windows import AcceptedShift, AlarmResult, OtherPlace
from monitor.text.quantities import utc
from monitor.text.verdicts import headline as verdict
from monitor.views.report import diagnosis_report, load_diagnosis, pdf, run_report
from monitor.views.run import DeviceQuality, Run, load_run
from tests.support.monitor import answers
from tests.support.monitor import results as made
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.comparison import shown
from tests.support.thorough import few_of
from updater import t_structure_toml
from updater.quantities import plain

ROOT = Path(__file__).parents[4]
LOG = ROOT / "replay_data" / "t_frame_added_mass.mcap"
SITE = made.Site()
WHOLE = made.whole_run(SITE)
FOUND = answers.with_findings(SITE, WHOLE)
NO_BREAK = "\u00a0"
_SVG = "data:image/svg+xml;base64,"


class Page(HTMLParser):
    """Headline, words and pictures of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.text = path.read_text(encoding="utf-8")
        self.words, self.pictures, self.tags, self.links = "", dict[str, str](), list[str](), list[str]()
        self.feed(self.text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.tags.append(tag)
        self.links += [values[name] for name in ("href", "src") if name in values]
        if tag == "img":
            self.pictures[values["alt"]] = values["src"]

    def handle_data(self, data: str) -> None:
        self.words += " " + data.replace(NO_BREAK, " ")


def run_of(run_results: RunResults, path: Path) -> Run:
    path.write_bytes(b"log")
    device = DeviceQuality(device="beam", rate=100.0, scans=12345, gaps=1, missing=7, exact=False)
    return Run(log=path, results=run_results, devices=[device], dropped=3, ended=False, site_text="a = '<b>'")


def page_of(run: dict[str, object], folder: Path) -> Page:
    run_report(run_of(made.run_results(run), folder / "run.mcap"), folder / "page.html")
    return Page(folder / "page.html")


def headline(page: Page) -> str:
    found = re.search(r"<h1>(.*?)</h1>", page.text, re.DOTALL)
    assert found
    return found.group(1).replace(NO_BREAK, " ")


def test_page_of_a_recorded_log_states_the_last_result(tmp_path: Path) -> None:
    run = load_run(LOG)
    run_report(run, tmp_path / "page.html")
    page = Page(tmp_path / "page.html")
    answer = run.results.answers[-1][1]
    assert headline(page).startswith(
        f"The structure has changed: {1000 * answer.mass:.0f} ± {1000 * answer.mass_std:.0f} g added on the crossbeam"
    )
    first = next(w for w in run.results.watched if w.novelty and w.novelty.t2 > w.novelty.limit)
    clock = np.datetime64(first.end, "ns").astype("datetime64[s]").item().strftime("%H:%M:%S")
    assert f"and {clock} UTC." in headline(page)
    assert len(page.pictures) == 12
    assert all(device in page.words for device in ("col_037", "beam_right"))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    return page_of(FOUND, tmp_path_factory.mktemp("report"))


def test_page_is_self_contained_with_complete_pictures(page: Page) -> None:
    assert len(page.pictures) == 8  # no profile of a mass: a sensor's gain is an alternative
    assert page.links
    for source in page.links:
        assert source.startswith(_SVG)
        root = ElementTree.fromstring(base64.b64decode(source.removeprefix(_SVG)))
        assert len(list(root.iter("{http://www.w3.org/2000/svg}path"))) > 5
    assert "script" not in page.tags


def test_pictures_have_the_colours_of_a_dark_page(page: Page) -> None:
    drawn = [base64.b64decode(source.removeprefix(_SVG)).decode() for source in page.links]
    assert all("@media (prefers-color-scheme:dark){:root{--ink:" in text for text in drawn)
    for light in ("#1d2733", "#66707c", "#ffffff"):  # nothing but the style itself has a fixed colour of text or paper
        assert all(len(re.findall(f"[:;] ?{light}", text)) == 1 for text in drawn)


def test_page_begins_with_place_and_time_and_lists_refused_causes(page: Page) -> None:
    parts = ("The structure with its sensors", "Novelty and frequency shifts", '<table class="facts', "<h2>")
    places = [page.text.index(part) for part in parts]
    assert places == sorted(places)
    for refused in answers.diagnosis().rejected:
        assert refused.why in page.words
        assert plain(refused.cause) in page.words


def test_page_shows_increments_and_diagnosis(page: Page) -> None:
    assert "302 ± 5 g added on the crossbeam at (0.250, 0.000, 1.480) m ± 4 mm" in headline(page)
    assert "sensor gain in col_037_x: gain 1.0312 ± 0.0021" in headline(page)
    assert page.words.count("sensor gain in col_037_x: gain 1.0312 ± 0.0021") == 1  # the table has it in its columns
    increments = answers.increments(SITE)
    z = [f.z for f in increments.flagged if f.direction == "y"]
    assert f"<td>y</td><td>{len(z)}</td><td>{max(z, key=abs):+.1f}</td>" in page.text
    assert "consistent with one mass at (0.25, 0.00, 1.48) m, 95 % within 0.03 m" in page.words
    for words in (
        "that were not used",
        "1.920",
        "0.040",
        "not identified",
        "extended/t_structure.toml",
        "-41.3",
    ):
        assert words in page.words, words


def test_pdf_has_the_texts_and_pictures_of_the_page(page: Page) -> None:
    made_of = pdf.tree_of(page.text)
    words, pictures = content_of(made_of)
    for text in (
        headline(page),
        "consistent with one mass at (0.25, 0.00, 1.48) m",
        "a = '<b>'",
        "channel mid is flat",
    ):
        assert html.unescape(text) in words.replace(NO_BREAK, " ")
    assert len(pictures) == len(page.pictures)
    for drawn in pictures:
        assert "var(" not in drawn
        ElementTree.fromstring(drawn)
    written = pdf.pdf_of(page.text)
    assert written.startswith(b"%PDF-")
    assert f'<rdf:li xml:lang="x-default">{made_of["title"]}</rdf:li>'.encode() in written
    assert pdf.pdf_of(page.text) == written


def content_of(node: dict[str, Any] | str) -> tuple[str, list[str]]:
    """Return the texts and the pictures of a tree."""
    if isinstance(node, str):
        return node, []
    parts = [content_of(child) for child in node["children"]]
    pictures = [node["svg"]] if node.get("tag") == "img" else []
    return "".join(text for text, _ in parts), pictures + [p for _, found in parts for p in found]


@pytest.mark.usefixtures("undrawn")
def test_pdf_is_written_beside_the_page_or_refused_before_anything_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = run_of(made.run_results(made.learning_run(SITE)), tmp_path / "run.mcap")
    run_report(run, tmp_path / "page.html", pdf=tmp_path / "page.pdf")
    assert (tmp_path / "page.pdf").read_bytes().startswith(b"%PDF-")
    with pytest.raises(ResultsError, match=r"none/page\.pdf: cannot be written: No such file"):
        run_report(run, tmp_path / "other.html", pdf=tmp_path / "none" / "page.pdf")
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(ImportError, match=r"typst is not installed: pip install 'modalwatch\[pdf\]'"):
        run_report(run, tmp_path / "other.html", pdf=tmp_path / "other.pdf")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["page.html", "page.pdf", "run.mcap"]


@pytest.mark.usefixtures("undrawn")
def test_pdf_of_a_diagnosis_needs_no_page(tmp_path: Path) -> None:
    diagnosis_report(answers.diagnosis(), None, title="bridge", found=shown(), pdf=tmp_path / "found.pdf")
    content = (tmp_path / "found.pdf").read_bytes()
    assert content.startswith(b"%PDF-")
    assert b'<rdf:li xml:lang="x-default">bridge' in content
    assert [path.name for path in tmp_path.iterdir()] == ["found.pdf"]


def test_diagnose_without_typst_is_refused_before_logs_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, modalwatch: Commands
) -> None:
    monkeypatch.setitem(sys.modules, "typst", None)
    (tmp_path / "t.toml").write_text(t_structure_toml(), encoding="utf-8")
    done = modalwatch("diagnose", tmp_path / "t.toml", tmp_path / "none.mcap", "--pdf", tmp_path / "found.pdf")
    assert_refused(done, "--pdf", "typst is not installed: pip install 'modalwatch[pdf]'")


def test_texts_from_outside_are_escaped(page: Page) -> None:
    assert "shifts all modes alike <unlike these>" in page.words
    assert "a = '<b>'" in page.words
    assert {"unlike", "indeed"}.isdisjoint(page.tags)


@pytest.mark.usefixtures("undrawn")
def test_measurements_behind_the_diagnosis_are_shown(tmp_path: Path) -> None:
    found = {"diagnosis": answers.diagnosis(), "discrepancy": shown(), "answer": None}
    last = WHOLE["windows"][-1].model_copy(update=found)
    page = page_of(WHOLE | {"windows": [*WHOLE["windows"][:-1], last]}, tmp_path)
    assert "Measured and simulated modes" in page.words
    assert any(text.startswith("Residual forces") for text in page.pictures)


def test_lost_data_are_reported(page: Page) -> None:
    assert "3 items were lost because the queue of the log was full" in page.words
    assert "it was cut short, or is still being written" in page.words
    assert "about 7" in page.words
    assert "channel mid is flat" in page.words


CASES = {
    "learning": (made.learning_run(SITE), "Still learning: 5 windows so far, no window has been evaluated yet."),
    "learned": (
        WHOLE | {"windows": WHOLE["windows"][:8], "alarms": WHOLE["alarms"][:1]},
        "A baseline is learned; no window has been evaluated yet.",
    ),
    "normal": (
        WHOLE | {"windows": WHOLE["windows"][:12], "alarms": WHOLE["alarms"][:1]},
        "Nothing has changed in 4 windows.",
    ),
    "watch": (
        WHOLE | {"windows": WHOLE["windows"][:13], "alarms": WHOLE["alarms"][:2]},
        "One window is above the limit. The next windows decide whether the structure has changed.",
    ),
    "no answer": (
        WHOLE | {"windows": [w.model_copy(update={"answer": None}) for w in WHOLE["windows"]]},
        "The structure has changed: location not yet known.",
    ),
    "back": (
        WHOLE | {"alarms": [*WHOLE["alarms"], made.alarm(WHOLE["windows"][-1], "normal", "back to normal")]},
        "Back to normal after an alarm, 12 windows watched.",
    ),
    "nothing identified": (
        made.learning_run(SITE) | {"windows": [made.without_modes(w, "flat") for w in WHOLE["windows"][:3]]},
        "Still learning: 3 windows so far, no window has been evaluated yet.",
    ),
    "footbridge": (
        made.whole_run(made.Site(text=made.BRIDGE, n_modes=14, place=(6.0, 2.0, 3.0), mass=-60.0)),
        "removed on the deck",
    ),
    "one mode": (made.whole_run(made.Site(n_modes=1)), "The structure has changed:"),
}


def accepted_run(accepted: AcceptedShift, *then: AlarmResult) -> dict[str, object]:
    """Return the run, its change accepted two windows before the end."""
    end = WHOLE["windows"][-3]
    taken = made.alarm(end, "normal", "accepted").model_copy(update={"kind": "accepted", "time": end.end + 10**9})
    reference = WHOLE["reference"].model_copy(update={"accepted": [accepted]})
    return WHOLE | {"reference": reference, "alarms": [*WHOLE["alarms"], taken, *then]}


@pytest.mark.usefixtures("undrawn")
def test_accepted_change_is_shown_with_person_and_time(tmp_path: Path) -> None:
    change = AcceptedShift(
        time=WHOLE["windows"][-3].end,
        raised=WHOLE["alarms"][-1].time,
        cause="antenna <5 kg>",
        by="Ada",
        found="302 g added",
        n_windows=6,
        shift_percent=[-1.0],
        shift_std_percent=[0.1],
    )
    page = page_of(accepted_run(change), tmp_path)
    reported = f"as 'antenna <5 kg>' by Ada, {utc(change.time + 10**9)}"
    assert f"A change was accepted {reported}; nothing has changed in 2 windows since." in page.words
    assert f"{reported}; diagnosis: 302 g added" in page.words
    again = [made.alarm(WHOLE["windows"][-2], "alarm", "again"), made.alarm(WHOLE["windows"][-1], "normal", "gone")]
    assert verdict(made.run_results(accepted_run(change, *again)), None).startswith("Back to normal after an alarm")


@pytest.mark.parametrize("name", CASES)
def test_each_state_of_a_run_has_a_verdict(name: str) -> None:
    run, words = CASES[name]
    assert words in verdict(made.run_results(run), None)


@pytest.mark.parametrize(
    "name", few_of(["learning", "nothing identified", "footbridge", "learned", "no answer", "one mode"], 3)
)
def test_each_kind_of_run_has_a_page(name: str, tmp_path: Path) -> None:
    run, words = CASES[name]
    page = page_of(run, tmp_path)
    assert words in headline(page)
    assert "None" not in page.words


@pytest.mark.parametrize("std", few_of([float("nan"), float("inf"), 0.0]))
def test_answer_of_unknown_precision_is_shown(std: float, tmp_path: Path) -> None:
    window = WHOLE["windows"][-1]
    unsure = window.answer.model_copy(update={"mass_std": std, "position_std": std, "p_value": std})
    modes = [m.model_copy(update={"frequency_std": std, "shift_std_percent": std}) for m in window.modes]
    last = window.model_copy(update={"answer": unsure, "modes": modes})
    page = page_of(WHOLE | {"windows": [*WHOLE["windows"][-3:-1], last]}, tmp_path)
    assert "added on the crossbeam" in headline(page)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("window", [0, -1], ids=["first", "last"])
def test_mode_missing_from_a_window_has_empty_cells(window: int, tmp_path: Path) -> None:
    watched = WHOLE["windows"][-3:]
    watched[window] = watched[window].model_copy(update={"modes": watched[window].modes[1:]})
    page = page_of(WHOLE | {"windows": watched}, tmp_path)
    assert ("not identified" in page.words) == (window == -1)
    row = re.search(r"<tr><td>1</td>.*?</tr>", page.text, re.DOTALL)
    assert row
    assert "<td></td>" in row.group(0)


def test_each_alternative_location_is_listed_and_drawn(tmp_path: Path) -> None:
    other = OtherPlace(
        member="crossbeam", position=(0.25, 0.0, 1.48), position_std=0.02, mass=0.2, mass_std=0.03, probability=0.31
    )
    last = WHOLE["windows"][-1]
    answer = last.answer.model_copy(update={"others": [other]})
    run = WHOLE | {"windows": [*WHOLE["windows"][:-1], last.model_copy(update={"answer": answer})]}
    found = page_of(run, tmp_path)
    assert "or 200 ± 30 g added on the crossbeam at (0.250, 0.000, 1.480) m ± 20 mm (31.0 %)" in found.words
    drawn = next(source for name, source in found.pictures.items() if name.startswith("The structure with its sensors"))
    assert "or here" in base64.b64decode(drawn.removeprefix(_SVG)).decode()


@pytest.mark.usefixtures("undrawn")
def test_accuracy_forecast_is_shown_if_present(tmp_path: Path) -> None:
    reported = "the deviation decreases with the square root of the number of windows, up to about 4 windows"
    last = WHOLE["windows"][-1]
    stated = last.model_copy(update={"answer": last.answer.model_copy(update={"outlook": reported})})
    found = page_of(WHOLE | {"windows": [*WHOLE["windows"][:-1], stated]}, tmp_path)
    assert reported in found.words
    assert "Forecast" not in page_of(WHOLE, tmp_path).words


def test_same_run_gives_the_same_page(page: Page, tmp_path: Path) -> None:
    assert page_of(FOUND, tmp_path).text == page.text


def test_diagnosis_without_a_run_has_a_page(tmp_path: Path) -> None:
    structure = SITE.model.structure
    facts = [("Logs", "after.mcap, 2 min")]
    diagnosis_report(answers.diagnosis(), tmp_path / "page.html", title="T <frame>", structure=structure, facts=facts)
    page = Page(tmp_path / "page.html")
    assert "after.mcap, 2 min" in page.words
    assert headline(page).startswith("Explained: 302 ± 5 g added on the crossbeam")
    assert "T <frame>" in page.words
    assert len(page.pictures) == 3  # places, errors and evidence
    nothing = answers.diagnosis().model_copy(update={"verdict": "unexplained", "causes": (), "gain": None, "modes": ()})
    diagnosis_report(nothing, tmp_path / "page.html", title="T")
    found = headline(Page(tmp_path / "page.html"))
    assert found == "Unexplained: no known cause explains the difference between data and model."
    assert "MAC" not in Page(tmp_path / "page.html").words
    modes, advice = answers.diagnosis().modes, "Compare by `identify --structure`."
    diagnosis_report(
        nothing.model_copy(update={"modes": modes, "next_measurement": advice}), tmp_path / "page.html", title="T"
    )
    page = Page(tmp_path / "page.html")
    assert "Measured modes, and modes of the model mode" in " ".join(page.words.split())
    assert not any(text in page.words for text in ("MAC with", "(green)"))
    assert "<code>identify --structure</code>" in page.text.replace(NO_BREAK, " ")


def test_diagnosis_is_read_back_and_an_invalid_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "diagnosis.json"
    path.write_text(answers.diagnosis().model_dump_json(), encoding="utf-8")
    assert load_diagnosis(path) == answers.diagnosis()
    path.write_text(path.read_text(encoding="utf-8").replace('"explained"', '"certain"'), encoding="utf-8")
    with pytest.raises(ResultsError, match=r"diagnosis\.json: is no diagnosis: verdict: "):
        load_diagnosis(path)


def test_missing_output_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match=r"missing/page\.html: cannot be written: No such file"):
        diagnosis_report(answers.diagnosis(), tmp_path / "missing" / "page.html", title="T")
