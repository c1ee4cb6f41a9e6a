"""Estimated motion and stress where there is no sensor, against independent specimens (`make bench-response`)."""

import argparse
import time

import numpy as np
from scipy.signal import butter, sosfiltfilt

from daq import FloatArray
from tests.support.updater.unmeasured_points import UnmeasuredPoints, unmeasured_points
from updater.validation import Fibre, ResponseModel

_SPECIMENS = ("frame", "portal", "bridge", "mast")
_LEARN, _ESTIMATE = 60.0, 30.0  # s at 1 kHz, or as many samples


def _errors(case: UnmeasuredPoints, seed: int) -> tuple[FloatArray, FloatArray, float]:
    """Return error over deviation (n, n_places), relative rms errors (n_places,), CPU time per recorded time."""
    model = ResponseModel.learn(case.reference, case.record(_LEARN, seed)[0])
    recording, truth = case.record(_ESTIMATE, seed + 1000)
    found = model.estimate(recording, case.points)
    settled = np.isfinite(found.recording.data[:, 0])
    sections = butter(4, found.band, "bandpass", fs=recording.rate, output="sos")
    exact = sosfiltfilt(sections, truth, axis=0)[settled]
    error = found.recording.data[settled] - exact
    kalman = model.filter(case.points)
    data = recording.data[: int(recording.rate)]
    begin = time.process_time()
    for _ in range(5):
        kalman.run(data)
    cost = (time.process_time() - begin) / 5  # of 1000 samples, on the scale of a record at 1 kHz
    return error / found.std, error.std(0) / exact.std(0), cost * 1000 / len(data)


def main() -> None:
    """Print the table of docs/validation/model/response.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    n = parser.parse_args().seeds
    print(f"seeds 0 to {n - 1}\n")
    print("| specimen | signal | places | within 1 | within 2 deviations | error: median | 95 % of places | cost |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for which in _SPECIMENS:
        cases = [unmeasured_points(which, seed) for seed in range(n)]
        found = [_errors(case, seed) for seed, case in enumerate(cases)]
        cost = np.median([c for _, _, c in found])
        strained = np.array([isinstance(point, Fibre) for point in cases[0].points])
        for signal, own in (("acceleration", ~strained), ("stress", strained)):
            ratio = np.concatenate([np.abs(r[:, own]).ravel() for r, _, _ in found])
            relative = np.concatenate([e[own] for _, e, _ in found])
            shares = " | ".join(f"{100 * np.mean(ratio < k):.0f} %" for k in (1, 2))
            errors = " | ".join(f"{100 * np.quantile(relative, q):.1f} %" for q in (0.5, 0.95))
            print(f"| {which} | {signal} | {len(relative)} | {shares} | {errors} | {100 * cost:.2f} % |", flush=True)


if __name__ == "__main__":
    main()
