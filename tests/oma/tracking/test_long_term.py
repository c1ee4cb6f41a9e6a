"""Identities through simulated days; statistics over months are in benchmarks/oma/tracking.py."""

from collections import Counter, defaultdict
from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray
from oma import FollowedModes, LongTermTracker, ModalEstimate, Tracks, normalise
from tests.support.monitor.seasons import FREQUENCY, RARE, STRANGE, WINDOW, Month, month
from tests.support.thorough import few_of

WEEK = Month(days=5, rare=0.1)  # the whole season's drift in five days


def identities(what: Month, seed: int) -> tuple[dict[int, Counter[int]], FollowedModes]:
    """Return for each mode how often it got which identity, and the end of it."""
    tracks, found = None, defaultdict[int, Counter[int]](Counter)
    for estimate, modes in month(what, seed):
        followed = LongTermTracker().follow(tracks, estimate)
        tracks = followed.tracks
        assert len(set(followed.identity.tolist())) == estimate.n_modes
        for mode, identity in zip(modes.tolist(), followed.identity.tolist(), strict=True):
            found[mode][identity] += 1
    return found, followed


@pytest.mark.parametrize("seed", few_of([1, 2]))
def test_modes_keep_their_identities_through_drift_crossing_and_outages(seed: int) -> None:
    found, last = identities(WEEK, seed)
    real = {mode: count for mode, count in found.items() if mode != STRANGE}
    assert [len(count) for count in real.values()] == [1] * len(FREQUENCY)  # one identity each, from first to last
    taken = [set(count) for count in real.values()]
    assert len(set.union(*taken)) == len(FREQUENCY)
    assert sum(real[RARE].values()) < 0.2 * 144 * WEEK.days
    tracks = last.tracks
    # crossed: the fourth and fifth mode stand the other way round in the end
    by_identity = dict(zip(tracks.identity.tolist(), tracks.frequency.tolist(), strict=True))
    fourth, fifth = (by_identity[next(iter(real[k]))] for k in (3, 4))
    assert fourth > fifth
    assert fourth == pytest.approx(FREQUENCY[3] * 1.05, rel=0.01)
    # a false mode in each tenth window leaves nothing behind that counts as known
    assert (tracks.seen >= LongTermTracker().confirm).sum() == len(FREQUENCY)


def test_identities_continue_after_sudden_frequency_change() -> None:
    found, _ = identities(replace(WEEK, jump=0.03, unseen=0.0), 3)
    for mode in set(found) - {STRANGE, RARE}:
        (best, total), others = found[mode].most_common(1)[0], sum(found[mode].values())
        assert best in found[mode]
        assert others - total == LongTermTracker().confirm - 1  # new ones, until they are seen often enough


def test_tracks_are_restored_exactly_after_restart() -> None:
    windows = list(month(replace(WEEK, days=1), 4))
    tracks: Tracks | None = None
    restarted: Tracks | None = None
    for estimate, _ in windows:
        followed = LongTermTracker().follow(tracks, estimate)
        again = LongTermTracker().follow(restarted, estimate)
        assert followed.identity.tolist() == again.identity.tolist()
        tracks, restarted = followed.tracks, Tracks.from_json(again.tracks.to_json())
    assert tracks is not None
    assert restarted is not None
    assert tracks.to_json() == restarted.to_json()
    for text in ("[]", "{}", tracks.to_json().replace("identity", "name")):
        with pytest.raises(ValueError, match="expected what Tracks"):
            Tracks.from_json(text)


def two(k: int, frequency: list[float], angle: float) -> ModalEstimate:
    """Return two modes whose orthogonal shapes are turned into each other."""
    shape = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0]])
    values: FloatArray = np.array(frequency)
    start = round(k * WINDOW * 1e9)
    return ModalEstimate(
        channels=("a", "b", "c"),
        frequency=values,
        frequency_std=1e-3 * values,
        damping=np.full(2, 0.01),
        damping_std=np.full(2, 0.001),
        shape=normalise(shape),
        shape_std=np.full((2, 3), 0.01),
        support=np.ones(2),
        law_ratio=np.ones(2),
        start=start,
        end=start + round(WINDOW * 1e9),
    )


def test_only_mixed_modes_are_marked_doubtful() -> None:
    tracks: Tracks | None = None
    for k in range(20):
        followed = LongTermTracker().follow(tracks, two(k, [5.0, 5.01], 0.0))
        tracks = followed.tracks
        assert not followed.doubtful.any()
    assert followed.known.all()
    mixed = LongTermTracker().follow(tracks, two(20, [5.004, 5.006], np.pi / 4))
    assert mixed.doubtful.all()
    assert sorted(mixed.identity.tolist()) == [1, 2]
    crossed = LongTermTracker().follow(tracks, two(20, [4.995, 5.015], np.pi / 2))
    assert crossed.identity.tolist() == [2, 1]
    assert not crossed.doubtful.any()


def test_unobserved_mode_follows_the_common_drift() -> None:
    tracks: Tracks | None = None
    for k in range(20):
        tracks = LongTermTracker().follow(tracks, two(k, [5.0, 7.0], 0.0)).tracks
    assert tracks is not None
    warm = two(20 + 144, [5.05, 7.07], 0.0)  # a day later, both 1 % higher; the second is not seen
    names = ("frequency", "frequency_std", "damping", "damping_std", "shape", "shape_std", "support", "law_ratio")
    alone = replace(warm, **{name: getattr(warm, name)[:1] for name in names})
    moved = LongTermTracker().follow(tracks, alone).tracks
    # of 1 %, the share that the common walk has in both walks
    follower = LongTermTracker()
    share = 1 / (1 + (follower.own_drift / follower.common_drift) ** 2)
    assert np.log(moved.frequency[1] / 7.0) == pytest.approx(np.log(1.01) * share, rel=0.05)
    # known to what one walks by itself in a day, and to as much of the other's own walk as was taken for common
    own = follower.own_drift * np.sqrt(24) * np.sqrt(1 + share)
    assert moved.frequency_std[1] / moved.frequency[1] == pytest.approx(own, rel=0.15)


def test_unrelated_channels_are_refused() -> None:
    first = two(0, [5.0, 6.0], 0.0)
    tracks = LongTermTracker().follow(None, first).tracks
    with pytest.raises(ValueError, match="expected at least 2 of the channels"):
        LongTermTracker().follow(tracks, replace(first, channels=("d", "e", "f")))
    fewer = replace(first, channels=("a", "b"), shape=first.shape[:, :2], shape_std=first.shape_std[:, :2])
    assert LongTermTracker().follow(tracks, fewer).identity.tolist() == [1, 2]
