"""Windows of measured modes of frames of solids, errors of a file's modes, and diagnoses of a change."""

from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from daq import FloatArray
from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation, follow
from oma import WindowQuality
from oma.windows import Windows
from tests.support.portals.block_specimens import Specimen
from tests.support.updater.frames import noisy_estimates
from updater import Structure, build_model

SECONDS, START = 100.0, 1_767_225_600_000_000_000
FREQUENCY_STD, SHAPE_STD = 2e-3, 0.02  #: of a window: relative, and of unit norm


def measured_modes(
    specimen: Specimen,
    frequency: FloatArray,
    shape: FloatArray,
    random: np.random.Generator,
    *,
    first: int = 0,
    n: int = 5,
    better: float = 1.0,
) -> Observation:
    """Return windows of modes (n_modes,) [Hz] and (n_modes, n_channels).

    Parameters
    ----------
    first, n : number of the first window, and number of windows
    better : factor on the standard deviations of the errors
    """
    channels, std = specimen.file.channels, better * FREQUENCY_STD
    exact = noisy_estimates(frequency, shape, channels, n, random, std=std, shape_std=better * SHAPE_STD)
    starts = [START + round((first + k) * SECONDS * 1e9) for k in range(n)]
    estimates = tuple(
        replace(one, frequency_std=std * frequency, start=start, end=start + round(SECONDS * 1e9))
        for one, start in zip(exact, starts, strict=True)
    )
    windows = Windows(
        estimates=estimates,
        harmonics=np.empty(0),
        channels=dict.fromkeys(channels, "ok"),
        quality=(WindowQuality(complete=1.0, rms_variation=0.0, cycles=1000.0),) * n,
        problems=(),
        start=estimates[0].start,
        end=estimates[-1].end,
        rate=1000.0,
    )
    return follow(windows, dict.fromkeys(channels, "daq"), [(e.start, float("nan"), 0.01) for e in estimates])


def prediction_errors(structure: Structure, frequency: FloatArray, shape: FloatArray) -> FloatArray:
    """Return the errors (n_modes,) [%] of a structure's frequencies, paired by shape and frequency."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(40)
    own = (model.sensor_rows @ modes.shape).T
    size = np.linalg.norm(own, axis=1)
    seen = size > 1e-3 * size.max()
    mac = (shape @ (own[seen] / size[seen, None]).T) ** 2
    apart = np.log(modes.frequency[seen] / frequency[:, None])
    measured, paired = linear_sum_assignment(1 - mac + 2 * np.abs(apart))
    return np.asarray(100 * apart[measured, paired])


def change_is_found(specimen: Specimen, seed: int, effect: str, n_modes: int) -> bool:
    """Return whether a body, or a loosened foot, is named with its place and size, against reference logs.

    Parameters
    ----------
    seed : of the change and of the errors
    effect : body or foot
    n_modes : modes that are measured
    """
    random = np.random.default_rng((seed, 78))
    beam, steel = specimen.file.member_named("beam"), specimen.file.material["steel"]
    weight = sum(steel.density * specimen.file.section[m.section].area * m.length for m in specimen.file.member)
    x, y, z = beam.point(random.uniform(0.2, 0.9) * beam.length).round(4).tolist()
    mass, left, axis = weight * random.uniform(0.02, 0.05), random.uniform(0.3, 0.6), str(random.choice(["rx", "ry"]))
    changed = (
        specimen.modes(n_modes, body=((x, y, z), mass))
        if effect == "body"
        else specimen.modes(n_modes, loosened={axis: left})
    )
    before = measured_modes(specimen, *specimen.modes(n_modes), random, n=8, better=0.5)
    now = measured_modes(specimen, *changed, random, first=20, better=0.5)
    found = explain(specimen.file, before, now).diagnosis
    named = {cause.cause: cause for cause in found.causes}
    print(f"seed {seed}", effect, (x, y, z), mass, axis, left * specimen.foot, found.verdict, named)
    if effect == "body":
        body = named.get("added_mass")
        if body is None or body.where is None or body.where.position is None:
            return False
        size = body.parameters["mass"]
        near = np.linalg.norm(np.subtract(body.where.position, (x, y, z))) < 0.03
        return bool(near and abs(size.value - mass) < 3 * size.std)
    foot = named["support_stiffness"].parameters.get(f"stiffness_{axis}") if "support_stiffness" in named else None
    true = left * specimen.foot[("rx", "ry", "rz").index(axis)]
    return foot is not None and bool(abs(foot.value - true) < 3 * foot.std)
