"""Estimated motion and stress where there is no sensor, against independent specimens (`make bench-response`)."""

import argparse
import time
from collections.abc import Sequence

import numpy as np
from scipy.signal import butter, sosfiltfilt

from daq import FloatArray, Recording
from tests.support.updater.unmeasured_points import UnmeasuredPoints, unmeasured_points
from updater.validation import Fibre, ResponseModel, learn_predictors

_SPECIMENS = ("frame", "portal", "bridge", "mast")
_LEARN, _ESTIMATE = 60.0, 30.0  # s at 1 kHz, or as many samples


Errors = tuple[FloatArray, FloatArray]  # error over deviation (n, n_places), relative rms errors (n_places,)


def _compared(found: FloatArray, exact: FloatArray, std: FloatArray) -> Errors:
    """Return the errors of estimates (n_samples, n_places) where they and the truth have settled."""
    settled = np.isfinite(found).all(1) & np.isfinite(exact).all(1)
    error = (found - exact)[settled]
    return error / std, error.std(0) / exact[settled].std(0)


def _errors(case: UnmeasuredPoints, model: ResponseModel, recording: Recording, truth: FloatArray) -> Errors:
    """Return the errors at places without a sensor."""
    found = model.estimate(recording, case.points)
    sections = butter(4, found.band, "bandpass", fs=recording.rate, output="sos")
    return _compared(found.recording.data, sosfiltfilt(sections, truth, axis=0), found.std)


def _cost(case: UnmeasuredPoints, model: ResponseModel, recording: Recording) -> float:
    """Return the CPU time of the filter per recorded time [-]."""
    kalman = model.filter(case.points)
    data = recording.data[: int(recording.rate)]
    begin = time.process_time()
    for _ in range(5):
        kalman.run(data)
    return (time.process_time() - begin) / 5 * 1000 / len(data)  # of 1000 samples, on the scale of 1 kHz


def _print_row(title: str, errors: Sequence[Errors], cost: str) -> None:
    ratio = np.abs(np.concatenate([own.ravel() for own, _ in errors]))
    relative = np.concatenate([own for _, own in errors])
    shares = " | ".join(f"{100 * np.mean(ratio < k):.0f} %" for k in (1, 2))
    quantiles = " | ".join(f"{100 * np.quantile(relative, q):.1f} %" for q in (0.5, 0.95))
    print(f"| {title} | {len(relative)} | {shares} | {quantiles} | {cost} |", flush=True)


def main() -> None:
    """Print the table of docs/validation/model/response.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    n = parser.parse_args().seeds
    print(f"seeds 0 to {n - 1}\n")
    print("| specimen | signal | places | within 1 | within 2 deviations | error: median | 95 % of places | cost |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for which in _SPECIMENS:
        points: list[Errors] = []
        without: list[Errors] = []
        sensors: list[Errors] = []
        costs = []
        for seed in range(n):
            case = unmeasured_points(which, seed)
            sample = case.record(_LEARN, seed)[0]
            recording, truth = case.record(_ESTIMATE, seed + 1000)
            model = ResponseModel.learn(case.reference, sample)
            points.append(_errors(case, model, recording, truth))
            costs.append(_cost(case, model, recording))
            for predictor in learn_predictors(case.reference, sample):
                found = predictor.predict(recording)
                sensors.append(_compared(found.predicted, found.measured.data, found.std))
                without.append(_errors(case, predictor.model, recording, truth))
        strained = np.array([isinstance(point, Fibre) for point in case.points])
        cost = f"{100 * np.median(costs):.2f} %"
        for signal, own in (("acceleration", ~strained), ("stress", strained)):
            for state, errors in ((signal, points), (f"{signal}, one place fewer", without)):
                kept = [(ratio[:, own], relative[own]) for ratio, relative in errors]
                _print_row(f"{which} | {state}", kept, cost if errors is points else "")
        _print_row(f"{which} | sensor, from the other places", sensors, "")


if __name__ == "__main__":
    main()
