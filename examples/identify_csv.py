"""From a table of accelerations to modes with standard deviations.

Three masses of 1 kg on springs of 400 N/m, one after the other from a wall, shaken at random: their frequencies are
known in closed form (Blevins 1979, table 6-2), 20 / pi * sin((2 i - 1) pi / 14) Hz.
"""

import tempfile
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter

from daq import load_recordings, read_data, write_recording
from oma import identify, mac_matrix

rate, n, damping = 50.0, 30_000, 0.01  # Hz, samples, share of critical
stiffness = 400.0 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
eigenvalues, shapes = np.linalg.eigh(stiffness)
exact = np.sqrt(eigenvalues) / (2 * np.pi)

# what three accelerometers on the masses would measure: the sum of the modes' answers to white forces, and their noise
rng = np.random.default_rng(1)
forces = rng.standard_normal((n, 3))
acceleration = 0.01 * rng.standard_normal((n, 3))
for frequency, shape in zip(exact, shapes.T, strict=True):
    omega = 2 * np.pi * frequency
    mode = (np.array([1.0, 0.0, 0.0]), np.array([1.0, 2 * damping * omega, omega**2]))
    numerator, denominator, _ = cont2discrete(mode, 1 / rate, method="zoh")
    acceleration += np.outer(lfilter(numerator.ravel(), denominator, forces @ shape), shape)

with tempfile.TemporaryDirectory() as folder:
    table, log = Path(folder) / "measured.csv", Path(folder) / "measured.mcap"
    rows = np.column_stack([np.arange(n) / rate, acceleration])
    np.savetxt(table, rows, delimiter=",", header="t,near,middle,far", comments="", fmt="%.6g")

    write_recording(log, read_data(table))  # modalwatch import measured.csv -o measured.mcap
    (recording,) = load_recordings(log)

estimate = identify(recording)  # modalwatch identify measured.mcap
likeness = mac_matrix(estimate.shape, shapes.T).diagonal()
for i in range(estimate.n_modes):
    print(
        f"mode {i + 1}: {estimate.frequency[i]:.4f} ± {estimate.frequency_std[i]:.4f} Hz (exactly {exact[i]:.4f}), "
        f"damping {100 * estimate.damping[i]:.2f} ± {100 * estimate.damping_std[i]:.2f} %, MAC {likeness[i]:.4f}"
    )
