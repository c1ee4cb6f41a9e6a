"""The stated gain is that of the written file; diagnosed against fresh windows, the file needs no further cause."""

import pytest

from tests.examiner.cases import draw
from tests.examiner.path import stiffer
from tests.support.thorough import few_of
from tests.support.updater.written_models import closed_loop
from updater import Structure, build_model
from updater.diagnosis.gain import read_back
from updater.fe import Model

STRUCTURAL = ("added_mass", "support_stiffness", "local_stiffness")
AGAIN = ("model_parameters", *STRUCTURAL)


@pytest.mark.parametrize(
    ("cell", "seed"),
    few_of(
        [
            ("sensor_swap", 8001),
            ("bridge: added_mass", 8001),  # shows a twist that the reference has not, and the fit must take up
            ("added_mass", 8001),
            ("added_mass", 9006),  # taken off, and the file does not have it
            ("portal: support_stiffness", 8001),
            ("mast: distributed_mass", 8003),  # shows a twist, by which the load on its axis hardly turns
        ],
        1,
    ),
)
def test_stated_gain_matches_the_written_file(cell: str, seed: int) -> None:
    """Loaded from its text, paired by other means: to the last digits; without noise within the effect of noise."""
    case = draw(cell, seed)
    cause = case.done.hidden[0].cause
    loop = closed_loop(case, only=(cause,), again_only=(*AGAIN, *({cause} - set(AGAIN))))
    gained = loop.found.explained.gained
    assert gained is not None
    assert gained.gain.heldout
    error, noise = gained.gain.frequency_error_percent, gained.gain.noise_percent
    assert error.after is not None
    assert noise is not None
    print(f"{cell}: {error.after:.4f} % stated, {loop.error:.4f} % by the file, {loop.true_error:.4f} % without noise")
    assert gained.gain.n_modes == gained.gain.n_measured  # all, whether they chose the causes or not
    assert loop.error == pytest.approx(error.after, rel=1e-6)
    assert loop.true_error == pytest.approx(error.after, abs=3 * noise)
    assert error.after < 0.2  # what a beam model is taken to be wrong by
    assert gained.gain.exceeds_noise  # noise leaves a fifth of it
    assert loop.again is not None
    assert loop.again.explained.diagnosis.verdict == "nothing_to_explain"


def test_reported_mode_frequencies_match_the_written_file() -> None:
    """Frequencies with the causes are those of the loaded file, not predicted changes of the measured ones."""
    loop = closed_loop(draw("added_mass", 8002), only=("added_mass",), again_only=("model_parameters",))
    assert loop.written is not None
    own = build_model(loop.written, shear_flexible=True, mass="consistent").modes(30).frequency
    reported = [mode.frequency.after for mode in loop.found.explained.diagnosis.modes if mode.frequency.measured]
    assert len(reported) >= 8
    for frequency in reported:
        assert frequency is not None
        assert min(abs(own / frequency - 1)) < 1e-9


def test_a_written_model_with_other_changes_than_predicted_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A right cause is not named if the model with it written in is 1.5 % off in frequency: 3 % in stiffness."""

    def otherwise(structure: Structure) -> Model:
        return read_back(stiffer(structure, 1.03))

    monkeypatch.setattr("updater.diagnosis.explanation.read_back", otherwise)
    found = closed_loop(draw("added_mass", 8002), only=("added_mass",)).found
    assert found.diagnosis.verdict == "unexplained"
    assert found.explained.next_measurement == "other_model"
    assert found.explained.extended is None
