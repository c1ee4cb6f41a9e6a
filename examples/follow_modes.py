"""A mast through a warm day: two bending modes cross, one is seldom excited, some windows are lost.

Its three masses sway in x and in y, two bending modes each way. The sun softens the x direction by 3 % from morning to
evening, so that its frequencies fall through those of the y direction. Wind in y blows now and then only: the second
mode that way is excited in one window of four. Each window is identified by itself and its modes are followed.
"""

from collections import Counter

import numpy as np
from scipy.signal import cont2discrete, lfilter

from daq import Channel, Recording
from oma import LongTermTracker, Tracks, identify

n_windows, window, rate, damping = 48, 300.0, 20.0, 0.01  # 48 windows, one each quarter of an hour [s, Hz]
shapes = np.array([[0.3, 0.7, 1.0], [0.9, 0.6, -0.6]])  # of either direction
channels = tuple(Channel(name=f"mass_{i}_{axis}", device="mast", axis=0) for axis in "xy" for i in (1, 2, 3))
directions = {"x, first": (0, 0), "x, second": (0, 1), "y, first": (1, 0), "y, second": (1, 1)}
rng = np.random.default_rng(3)

tracks: Tracks | None = None
labels: list[tuple[str, int]] = []
mixed = 0
for k in range(n_windows):
    if 20 <= k < 24:  # lost
        continue
    warmth = k / n_windows
    exact = {"x, first": 1.015 - 0.03 * warmth, "x, second": 6.09 - 0.18 * warmth, "y, first": 1.0, "y, second": 6.0}
    n = round(window * rate)
    acceleration = 0.02 * rng.standard_normal((n, 6))
    for mode, (direction, which) in directions.items():
        if mode == "y, second" and k % 4:
            continue
        omega = 2 * np.pi * exact[mode]
        system = (np.array([1.0, 0.0, 0.0]), np.array([1.0, 2 * damping * omega, omega**2]))
        numerator, denominator, _ = cont2discrete(system, 1 / rate, method="zoh")
        shape = np.zeros(6)
        shape[3 * direction : 3 * direction + 3] = shapes[which]
        acceleration += np.outer(lfilter(numerator.ravel(), denominator, rng.standard_normal(n)), shape)
    recording = Recording(channels=channels, data=acceleration, rate=rate, start=round(k * 900e9))

    estimate = identify(recording)
    followed = LongTermTracker().follow(tracks, estimate)
    tracks = followed.tracks  # tracks.to_json() is what a restart needs
    for shape, identity, doubt in zip(estimate.shape.real, followed.identity.tolist(), followed.doubtful, strict=True):
        # which mode it is, its shape says, unless the window shows both first ones as mixtures of each other
        share_in_y = np.sum(shape[3:] ** 2) / np.sum(shape**2)
        if doubt or 0.25 < share_in_y < 0.75:
            mixed += 1
            continue
        way = int(share_in_y > 0.5)
        part = shape[3 * way : 3 * way + 3]
        which = int(np.argmax(np.abs(shapes @ part) / np.linalg.norm(shapes, axis=1)))
        labels.append((next(m for m, place in directions.items() if place == (way, which)), identity))

counts = Counter(labels)
for mode in directions:
    seen = {identity: n for (m, identity), n in counts.items() if m == mode}
    print(f"{mode}: seen in {sum(seen.values())} windows, identities {seen}")
print(f"{mixed} shapes were mixtures of the two that cross, or could have been exchanged")
