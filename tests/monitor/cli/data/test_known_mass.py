"""Option `--known-mass` of `diagnose`: its text, its place, and errors of its log."""

from pathlib import Path
from typing import get_args

import pytest

from monitor.cli.data.diagnose.arguments import Logs, MassLog
from monitor.errors import ArgumentError, State
from updater import parse_structure, t_structure_toml


@pytest.mark.parametrize(
    "text", ["0.1@0,0,1", "a.mcap=0@0,0,1", "a.mcap=inf@0,0,1", "a.mcap=0.1@0,1", "a.mcap=0.1@0,0,nan", "a.mcap"]
)
def test_text_that_is_no_known_mass_is_refused(text: str) -> None:
    with pytest.raises(ArgumentError, match=r"^--known-mass: expected LOG=KG@X,Y,Z"):
        MassLog.of(text)


def test_place_on_no_member_is_refused() -> None:
    structure = parse_structure(t_structure_toml())
    MassLog.of("a.mcap=0.1@0.2,0,1.48").check_place(structure)
    with pytest.raises(ArgumentError, match=r"^--known-mass: "):
        MassLog.of("a.mcap=0.1@5,5,5").check_place(structure)


def test_errors_of_every_state_name_its_logs() -> None:
    logs = Logs(
        current=(Path("now.mcap"),),
        reference=(Path("before.mcap"),),
        heldout=(Path("kept.mcap"),),
        mass=(MassLog.of("heavier=1.mcap=0.1@0,0,1"),),
    )
    found = {state: [str(path) for path in logs.of_state(state)] for state in get_args(State)}
    names = {"current": "now.mcap", "reference": "before.mcap", "heldout": "kept.mcap", "mass": "heavier=1.mcap"}
    assert found == {state: [name] for state, name in names.items()}
