"""Four sensors, eight floors: set-ups measured one after the other, merged through two sensors that stay.

The floors are equal masses on equal springs, whose frequencies and shapes are known in closed form (Blevins 1979,
table 6-2). The wind blows differently in each set-up, so that each sees the modes at another scale.
"""

import numpy as np
from scipy.signal import cont2discrete, lfilter

from daq import Channel, Recording
from oma import identify, mac_matrix, merge

n_floors, rate, seconds, damping = 8, 40.0, 400.0, 0.008
angle = (2 * np.arange(1, n_floors + 1) - 1) * np.pi / (2 * n_floors + 1)
exact = np.sin(angle / 2) / np.sin(angle[0] / 2)  # Hz
shapes = np.sin(angle[:, None] * np.arange(1, n_floors + 1))

setups = ((8, 3, 1, 2), (8, 3, 4, 5), (8, 3, 6, 7))  # floors with a sensor; 8 and 3 keep theirs
rng = np.random.default_rng(1)
estimates = []
for floors in setups:
    n = round(seconds * rate)
    wind = rng.uniform(0.5, 2.0) * rng.standard_normal((n, n_floors))
    acceleration = np.zeros((n, n_floors))
    for frequency, shape in zip(exact, shapes, strict=True):
        omega = 2 * np.pi * frequency
        mode = (np.array([1.0, 0.0, 0.0]), np.array([1.0, 2 * damping * omega, omega**2]))
        numerator, denominator, _ = cont2discrete(mode, 1 / rate, method="zoh")
        acceleration += np.outer(lfilter(numerator.ravel(), denominator, wind @ shape), shape)
    acceleration += 0.05 * acceleration.std() * rng.standard_normal(acceleration.shape)
    channels = tuple(Channel(name=f"floor_{floor}", device="sensors", axis=i) for i, floor in enumerate(floors))
    measured = acceleration[:, [floor - 1 for floor in floors]]
    estimates.append(identify(Recording(channels=channels, data=measured, rate=rate, start=0)))

merged = merge(estimates, references=("floor_8", "floor_3"))
place = [int(name.removeprefix("floor_")) - 1 for name in merged.channels]
likeness = mac_matrix(merged.shape, shapes[:, place]).diagonal()
for i in range(merged.n_modes):
    print(
        f"mode {i + 1}: {merged.frequency[i]:.4f} ± {merged.frequency_std[i]:.4f} Hz (exactly {exact[i]:.4f}), "
        f"shape at {len(merged.channels)} floors ± {merged.shape_std[i].mean():.3f}, MAC {likeness[i]:.4f}"
    )
