"""Further measurements of a changed frame, and what they decide (`make bench-further-measurements`)."""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.stats import norm

from tests.support.updater.diagnosis_data import COLUMN, HALF, TOP, Change, MeasuredAgain
from updater import Body, Cause, DiagnosisResult
from updater.diagnosis import Measurement, Separation

_MASS = 0.15  # kg, 2 % of the frame
_FACTORS = ("global_stiffness", "global_density")

_ODDS = np.log(4)  # of a cause that is named: 80 %


@dataclass(frozen=True)
class _Drawn:
    verdict: str
    p_values: tuple[float, ...] = ()  #: of records with a known mass
    expected: float = float("nan")  #: probability of a decision, by the distance that the advice states
    open: tuple[float, float, float] | None = None  #: causes left open before, as expected, and with the measurement


def _body(random: np.random.Generator) -> Body:
    at = float(random.choice([-1, 1]) * random.uniform(0.1, 0.38))
    return Body(at=(at, 0.0, TOP), mass=float(random.uniform(0.1, 0.4)))


def _anywhere(random: np.random.Generator) -> tuple[float, float, float]:
    return float(random.uniform(-HALF, HALF)), 0.0, TOP


def _decided(advice: Measurement) -> float:
    """Return how probable a decision between two equally probable causes is: log odds of d^2/2 with deviation d."""
    return float(norm.cdf(advice.deviations / 2 - _ODDS / advice.deviations))


def _followed(site: MeasuredAgain, kind: str, verdict: Callable[[DiagnosisResult], str]) -> _Drawn:
    """Return a draw in which the advice of a kind is followed, if there is any."""
    first = site.answer().next_measurement
    advice = next((m for m in first.measurements if m.kind == kind), None) if isinstance(first, Separation) else None
    if not isinstance(first, Separation) or advice is None or advice.position is None:
        return _Drawn("not advised")
    at = advice.position
    found = site.with_sensor(at, advice.axis) if kind == "sensor" else site.with_mass(at, advice.mass)
    now = found.next_measurement.open if isinstance(found.next_measurement, Separation) else 1.0
    return _Drawn(verdict(found), _p_values(found), _decided(advice), (first.open, advice.leaves, now))


def _side(found: DiagnosisResult, body: Body) -> str:
    """Return whether all places that are named are on the side of the body."""
    places = [c.where.position for c in found.diagnosis.causes if c.where and c.where.position]
    sides = {bool(np.sign(place[0]) == np.sign(body.at[0])) for place in places}
    return "right" if sides == {True} else "wrong" if sides == {False} else "open"


def _p_values(found: DiagnosisResult) -> tuple[float, ...]:
    return tuple(test.p_value for test in found.diagnosis.mass_tests)


def _named(cause: Cause) -> set[str]:
    return {cause.cause, *cause.cannot_be_told_from}


def _advised(kind: str, seed: int) -> _Drawn:
    """Return a draw of a body whose mirror image is as probable, with the advised measurement of a kind."""
    body = _body(np.random.default_rng((seed, 0)))
    return _followed(MeasuredAgain(seed, Change((body,)), COLUMN), kind, lambda found: _side(found, body))


def _mass(seed: int) -> _Drawn:
    random = np.random.default_rng((seed, 0))
    body = _body(random)
    found = MeasuredAgain(seed, Change((body,)), COLUMN).with_mass(_anywhere(random), _MASS)
    return _Drawn(_side(found, body), _p_values(found))


def _factor(seed: int) -> _Drawn:
    random = np.random.default_rng((seed, 0))
    kind, value = int(random.integers(2)), float(1 + random.choice([-1, 1]) * random.uniform(0.02, 0.06))
    site = MeasuredAgain(seed, Change(density=value) if kind else Change(stiffness=value))
    truth = {_FACTORS[kind]}

    def verdict(found: DiagnosisResult) -> str:
        names = set().union(*(_named(cause) for cause in found.diagnosis.causes)) & set(_FACTORS)
        return "right" if names == truth else "open" if truth <= names else "wrong"

    return _followed(site, "known_mass", verdict)


def _nothing(found: DiagnosisResult) -> _Drawn:
    return _Drawn("right" if found.diagnosis.verdict == "nothing_to_explain" else "wrong", _p_values(found))


def _no_change_sensor(seed: int) -> _Drawn:
    random = np.random.default_rng((seed, 0))
    return _nothing(MeasuredAgain(seed, Change(), COLUMN).with_sensor(_anywhere(random), "yz"[random.integers(2)]))


def _no_change_mass(seed: int) -> _Drawn:
    return _nothing(MeasuredAgain(seed, Change()).with_mass(_anywhere(np.random.default_rng((seed, 0))), _MASS))


_KINDS: dict[str, Callable[[int], _Drawn]] = {
    "body left or right | sensor where it is advised": partial(_advised, "sensor"),
    "body left or right | known mass where it is advised": partial(_advised, "known_mass"),
    "body left or right | known mass anywhere on the crossbeam": _mass,
    "stiffness or density | known mass where it is advised": _factor,
    "no change | further sensor anywhere on the crossbeam": _no_change_sensor,
    "no change | known mass anywhere on the crossbeam": _no_change_mass,
}


def main() -> None:
    """Print the table of docs/validation/diagnosis/further_measurements.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="part of the names of the kinds that are drawn")
    options = parser.parse_args()
    print("| truth | measurement | draws | right | still open | wrong | expected right | causes open | p below 0.1 |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for kind, draw in _KINDS.items():
        if options.only in kind:
            drawn = [draw(seed) for seed in range(options.seed, options.seed + options.draws)]
            print(f"| {kind} | {_row([one for one in drawn if one.verdict != 'not advised'])} |", flush=True)


def _row(drawn: list[_Drawn]) -> str:
    """Return the cells of one kind; numbers of open causes are geometric means."""
    counts = [str(sum(one.verdict == verdict for one in drawn)) for verdict in ("right", "open", "wrong")]
    expected = sum(one.expected for one in drawn)
    left = [one.open for one in drawn if one.open]
    mean = ", ".join(f"{number:.2f}" for number in np.exp(np.log(left).mean(0))) if left else ""
    p_values = [p for one in drawn for p in one.p_values]
    low = f"{sum(p < 0.1 for p in p_values)} of {len(p_values)}" if p_values else ""
    return " | ".join([str(len(drawn)), *counts, "" if np.isnan(expected) else f"{expected:.1f}", mean, low])


if __name__ == "__main__":
    main()
