"""Tracks and means of windows that lack data of different devices."""

from dataclasses import replace

import numpy as np
import pytest

from oma import ModalEstimate
from updater.modal_data import choose_tracks, fuse

CHANNELS = ("a_x", "a_y", "a_z", "b_x", "b_y", "b_z")
A, B = CHANNELS[:3], CHANNELS[3:]


def window(channels: tuple[str, ...], n_modes: int = 4) -> ModalEstimate:
    """Return the first modes of one structure, as measured at some channels."""
    columns = [CHANNELS.index(c) for c in channels]
    frequency, ones = np.linspace(10.0, 10.0 * n_modes, n_modes), np.ones(n_modes)
    shape = np.random.default_rng(3).standard_normal((4, 6))[:n_modes, columns]
    return ModalEstimate(
        channels=channels,
        frequency=frequency,
        frequency_std=1e-3 * frequency,
        damping=0.005 * ones,
        damping_std=0.001 * ones,
        shape=(shape / np.linalg.norm(shape, axis=1, keepdims=True)).astype(np.complex128),
        shape_std=np.full(shape.shape, 2e-3),
        support=ones,
        law_ratio=ones,
        start=0,
        end=1,
    )


@pytest.mark.parametrize(("often", "rare"), [(A, B), (B, A)])
def test_windows_without_a_common_channel_are_not_compared(often: tuple[str, ...], rare: tuple[str, ...]) -> None:
    """Windows with data of one device name the tracks; one of another device has more modes, and is on no track."""
    estimates = [window(rare), *[window(often, 3)] * 3]
    seed, kept, tracks = choose_tracks(estimates)
    assert seed.channels == often
    assert [track.tolist() for track in tracks] == [[-1] * 3, *[[0, 1, 2]] * 3]
    assert len(kept) == 3
    assert fuse(estimates).n.tolist() == [3, 3, 3]


def test_windows_of_two_devices_by_halves_have_no_tracks() -> None:
    """Neither half is most of the windows: no mode can be compared."""
    _, kept, tracks = choose_tracks([window(A), window(A), window(B), window(B)])
    assert not len(kept)
    assert [len(track) for track in tracks] == [0] * 4


def test_windows_with_more_common_channels_have_the_tracks_of_the_window_with_the_most_modes() -> None:
    seed, kept, _ = choose_tracks([window(CHANNELS, 3), replace(window(A), start=1), window(CHANNELS, 3)])
    assert seed.start == 1
    assert kept.tolist() == [0, 1, 2]
