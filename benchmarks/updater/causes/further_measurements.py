"""Further measurements of a changed frame, and what they decide (`make bench-further-measurements`)."""

import argparse
from collections.abc import Callable

import numpy as np

from tests.support.updater.diagnosis_data import COLUMN, HALF, TOP, Change, MeasuredAgain
from updater import Body, Cause, DiagnosisResult
from updater.diagnosis import Separation

_MASS = 0.15  # kg, 2 % of the frame
_FACTORS = ("global_stiffness", "global_density")

#: verdict of a draw, such as "right", and the p values of records with a known mass
_Drawn = tuple[str, tuple[float, ...]]


def _body(random: np.random.Generator) -> Body:
    at = float(random.choice([-1, 1]) * random.uniform(0.1, 0.38))
    return Body(at=(at, 0.0, TOP), mass=float(random.uniform(0.1, 0.4)))


def _anywhere(random: np.random.Generator) -> tuple[float, float, float]:
    return float(random.uniform(-HALF, HALF)), 0.0, TOP


def _advised(found: DiagnosisResult, kind: str) -> list[tuple[tuple[float, float, float], str, float]]:
    """Return place, axis and mass of the advised measurement; empty if another kind is advised."""
    advice = found.next_measurement
    measurements = advice.measurements if isinstance(advice, Separation) else ()
    return [(m.position, m.axis, m.mass) for m in measurements if m.kind == kind and m.position][:1]


def _side(found: DiagnosisResult, body: Body) -> _Drawn:
    """Return whether all places that are named are on the side of the body."""
    places = [c.where.position for c in found.diagnosis.causes if c.where and c.where.position]
    sides = {bool(np.sign(place[0]) == np.sign(body.at[0])) for place in places}
    verdict = "right" if sides == {True} else "wrong" if sides == {False} else "open"
    return verdict, _p_values(found)


def _p_values(found: DiagnosisResult) -> tuple[float, ...]:
    return tuple(test.p_value for test in found.diagnosis.mass_tests)


def _named(cause: Cause) -> set[str]:
    return {cause.cause, *cause.cannot_be_told_from}


def _sensor(seed: int) -> _Drawn:
    body = _body(np.random.default_rng((seed, 0)))
    site = MeasuredAgain(seed, Change((body,)), COLUMN)
    where = _advised(site.answer(), "sensor")
    return _side(site.with_sensor(*where[0][:2]), body) if where else ("not advised", ())


def _mass(seed: int) -> _Drawn:
    random = np.random.default_rng((seed, 0))
    body = _body(random)
    return _side(MeasuredAgain(seed, Change((body,)), COLUMN).with_mass(_anywhere(random), _MASS), body)


def _factor(seed: int) -> _Drawn:
    random = np.random.default_rng((seed, 0))
    kind, value = int(random.integers(2)), float(1 + random.choice([-1, 1]) * random.uniform(0.02, 0.06))
    site = MeasuredAgain(seed, Change(density=value) if kind else Change(stiffness=value))
    where = _advised(site.answer(), "known_mass")
    if not where:
        return "not advised", ()
    at, _, mass = where[0]
    found = site.with_mass(at, mass)
    names = set().union(*(_named(cause) for cause in found.diagnosis.causes)) & set(_FACTORS)
    truth = {_FACTORS[kind]}
    return "right" if names == truth else "open" if truth <= names else "wrong", _p_values(found)


def _nothing(found: DiagnosisResult) -> _Drawn:
    return "right" if found.diagnosis.verdict == "nothing_to_explain" else "wrong", _p_values(found)


def _no_change_sensor(seed: int) -> _Drawn:
    random = np.random.default_rng((seed, 0))
    return _nothing(MeasuredAgain(seed, Change(), COLUMN).with_sensor(_anywhere(random), "yz"[random.integers(2)]))


def _no_change_mass(seed: int) -> _Drawn:
    return _nothing(MeasuredAgain(seed, Change()).with_mass(_anywhere(np.random.default_rng((seed, 0))), _MASS))


_KINDS: dict[str, Callable[[int], _Drawn]] = {
    "body left or right | sensor where it is advised": _sensor,
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
    options = parser.parse_args()
    print("| truth | measurement | draws | right | still open | wrong | p below 0.1 |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for kind, draw in _KINDS.items():
        found = [draw(seed) for seed in range(options.seed, options.seed + options.draws)]
        verdicts = [verdict for verdict, _ in found if verdict != "not advised"]
        counts = " | ".join(str(verdicts.count(verdict)) for verdict in ("right", "open", "wrong"))
        p_values = [p for _, values in found for p in values]
        low = f"{sum(p < 0.1 for p in p_values)} of {len(p_values)}" if p_values else ""
        print(f"| {kind} | {len(verdicts)} | {counts} | {low} |", flush=True)


if __name__ == "__main__":
    main()
