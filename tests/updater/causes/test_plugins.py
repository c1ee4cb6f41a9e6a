"""Causes of others: they join the catalogue, are weighed with ours, and a broken one spoils nothing."""

import logging
import runpy
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import build_model, diagnose, learn_reference, matched, stack_tracks
from updater.causes import CATALOGUE, CatalogueEntry
from updater.causes.catalogue import GROUP, Catalogue
from updater.causes.overall.stiffness import propose_global_stiffness

TRACK = np.arange(8)
EXAMPLE = Path(__file__).parents[3] / "examples" / "own_cause.py"


def ice() -> EntryPoint:
    """Entry point of the example, as an installed distribution would have it."""
    found = runpy.run_path(str(EXAMPLE))

    class OfExample(EntryPoint):
        def load(self) -> object:
            return found["propose_ice"]

    return OfExample("ice", "own_cause:propose_ice", GROUP)


@pytest.fixture
def with_ice(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    entry = ice()
    monkeypatch.setattr("updater.causes.catalogue.entry_points", lambda group: [entry] if group == GROUP else [])
    some = {name: CATALOGUE[name] for name in ("added_mass", "global_stiffness", "support_stiffness")}
    monkeypatch.setattr(CATALOGUE, "_own", some)
    vars(CATALOGUE).pop("_all")
    yield
    vars(CATALOGUE).pop("_all", None)


@pytest.mark.usefixtures("with_ice")
def test_example_plugin_cause_is_found_among_built_in_causes() -> None:
    """800 g along the crossbeam, as a denser crossbeam of another mesh, weighed with three of our own causes."""
    assert list(CATALOGUE)[-1] == "ice"
    random, gain = np.random.default_rng(901), np.ones(12)
    bare = true_model(np.random.default_rng(902))
    reference = learn_reference(t_frame(), [measure(bare, random, gain) for _ in range(8)], [TRACK] * 8)
    structure, steel = bare.structure, bare.structure.material["steel"]
    beam = structure.member_named("crossbeam")
    area = structure.section[beam.section].area
    iced = steel.model_copy(update={"density": steel.density + 0.8 / (area * beam.length)})
    members = [m.model_copy(update={"material": "iced"}) if m == beam else m for m in structure.member]
    changed = structure.model_copy(update={"material": {"steel": steel, "iced": iced}, "member": tuple(members)})
    true = build_model(changed, shear_flexible=True, mass="consistent")
    windows = stack_tracks([measure(true, random, gain) for _ in range(5)], [TRACK] * 5)
    found = diagnose(reference, matched(reference.baseline, reference.mean_of(windows)))
    assert found.diagnosis.causes[0].cause == "ice"
    assert found.diagnosis.causes[0].where is not None
    assert found.diagnosis.causes[0].where.member == "crossbeam"
    mass = found.diagnosis.causes[0].parameters["mass"]
    assert abs(mass.value - 0.8) < 4 * mass.std
    assert found.extended is not None
    assert sum(b.mass for b in found.extended.body) == pytest.approx(mass.value, abs=2 * mass.std)


@pytest.mark.parametrize(
    ("name", "value", "problem"),
    [
        ("rust", "no_such_module:propose", "ModuleNotFoundError"),
        ("rust", "math:pi", "expected a function, found 3.14"),
        ("rust", "math:no_such_name", "AttributeError"),
        ("global_stiffness", "math:floor", "that name is taken"),
    ],
)
def test_unusable_plugin_is_reported_and_left_out(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, name: str, value: str, problem: str
) -> None:
    monkeypatch.setattr("updater.causes.catalogue.entry_points", lambda group: [EntryPoint(name, value, group)])
    catalogue = Catalogue({"global_stiffness": CatalogueEntry(propose=propose_global_stiffness)})
    with caplog.at_level(logging.WARNING):
        assert list(catalogue) == ["global_stiffness"]
    assert catalogue["global_stiffness"].propose is propose_global_stiffness
    assert len(catalogue) == 1
    (record,) = caplog.records
    assert problem in record.message
    assert f"cause {name} ({value}) is left out" in record.message
