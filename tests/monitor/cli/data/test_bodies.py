"""`modalwatch bodies`: bodies at known places by frequencies of several records; the truth is a Ritz model."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.support.monitor.cli import Commands, assert_refused
from tests.support.thorough import few_of
from tests.support.updater.ritz_cantilever import BEAM, Clamp, frequencies, structure_file

NOISE, SCATTER = 2e-4, 3e-3  # of a frequency
MASS = 0.03 * BEAM
TRUTH, FILE = Clamp(taper=0.04), Clamp(mass=0.45)
PLACES = [[0.06, 0.13, 0.2, 0.28], [0.072, 0.12, 0.215, 0.28], [0.05, 0.14, 0.2, 0.3]]
BODIES = "".join(f'[[body]]\nname = "{name}"\nmass = {MASS}\n' for name in "ABCD")


def bodies_file(
    folder: Path,
    off: Sequence[int],
    *,
    seed: int = 1,
    head: str = 'structure = "beam.toml"\n' + BODIES,
    clamp_after: Clamp = TRUTH,
) -> Path:
    """Write the files of a beam with four bodies in three records, some of which are taken off."""
    random = np.random.default_rng((3101, seed))
    (folder / "beam.toml").write_text(structure_file([], FILE), encoding="utf-8")
    text = head
    for places in PLACES:
        before = frequencies([(x, MASS) for x in places], TRUTH)
        after = frequencies([(x, MASS) for k, x in enumerate(places) if k not in off], clamp_after)
        before = before * np.exp(NOISE * random.standard_normal(5))
        after = after * np.exp(np.hypot(NOISE, SCATTER) * random.standard_normal(5))
        text += f"[[record]]\nat = {[[x, 0.0, 0.0] for x in places]}\n"
        text += f"before = {before.tolist()}\nafter = {after.tolist()}\n"
        text += f"before_std = {(NOISE * before).tolist()}\nafter_std = {(NOISE * after).tolist()}\n"
    path = folder / "bodies.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("off", [(), (0, 2), *few_of([((1,),), ((1, 2, 3),)], 0)], ids=str)
def test_removed_bodies_are_identified_with_their_masses(
    tmp_path: Path, modalwatch: Commands, off: tuple[int, ...]
) -> None:
    out = tmp_path / "found.json"
    done = modalwatch("bodies", bodies_file(tmp_path, off), "--json", out)
    found = json.loads(out.read_text(encoding="utf-8"))
    assert (done.code, done.err) == (0, ""), done
    assert found["verdict"] == ("explained" if off else "nothing_to_explain")
    assert found["sets"][0]["bodies"] == ["ABCD"[k] for k in off]
    assert sum(one["probability"] for one in found["sets"]) == pytest.approx(1)
    assert len(found["records"]) == len(PLACES)
    for k, body in enumerate(found["bodies"]):
        assert (body["probability"] > 0.5) == (k in off)
        if body["mass"]:
            assert abs(body["mass"]["value"] - MASS) < 4 * body["mass"]["std"]
            assert f"{body['name']} removed" in done.out


def test_added_bodies_are_identified(tmp_path: Path, modalwatch: Commands) -> None:
    """The same frequencies with both states exchanged, and bodies B and D that stay."""
    path = bodies_file(tmp_path, (0, 2))
    text = path.read_text(encoding="utf-8")
    for old, new in (("before", "_"), ("after", "before"), ("_ =", "after ="), ("__std", "after_std")):
        text = text.replace(old, new)
    for name in "AC":
        text = text.replace(f'name = "{name}"', f'name = "{name}"\nchange = "added"')
    path.write_text(text, encoding="utf-8")
    done = modalwatch("bodies", path)
    assert done.code == 0, done
    assert "A added, C added" in done.out


def test_tables_of_modes_replace_lists_of_frequencies(tmp_path: Path, modalwatch: Commands) -> None:
    path = bodies_file(tmp_path, (1,))
    lines: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        key, _, values = line.partition(" = ")
        if key in {"before", "after"}:
            table = tmp_path / f"{key}_{len(lines)}.csv"
            table.write_text("frequency\n" + values.strip("[]").replace(", ", "\n"), encoding="utf-8")
            lines.append(f'{key} = "{table.name}"')
        elif not key.endswith("_std") or key == "mass_std":
            lines.append(line)
    path.write_text("\n".join(lines), encoding="utf-8")
    done = modalwatch("bodies", path)
    assert "B removed" in done.out, done


def test_a_change_that_no_body_explains_is_unexplained(tmp_path: Path, modalwatch: Commands) -> None:
    """The clamp becomes twice as flexible."""
    softer = Clamp(shifts=2 * TRUTH.shifts, turns=2 * TRUTH.turns, mass=TRUTH.mass, taper=TRUTH.taper)
    done = modalwatch("bodies", bodies_file(tmp_path, (), clamp_after=softer))
    assert done.code == 1, done
    assert done.out.startswith("unexplained: no set of the bodies fits"), done


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "B"', 'name = "A"', "body: expected names that differ, found 'A' twice"),
        ("mass = ", "mas = ", "body 1: mass: expected a value, found none"),
        ("[0.06, 0.0, 0.0], ", "", "record 1: at: expected 4 places, found 3"),
        ("[0.072, 0.0, 0.0]", "[0.072, 0.0, 0.5]", "record 2"),
        ("before = [", "before = [1e9, ", "record 1: before_std: expected one number per frequency of before, found 5"),
        (
            "after = [",
            'after = "after.csv"  # [',
            "record 1: after_std: expected none where `after` is a file, found 5",
        ),
        ("beam.toml", "no.toml", "no.toml: cannot be read"),
    ],
    ids=["name", "field", "places", "off the beam", "deviations", "left over", "structure"],
)
def test_errors_name_file_and_field(tmp_path: Path, modalwatch: Commands, old: str, new: str, message: str) -> None:
    path = bodies_file(tmp_path, ())
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    done = modalwatch("bodies", path)
    assert_refused(done, message, tmp_path)


def test_read_errors_contain_no_library_messages(tmp_path: Path, modalwatch: Commands) -> None:
    path = tmp_path / "bodies.toml"
    assert_refused(modalwatch("bodies", path), f"{path}: cannot be read: No such file or directory")
    path.write_text('structure = "beam.toml"\nbody = []\nrecord = []\n', encoding="utf-8")
    assert_refused(modalwatch("bodies", path), f"{path}: body: expected at least 1, found 0")
