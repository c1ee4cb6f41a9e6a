"""Dependence of modes on their amplitude: false findings on linear buildings, and elements that are found.

    python benchmarks/oma/amplitude.py [--records 100] [--seed 5000]

Records of 900 s of a building of four storeys (tests/support/oma/nonlinear_building.py), identified by `identify`.
"""

import argparse
import time
from collections.abc import Iterator

import numpy as np

from oma import AmplitudeDependence, dependence_on_amplitude, identify
from tests.support.oma.nonlinear_building import (
    Building,
    Element,
    Modulation,
    blows,
    gusts,
    steady,
    traffic,
    vibrations,
)

SECONDS, PART = 900.0, 25
FORCES: tuple[Modulation, ...] = (steady, gusts, traffic, blows)
NOISES = (0.01, 0.2)
ELEMENTS = {
    "spring that stiffens with the cube": Element("stiffening", 0.02),
    "contact at the standard deviation": Element("contact", 0.2),
    "spring that slips": Element("slip", 0.3, 0.7),
    "spring that slips early": Element("slip", 0.3, 0.3),
    "quadratic drag": Element("drag", 0.0003),
}
HOUR = 4  # records
LEVEL = 0.001


def dependences(
    element: Element, seeds: range, modulation: Modulation, noise: float
) -> Iterator[list[AmplitudeDependence | None]]:
    """Yield the dependence of each mode of the linear building, None if it was not identified or not tested."""
    frequencies = Building(element).frequency
    for first in range(seeds.start, seeds.stop, PART):
        part = range(first, min(first + PART, seeds.stop))
        for recording in vibrations(element, SECONDS, part, modulation=modulation, noise=noise):
            estimate = identify(recording)
            nearest = [int(np.argmin(np.abs(estimate.frequency / frequency - 1))) for frequency in frequencies]
            tested = dependence_on_amplitude(recording, estimate)
            near = np.abs(estimate.frequency[nearest] / frequencies - 1) < 0.1
            yield [tested[k] if is_near else None for k, is_near in zip(nearest, near, strict=True)]


def share_below(level: float, values: list[float]) -> str:
    """Return the share of p values below a level in per cent."""
    return f"{100 * float(np.mean(np.array(values) < level)):.1f}" if values else "-"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=100)
    parser.add_argument("--seed", type=int, default=5000)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.records)
    print(f"seeds {seeds.start} to {seeds.stop - 1}\n")
    print("| forces | noise [%] | modes tested | p < 0.05: frequency | damping | p < 0.001: frequency | damping |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for modulation in FORCES:
        for noise in NOISES:
            every = [one for modes in dependences(Element("linear", 0), seeds, modulation, noise) for one in modes]
            tested = [one for one in every if one]
            values = [[one.frequency.p_value for one in tested], [one.damping.p_value for one in tested]]
            shares = [share_below(level, of_one) for level in (0.05, LEVEL) for of_one in values]
            cells = [modulation.__name__, f"{100 * noise:g}", f"{len(tested)} of {len(every)}", *shares]
            print(f"| {' | '.join(cells)} |", flush=True)
    print(
        "\n| element | mode | frequency per rms [%] | damping per rms [%] | found in an hour [%]: frequency | damping |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    begun = time.process_time()
    for name, element in ELEMENTS.items():
        records = list(dependences(element, seeds, steady, 0.02))
        for mode in (0, 1):
            of_mode = [modes[mode] for modes in records]
            whole = AmplitudeDependence.pooled([one for one in of_mode if one])
            parts = [of_mode[first : first + HOUR] for first in range(0, len(of_mode), HOUR)]
            hours = [AmplitudeDependence.pooled([one for one in part if one]) for part in parts if any(part)]
            cells = [
                name,
                str(mode + 1),
                f"{100 * whole.frequency.value:+.2f} ± {100 * whole.frequency.std:.2f}",
                f"{100 * whole.damping.value:+.2f} ± {100 * whole.damping.std:.2f}",
                share_below(LEVEL, [one.frequency.p_value for one in hours]),
                share_below(LEVEL, [one.damping.p_value for one in hours]),
            ]
            print(f"| {' | '.join(cells)} |", flush=True)
    print(f"\nelements: {time.process_time() - begun:.0f} s of a processor")


if __name__ == "__main__":
    main()
