"""The parts of the page that set measured beside simulated: what they say, which reading of the forces they show."""

from html.parser import HTMLParser
from pathlib import Path

import answers_helpers as answers
import numpy as np
import pytest
import viewer_helpers as made

from monitor.discrepancy import (
    BalanceResult,
    DiscrepancyResult,
    ModeBeside,
    PlaceDensity,
    SensorBeside,
    SignalBeside,
    TrendBeside,
)
from monitor.report import diagnosis_report
from updater import build_model

SITE = made.Site()
STRUCTURE = SITE.model.structure
NODES = build_model(STRUCTURE).nodes


def shown(log_odds: float = 40.0, peak: int = 7) -> DiscrepancyResult:
    """Two pairs, one mode that was not seen and one that is extra; a peak of the forces at a node."""
    values = np.full(len(NODES), 0.001)
    values[peak] = 0.12
    line = tuple(values.tolist())
    signal = SignalBeside(
        channel="beam_left_z",
        start=1.0,
        step=1e-3,
        measured=(0.0, 1.0, 0.0, -1.0),
        predicted=(0.0, 0.9, 0.0, -0.9),
        frequency=(10.0, 11.0, None, 20.0, 21.0),
        spectrum=(1e-6, 1e-4, None, 1e-5, 1e-6),
        missed=(1e-7, 1e-6, None, 1e-7, 1e-7),
        missed_after=(1e-8, 1e-7, None, 1e-8, 1e-8),
    )
    pair = {"off_percent_after": 0.01, "mac_after": 0.9999}
    return DiscrepancyResult(
        modes=(
            ModeBeside(simulated=10.8, measured=10.4, off_percent=-3.7, std_percent=0.1, mac=0.98, **pair),
            ModeBeside(simulated=38.6, measured=37.2, off_percent=-3.6, std_percent=0.05, mac=0.99, **pair),
            ModeBeside(simulated=60.0, measured=None, off_percent=None, std_percent=None, mac=None),
            ModeBeside(simulated=None, measured=71.5, off_percent=None, std_percent=None, mac=None),
        ),
        rows=(10.8, 38.6, 60.0),
        columns=(10.4, 37.2, 71.5),
        mac=((0.98, 0.01, 0.2), (0.0, 0.99, 0.1), (0.1, 0.0, None)),
        sensors=(
            SensorBeside(channel="beam_left_z", comac=0.99, residual=0.08, noise=0.01, missed=0.1, missed_least=0.02),
            SensorBeside(channel="col_037_x", comac=0.999, residual=0.01, noise=0.01, missed=0.03, missed_least=0.02),
        ),
        balance=BalanceResult(
            loss=line, loss_std=(0.002,) * len(NODES), added=line, added_std=(0.002,) * len(NODES), log_odds=log_odds
        ),
        signals=(signal,),
        trends=(
            TrendBeside(
                mode=10.4, over="temperature", unit="K", at=(10.0, 20.0), change_percent=(0.1, -0.1),
                std_percent=(0.02, 0.02), slope=-0.02, slope_std=0.003,
            ),
        ),
        places=(
            PlaceDensity(
                cause="added_mass", member=("crossbeam",) * 3,
                position=((-0.1, 0.0, 1.48), (0.0, 0.0, 1.48), (0.1, 0.0, 1.48)), density=(0.1, 1.0, 8.0),
            ),
        ),
    )  # fmt: skip


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


def test_modes_sensors_and_places_are_told(tmp_path: Path) -> None:
    page = page_of(shown(), tmp_path)
    for words in ("-3.70 ± 0.10", "-37.0", "not seen", "71.500", "beam_left_z lies farthest", "8.0 times what noise"):
        assert words in page.words
    for start in ("Measured frequencies", "MAC of", "Residual", "Frequencies over temp", "Where along", "beam_left_z"):
        assert any(text.startswith(start) for text in page.pictures), start


@pytest.mark.parametrize(
    ("log_odds", "readings"), [(40.0, ["mass"]), (-40.0, ["stiffness"]), (1.0, ["mass", "stiffness"])]
)
def test_only_the_reading_of_forces_that_is_clearly_better_is_shown(
    log_odds: float, readings: list[str], tmp_path: Path
) -> None:
    page = page_of(shown(log_odds), tmp_path)
    found = [text for text in page.pictures if text.startswith("Forces left over")]
    assert [text.split("read as ")[1].split()[0] for text in found] == readings
    x, y, z = NODES[7]
    assert all(f"+12.0 ± 0.2 % at ({x:.3f}, {y:.3f}, {z:.3f}) m" in text for text in found)


def test_what_is_missing_leaves_its_part_out(tmp_path: Path) -> None:
    bare = shown().model_copy(update={"balance": None, "signals": (), "trends": (), "places": (), "note": "too short"})
    page = page_of(bare, tmp_path)
    assert "too short" in page.words
    assert not any(text.startswith(("Forces", "Where along", "Frequencies over")) for text in page.pictures)
