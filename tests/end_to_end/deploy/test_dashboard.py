"""The dashboard is well-formed: each panel has an identity, a title, a unit, a description and a place of its own."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

DEPLOY = Path(__file__).parents[3] / "deploy"
DASHBOARD = json.loads((DEPLOY / "grafana" / "dashboards" / "modalwatch.json").read_text(encoding="utf-8"))
PANELS: list[dict[str, Any]] = DASHBOARD["panels"]
SOURCE = DEPLOY / "grafana" / "provisioning" / "datasources" / "prometheus.yaml"


def test_panels_have_unique_identities_and_titles() -> None:
    for field in ("id", "title"):
        assert len({panel[field] for panel in PANELS}) == len(PANELS)


@pytest.mark.parametrize("panel", PANELS, ids=lambda panel: panel["title"])
def test_panel_has_description_unit_and_known_source(panel: dict[str, Any]) -> None:
    assert panel["title"]
    assert panel["description"].endswith(".")
    assert panel["fieldConfig"]["defaults"]["unit"]
    [source] = yaml.safe_load(SOURCE.read_text(encoding="utf-8"))["datasources"]
    named = [panel["datasource"], *(target["datasource"] for target in panel["targets"])]
    assert {(found["type"], found["uid"]) for found in named} == {(source["type"], source["uid"])}
    references = [target["refId"] for target in panel["targets"]]
    assert len(set(references)) == len(references)


def test_panels_do_not_overlap() -> None:
    taken: set[tuple[int, int]] = set()
    for panel in PANELS:
        at = panel["gridPos"]
        cells = {(at["x"] + i, at["y"] + j) for i in range(at["w"]) for j in range(at["h"])}
        assert at["x"] + at["w"] <= 24
        assert not cells & taken, panel["title"]
        taken |= cells


def test_repeated_panels_and_queries_use_defined_variables() -> None:
    names = {variable["name"] for variable in DASHBOARD["templating"]["list"]}
    assert {panel["repeat"] for panel in PANELS if "repeat" in panel} == {"mode"} <= names
    text = json.dumps(PANELS)
    assert all(f"${name}" in text for name in names)
