from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray
from oma import ModalEstimate, Tracker, identify, normalise
from tests.support.oma.structures import FRAME_FREQUENCY, frame, simulate
from tests.support.thorough import few_of


def estimate(frequency: FloatArray, shapes: FloatArray, relative_std: float = 1e-3) -> ModalEstimate:
    order = np.argsort(frequency)
    n, channels = len(frequency), tuple(frame().channels)
    return ModalEstimate(
        channels=channels,
        frequency=frequency[order],
        frequency_std=relative_std * frequency[order],
        damping=np.full(n, 0.005),
        damping_std=np.full(n, 0.001),
        shape=normalise(shapes[order]),
        shape_std=np.full(shapes.shape, 0.01),
        support=np.ones(n),
        law_ratio=np.ones(n),
        start=0,
        end=1,
    )


def some(whole: ModalEstimate, modes: list[int]) -> ModalEstimate:
    return estimate(whole.frequency[modes], whole.shape[modes].real)


REFERENCE = estimate(FRAME_FREQUENCY, frame().shapes)


def test_identities_are_kept_under_frequency_shift_by_added_mass() -> None:
    # 304 g on the frame: frequencies of the reference structure's definition
    shifted = np.array([10.36, 10.55, 36.65, 66.37, 91.93, 153.98, 241.08, 269.60])
    assert Tracker(reference=REFERENCE).assign(estimate(shifted, frame().shapes)).tolist() == list(range(8))


def test_close_modes_are_not_exchanged_when_their_frequencies_cross() -> None:
    crossed = FRAME_FREQUENCY.copy()
    crossed[:2] = 10.95, 10.75
    found = Tracker(reference=REFERENCE).assign(estimate(crossed, frame().shapes))
    assert found.tolist() == [1, 0, 2, 3, 4, 5, 6, 7]


@pytest.mark.parametrize(("modes", "found"), [([2], [2]), ([], [])])
def test_tracking_works_with_one_or_no_reference_mode(modes: list[int], found: list[int]) -> None:
    assert Tracker(reference=some(REFERENCE, modes)).assign(REFERENCE).tolist() == found


def test_mode_keeps_identity_after_temporary_absence() -> None:
    tracker = Tracker(reference=REFERENCE)
    assert tracker.assign(some(REFERENCE, [0, 2, 3, 4, 5, 6])).tolist() == [0, -1, 1, 2, 3, 4, 5, -1]
    assert tracker.assign(REFERENCE).tolist() == list(range(8))


def test_unknown_mode_gets_no_identity() -> None:
    frequency = np.append(FRAME_FREQUENCY, 10.8)
    stranger = np.random.default_rng(1).standard_normal((1, 12))
    found = estimate(frequency, np.vstack((frame().shapes, stranger)))
    assigned = Tracker(reference=REFERENCE).assign(found)
    assert np.array_equal(found.frequency[assigned], FRAME_FREQUENCY)


@pytest.mark.parametrize("turn", [-1.0, -0.6, 0.6, 1.0])
def test_unresolved_close_modes_are_tracked_by_frequency(turn: float) -> None:
    """Modes 1.4 % apart, known to 0.2 %: their shapes are turned into each other, here by up to 57 degrees."""
    turned = frame().shapes.copy()
    turned[0] = np.cos(turn) * frame().shapes[0] + np.sin(turn) * frame().shapes[1]
    turned[1] = np.cos(turn) * frame().shapes[1] - np.sin(turn) * frame().shapes[0]
    reference, found = (estimate(FRAME_FREQUENCY, s, 2e-3) for s in (frame().shapes, turned))
    assert Tracker(reference=reference).assign(found).tolist() == list(range(8))
    surer = estimate(FRAME_FREQUENCY, turned, 1e-4)  # a window that parts them, and modes that are others
    assert (Tracker(reference=estimate(FRAME_FREQUENCY, frame().shapes, 1e-4)).assign(surer)[:2] == -1).all() == (
        abs(turn) > 0.8
    )


def test_modes_are_tracked_with_missing_channels() -> None:
    kept = [i for i, name in enumerate(REFERENCE.channels) if not name.startswith("beam_left")]
    fewer = replace(
        REFERENCE,
        channels=tuple(REFERENCE.channels[i] for i in kept)[::-1],
        shape=normalise(REFERENCE.shape[:, kept[::-1]]),
        shape_std=REFERENCE.shape_std[:, kept],
    )
    assert Tracker(reference=REFERENCE).assign(fewer).tolist() == list(range(8))


@pytest.mark.parametrize(("n_common", "found"), [(0, [-1] * 8), (1, [-1] * 8), (12, list(range(8)))])
def test_modes_without_two_common_channels_are_not_assigned(n_common: int, found: list[int]) -> None:
    other = tuple(f"other_{i}" for i in range(n_common, 12))
    assert (
        Tracker(reference=REFERENCE).assign(replace(REFERENCE, channels=REFERENCE.channels[:n_common] + other)).tolist()
        == found
    )


@pytest.mark.parametrize("seed", few_of([20, 21]))
def test_modes_of_identified_windows_keep_their_identities(seed: int) -> None:
    found = identify(simulate(frame(), 60.0, 1000.0, seed))
    assigned = Tracker(reference=REFERENCE).assign(found)
    assert np.all(assigned >= 0)
    assert np.all(np.abs(found.frequency[assigned] / FRAME_FREQUENCY - 1) < 0.01)


def test_dissimilar_shapes_at_two_channels_are_not_tracked() -> None:
    """Two modes that look alike at both: every shape lies among them, and this one looks like neither."""
    both = replace(
        some(REFERENCE, [0, 1]),
        channels=tuple(frame().channels)[:2],
        frequency_std=np.full(2, 0.02),
        shape=normalise(np.array([[1.0, 0.0], [0.94, 0.34]])),
        shape_std=np.full((2, 2), 0.01),
    )
    across = normalise(np.array([[-0.2, 1.0], [-0.1, 1.0]]))
    assert Tracker(reference=both).assign(both).tolist() == [0, 1]
    assert Tracker(reference=both).assign(replace(both, shape=across)).tolist() == [-1, -1]


def alike(
    frequency: list[float], agreement: float, std: float = 1e-5, aside: float = 0.0, reference: bool = False
) -> ModalEstimate:
    """Return modes whose shapes agree to a MAC with the reference's, with `aside` at a channel that this lacks."""
    n = len(frequency)
    shape = np.tile([np.sqrt(agreement), np.sqrt(1 - agreement), 0.0, aside], (n, 1))
    return ModalEstimate(
        channels=("a", "b", "c") if reference else ("a", "b", "c", "aside"),
        frequency=np.array(frequency),
        frequency_std=std * np.array(frequency),
        damping=np.full(n, 0.01),
        damping_std=np.full(n, 0.001),
        shape=normalise(shape[:, :3] if reference else shape),
        shape_std=np.full((n, 3 if reference else 4), 0.01),
        support=np.ones(n),
        law_ratio=np.ones(n),
        start=0,
        end=1,
    )


@pytest.mark.parametrize(
    ("shift", "agreement", "std", "found"),
    [
        (0.07, 1.0, 1e-5, 0),  # a real change moves frequencies by up to 8 %, if the shape stays
        (0.085, 1.0, 1e-5, -1),
        (-0.07, 1.0, 1e-5, 0),
        (0.05, 0.81, 1e-5, 0),  # and agrees to a MAC of 0.8
        (0.05, 0.79, 1e-5, -1),
        (0.0015, 0.6, 1e-5, 0),  # within 0.2 % a MAC of 0.5 is enough
        (0.0025, 0.6, 1e-5, -1),
        (0.0015, 0.51, 1e-5, 0),
        (0.0015, 0.49, 1e-5, -1),
        (0.040, 0.6, 1e-2, 0),  # as within three deviations of the difference, here of 1.41 %
        (0.045, 0.6, 1e-2, -1),
    ],
)
def test_mode_is_tracked_only_within_frequency_and_mac_limits(
    shift: float, agreement: float, std: float, found: int
) -> None:
    reference = alike([10.0], 1.0, std, reference=True)
    moved = alike([10.0 * np.exp(shift)], agreement, std)
    assert Tracker(reference=reference).assign(moved).tolist() == [found]


@pytest.mark.parametrize(("frequency", "found"), [([10.1, 10.4], 0), ([9.6, 9.9], 1), ([9.7, 10.1], 1)])
def test_nearest_frequency_is_chosen_among_modes_of_equal_shape(frequency: list[float], found: int) -> None:
    assert Tracker(reference=alike([10.0], 1.0, reference=True)).assign(alike(frequency, 1.0)).tolist() == [found]


@pytest.mark.parametrize(("inside", "found"), [(0.75, [-1, -1]), (0.85, [0, -1])])
@pytest.mark.parametrize("aside", [0.0, 2.0])
def test_mixed_mode_needs_80_percent_of_shape_in_reference_shapes(
    inside: float, found: list[int], aside: float
) -> None:
    """A shape far from both of two modes 0.4 % apart that are known to 0.1 %, whatever its norm at shared channels."""
    reference = alike([10.0, 10.04], 1.0, 1e-3, reference=True)
    both = replace(reference, shape=np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], np.complex128))
    mixed = alike([10.0], 1.0, 1e-3)
    shape = np.array([[np.sqrt(0.49 * inside), np.sqrt(0.51 * inside), np.sqrt(1 - inside), aside]])
    assert Tracker(reference=both).assign(replace(mixed, shape=normalise(shape))).tolist() in (
        [found, found[::-1]] if inside > 0.8 else [found]
    )
