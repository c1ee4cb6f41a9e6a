"""Commissioning with a known mass: missing conditions are reported, and the result is compared with the truth."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from monitor.watch.commissioning import ProofError, gather, prove
from monitor.watch.memory import MEMORY, memory_text
from tests.support.monitor.cli import Commands
from tests.support.monitor.played_windows import BASELINE, Played, run, without_answers
from updater import Body, t_structure_toml

MASS, AT = 0.25, (0.0, 0.0, 0.9)


def test_unmet_conditions_of_the_proof_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(31, monkeypatch)
    pipeline = played.pipeline()
    run(pipeline, played.windows(3))
    with pytest.raises(ProofError, match=f"3 of {BASELINE} windows: attach the mass once it is"):
        gather(pipeline.memory, played.structure, played.settings)
    run(pipeline, played.windows(BASELINE))
    with pytest.raises(ProofError, match="no change detected: attach the mass, and repeat after 30 min; a mass that"):
        gather(pipeline.memory, played.structure, played.settings)
    without_answers(monkeypatch)
    played.put(Body(at=AT, mass=MASS))
    run(pipeline, played.windows(1))
    with pytest.raises(ProofError, match="a change is detected, but in too few windows: repeat after 30 min"):
        gather(pipeline.memory, played.structure, played.settings)


@pytest.mark.thorough
def test_proof_with_a_known_mass_from_the_saved_state(
    modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_answers(monkeypatch)
    played = Played(32, monkeypatch)
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE))
    played.put(Body(at=AT, mass=MASS))
    run(pipeline, played.windows(4))
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (tmp_path / "site.toml").write_text(played.text, encoding="utf-8")
    words = ("prove", tmp_path / "site.toml", "--mass", str(MASS), "--position", "0,0.9")
    refused = modalwatch(*words)
    assert (refused.code, "the monitor has no baseline: it has never run" in refused.err) == (2, True)

    (tmp_path / "state").mkdir()
    (tmp_path / "state" / MEMORY).write_text(memory_text(pipeline.memory), encoding="utf-8")
    done = modalwatch(*words)
    assert (done.code, done.err) == (0, ""), done.out
    assert done.out.count(" ok") == 3
    [kept] = (tmp_path / "state" / "proofs").iterdir()
    found = json.loads(kept.read_text(encoding="utf-8"))
    assert found["passed"]
    assert found["windows"]["n"] == 3
    # each modal mass is what the true mode's motion there says, to the deviations and what one mode alone leaves out
    assert len(found["modes"]) >= 3
    for mode in found["modes"]:
        scale = mode["modal_mass_over_model"]
        assert abs(scale["value"] - 1) < 4 * scale["std"] + 0.05

    # another mass, or elsewhere: not proven, which scales nothing and leaves the proof of before as it is
    for mass, at, failed in (("0.1", "0,0.5", ["place", "mass"]), (str(MASS), "0.3,1.48", ["place"])):
        wrong = modalwatch(*words[:3], mass, "--position", at, "--json", tmp_path / "wrong.json", "--force")
        reported = json.loads((tmp_path / "wrong.json").read_text(encoding="utf-8"))
        assert [check["what"] for check in reported["checks"] if not check["passed"]] == failed
        assert (wrong.code, reported["passed"], reported["modes"], "NOT proven" in wrong.out) == (1, False, [], True)
    assert modalwatch(*words[:3], "0.1", "--position", "0,0.9").code == 1
    names = sorted(path.name for path in (tmp_path / "state" / "proofs").iterdir())
    assert names == [kept.name, kept.name.replace(".json", "_2.json")]


def test_invalid_positions_are_refused(modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(33, monkeypatch)
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (tmp_path / "site.toml").write_text(played.text, encoding="utf-8")
    for at in ("here", "1", "1,2,3,4", ""):
        refused = modalwatch("prove", tmp_path / "site.toml", "--mass", "0.1", "--position", at)
        assert (refused.code, "--position: expected X,Z or X,Y,Z in metres" in refused.err) == (2, True)
    evidence = SimpleNamespace(structure=played.structure, found=None, diagnosis=None)
    with pytest.raises(ProofError, match="is 500 mm off the nearest member, column: expected within 50"):
        prove(evidence, 0.1, (0.5, 0.0, 0.5))  # type: ignore[arg-type]
