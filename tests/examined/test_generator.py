"""The examiner itself: its mechanics compared with closed forms, and its independence of the code under test."""

import ast
from pathlib import Path

import numpy as np
import pytest

from oma import identify
from tests.examiner.cases import CAUSES, detection_power, draw
from tests.examiner.designs import BRIDGE, DESIGNS
from tests.examiner.draws import Done, Hidden
from tests.examiner.models.bar import Bar
from tests.examiner.models.frame import Frame, Ground, Lump, Meeting
from tests.examiner.models.specimen import draw_state
from tests.examiner.score import score
from tests.examiner.signals import estimated, recorded

ARGUMENTS = {"modulus": 210e9, "shear_modulus": 80.8e9, "density": 7850.0, "shear_factor": 0.44}
JUDGED = {"updater", "monitor"}


def t_frame(size: float, **changes: object) -> Frame:
    """The reference frame as it is published: clamped, rigid joint."""
    section = {"area": 4.1934e-4, "second_moment": (9.3e-8, 9.3e-8), "torsion_constant": 1.58e-7, "size": size}
    both: dict[str, object] = ARGUMENTS | section | changes
    column = Bar(name="column", start=(0, 0, 0), axis=2, length=1.48, **both)  # type: ignore[arg-type]
    beam = Bar(name="crossbeam", start=(-0.4, 0, 1.48), axis=0, length=0.8, breaks=(0.4,), **both)  # type: ignore[arg-type]
    return Frame(
        bars=(column, beam),
        grounds=(Ground(bar="column", s=0.0, about=(1e9,) * 3),),
        meetings=(Meeting(bar="column", s=1.48, other="crossbeam", t=0.4, about=(1e9,) * 3),),
    )


def test_generator_does_not_import_code_under_test() -> None:
    """Only the way to it (tests.examiner.path) may import it; the analysis it uses gives a type and a law, no modes."""
    folder = Path(__file__).parents[1] / "examiner"
    files = [p for p in folder.rglob("*.py") if p.name != "path.py"]
    assert len(files) >= 17
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not JUDGED & {name.split(".")[0] for name in names}, path
            ours = [name for name in names if name.startswith("tests.")]
            assert all(name.startswith("tests.examiner") and name != "tests.examiner.path" for name in ours), path


def test_frame_frequencies_match_data_sheet() -> None:
    """10 mm Timoshenko elements gave these; two digits after the point are printed, 0.005 Hz is half of the last."""
    sheet = [10.78, 10.97, 38.84, 68.77, 92.53, 158.02, 253.11, 270.96]
    loaded = [10.36, 10.55, 36.65, 66.37, 91.93, 153.98, 241.08, 269.60]
    frame = t_frame(0.03)
    np.testing.assert_allclose(frame.solved(8).frequency, sheet, rtol=1e-4, atol=5e-3)
    body = Lump(bar="crossbeam", s=0.65, mass=0.304)
    with_body = Frame(**(vars(frame) | {"lumps": (body,)}))
    np.testing.assert_allclose(with_body.solved(8).frequency, loaded, rtol=1e-4, atol=5e-3)


@pytest.mark.parametrize("name", DESIGNS)
def test_frequencies_of_drawn_structures_are_near_nominal_design(name: str) -> None:
    """The file's numbers, solved by the examiner: those of bars on springs that are not scattered."""
    design = DESIGNS[name]
    drawn = np.median([design.draw(seed).motion(4).frequency for seed in range(5)], axis=0)
    frame = Frame(bars=design.bars, grounds=design.grounds, meetings=design.meetings, lumps=design.bodies)
    for bar in frame.bars:
        frame = frame.with_bar(bar.name, breaks=frame.stops(bar.name)[1:-1])
    np.testing.assert_allclose(drawn, frame.solved(4).frequency, rtol=0.03)


def test_bridge_bending_frequency_is_near_simply_supported_beam() -> None:
    """f = n^2 pi / 2 sqrt(E I / m L^4) of a beam on pins; springs, shear and turning take some of it."""
    girder = BRIDGE.bars[0]
    line = girder.density * girder.area
    pinned = np.pi / 2 * np.sqrt(girder.modulus * girder.second_moment[0] / (line * girder.length**4))
    upright = Frame(bars=BRIDGE.bars, grounds=BRIDGE.grounds).solved(2).frequency[1]
    assert 0.98 < upright / pinned < 1.0


def test_frequencies_converge_with_fourth_order() -> None:
    """Quadratic elements: halving them divides the error of the eighth mode by 16 (8 to 32 while it is coarse)."""
    fine = t_frame(0.01).solved(8).frequency[7]
    coarse, half = (t_frame(size).solved(8).frequency[7] for size in (0.2, 0.1))
    assert 8 < (coarse - fine) / (half - fine) < 32


def test_modes_of_simulated_record_match_stated_modes() -> None:
    """Frequencies within four of the deviations that identification states, damping within a factor of two."""
    state = draw_state(5)
    found = identify(recorded(state, 60.0, np.random.default_rng(6)))
    reported = estimated(state, 1, np.random.default_rng(7), noise="law")[0]
    assert found.n_modes >= 8
    for mode in range(2, 8):  # the first two are 0.2 Hz apart and mix
        nearest = int(np.argmin(np.abs(found.frequency - reported.frequency[mode])))
        off = abs(found.frequency[nearest] - state.claimed_frequency(8)[mode])
        assert off < 4 * found.frequency_std[nearest]
        assert 0.5 < found.damping[nearest] / state.modal_damping(8)[mode] < 2
        assert abs(np.vdot(found.shape[nearest], reported.shape[mode])) ** 2 > 0.99


@pytest.mark.parametrize("name", CAUSES)
def test_drawn_cause_is_detectable_and_recorded(name: str) -> None:
    case = draw(name, 8)
    assert [one.cause for one in case.done.hidden] == [name]
    assert detection_power(case.done) >= 0.99


def test_detection_power_is_low_for_no_change_and_small_changes() -> None:
    """By its definition the test detects something in one of a hundred cases without a change."""
    assert detection_power(draw("nothing", 9).done) == pytest.approx(0.01, abs=1e-3)
    assert detection_power(draw("small", 10).done) <= 0.03


def _said(verdict: str, *causes: tuple[str, list[float] | None, list[str], list[str]]) -> dict[str, object]:
    return {
        "verdict": verdict,
        "causes": [
            {
                "cause": name,
                "probability": 0.99,
                "where": {"position": position, "channels": channels, "region": []} if position or channels else None,
                "cannot_be_told_from": others,
                "parameters": {"mass": {"value": 0.21, "std": 0.01, "unit": "kg"}},
            }
            for name, position, channels, others in causes
        ],
    }


MASS = Hidden(cause="added_mass", position=(0.0, 0.0, 1.0), parameters={"mass": 0.2})
DEVICES = Hidden(cause="sensor_swap", channels=("a", "b", "c", "d"))
GAIN = Hidden(cause="sensor_gain", channels=("a",))


@pytest.mark.parametrize(
    ("reported", "hidden", "kind", "outcome"),
    [
        (_said("explained", ("added_mass", [0, 0, 1.05], [], [])), [MASS], "detectable", "right"),
        (_said("explained", ("added_mass", [0, 0, 1.2], [], [])), [MASS], "detectable", "misplaced"),
        (_said("explained", ("sensor_gain", None, ["a"], [])), [GAIN], "detectable", "right"),
        (_said("explained", ("sensor_gain", None, ["b"], [])), [GAIN], "detectable", "misplaced"),
        (_said("explained", ("sensor_gain", None, ["a"], [])), [MASS], "detectable", "wrong"),
        (_said("explained", ("sensor_swap", None, ["a", "b"], [])), [DEVICES], "detectable", "misplaced"),
        (_said("explained", ("sensor_swap", None, ["c", "a", "d", "b"], [])), [DEVICES], "detectable", "right"),
        (_said("ambiguous", ("x", None, [], ["added_mass"])), [MASS], "detectable", "alias"),
        (_said("ambiguous", ("x", None, [], ["y"])), [MASS], "detectable", "wrong"),
        (_said("explained", ("added_mass", [0, 0, 1], [], [])), [MASS, GAIN], "two", "wrong"),
        (_said("unexplained"), [MASS], "detectable", "refused"),
        (_said("unexplained"), [], "outside", "right"),
        (_said("unexplained"), [], "nothing", "refused"),
        (_said("nothing_to_explain"), [MASS], "detectable", "missed"),
        (_said("nothing_to_explain"), [MASS], "small", "right"),
        (_said("nothing_to_explain"), [], "outside", "missed"),
        (_said("ambiguous", ("x", None, [], [])), [], "nothing", "wrong"),
    ],
)
def test_scorer_outcome_for_each_verdict_and_case(
    reported: dict[str, object], hidden: list[Hidden], kind: str, outcome: str
) -> None:
    assert score(reported, hidden, kind).outcome == outcome


def test_change_does_not_modify_the_initial_specimen() -> None:
    done: Done = draw("support_stiffness", 11).done
    assert done.before.frame == draw_state(11).frame
    assert done.after.frame != done.before.frame


def test_stretch_too_long_for_crossbeam_is_shortened() -> None:
    """Of the 30 cm that may be drawn, 27 have a place between the joint and an end; a draw of more had no end."""
    (hidden,) = draw("local_stiffness", 676400012).done.hidden
    assert 0.26 < hidden.parameters["extent"] < 0.28
