"""Modes as a universal file: datasets 151 and 55, and 15 and 82 with known positions.

References
----------
Structural Dynamics Research Corporation: universal file format, datasets 15 (nodes), 55 (data at nodes), 82 (trace
lines), 151 (header), kept by the University of Cincinnati, www.ceas3.uc.edu/sdrluff.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from daq import FloatArray
from oma.types import ComplexArray, ModalEstimate

_STRUCTURAL, _COMPLEX_MODE, _THREE_TRANSLATIONS, _DISPLACEMENT = 1, 3, 2, 8
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_NAMED = re.compile(r"(?P<stem>.*?)_?(?P<sign>[+-]?)(?P<axis>[xyz])", re.IGNORECASE)


@dataclass(frozen=True, eq=False, kw_only=True)
class Place:
    """Place and direction of a channel."""

    node: int  #: number, from 1 on
    direction: tuple[float, float, float]  #: unit vector


def places_by_name(channels: Sequence[str]) -> dict[str, Place]:
    """Read nodes and directions from names: ``12_x`` is node 12, ``top_-y`` the next free number.

    A name that ends in no axis is a node of its own that moves in x.
    """
    stems: dict[str, tuple[str, tuple[float, float, float]]] = {}
    for name in channels:
        match = _NAMED.fullmatch(name)
        if match is None:
            stems[name] = name, _AXES["x"]
        else:
            x, y, z = _AXES[match["axis"].lower()]
            sign = -1.0 if match["sign"] == "-" else 1.0
            stems[name] = match["stem"], (sign * x, sign * y, sign * z)
    number = {stem: int(stem) for stem, _ in stems.values() if stem.isdecimal() and int(stem) > 0}
    for stem, _ in stems.values():
        if stem not in number:
            number[stem] = max(number.values(), default=0) + 1
    return {name: Place(node=number[stem], direction=direction) for name, (stem, direction) in stems.items()}


def write_universal(
    path: Path | str,
    estimate: ModalEstimate,
    places: Mapping[str, Place] | None = None,
    nodes: Mapping[int, tuple[float, float, float]] | None = None,
    lines: Sequence[Sequence[int]] = (),
    modal_mass: FloatArray | None = None,
) -> None:
    """Write modes as complex eigenvalues and vectors at nodes.

    The channels of a node are combined to its motion in x, y and z, of the least length if there are fewer than three.

    Parameters
    ----------
    path : Path or str
        Path of the file; an existing file is replaced.
    estimate : ModalEstimate
    places : mapping, optional
        Channel -> place. Default: read from the names (`places_by_name`). Channels without one are left out.
    nodes : mapping, optional
        Node -> position [m]; with them the file can be animated.
    lines : sequence, optional
        Nodes to draw lines through.
    modal_mass : (n_modes,) array, optional
        Of the unit shapes [kg]; shapes with one that is positive are written mass-normalised.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    places = places or places_by_name(estimate.channels)
    path = Path(path)
    with path.open("wb"):  # pyuff would not state the reason
        pass
    import pyuff  # slow to import

    from daq.files import header_set  # as pyuff

    numbers, motion = node_motion(estimate.channels, estimate.shape, places)
    sets: list[dict[str, Any]] = [header_set("modes")]
    if nodes:
        x, y, z = np.array(list(nodes.values())).T.tolist()
        sets.append({"type": 15, "node_nums": list(nodes), "x": x, "y": y, "z": z})
    for k, line in enumerate(lines, 1):
        sets.append({"type": 82, "trace_num": k, "nodes": np.array(line), "id": f"line {k}", "color": 0})
    masses = [float("nan")] * estimate.n_modes if modal_mass is None else modal_mass.tolist()
    sets += [_mode(estimate, k, numbers, motion[k], mass) for k, mass in enumerate(masses)]
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


def node_motion(
    channels: Sequence[str], shape: ComplexArray | FloatArray, places: Mapping[str, Place]
) -> tuple[list[int], ComplexArray]:
    """Return the nodes with a channel, and their motion (n_modes, n_nodes, 3) [-].

    It is the shortest vector with the measured components: 0 in directions that are not measured.

    Parameters
    ----------
    channels : sequence
        Of the shapes; those without a place are left out.
    shape : (n_modes, n_channels) array
    places : mapping
        Channel -> place.
    """
    numbers = sorted({places[name].node for name in channels if name in places})
    motion = np.zeros((len(shape), len(numbers), 3), np.complex128)
    for i, number in enumerate(numbers):
        here = [k for k, name in enumerate(channels) if name in places and places[name].node == number]
        directions: FloatArray = np.array([places[channels[k]].direction for k in here])
        motion[:, i] = shape[:, here] @ np.linalg.pinv(directions).T
    return numbers, motion


def _mode(estimate: ModalEstimate, k: int, numbers: Sequence[int], motion: ComplexArray, mass: float) -> dict[str, Any]:
    """Return one mode: the eigenvalue has the frequency as its modulus and the damping as its slope.

    Modal A of a shape of unit modal mass is ``2 i omega_d``, modal B is ``-A`` times the eigenvalue.
    """
    frequency, damping = float(estimate.frequency[k]), float(estimate.damping[k])
    omega = 2 * np.pi * frequency
    pole = complex(-damping * omega, omega * np.sqrt(1 - damping**2))
    scaled: dict[str, Any] = {"id4": "modalwatch; unit norm over the channels, not mass-normalised"}
    if mass > 0:
        motion, modal_a = motion / np.sqrt(mass), 2j * pole.imag
        scaled = {
            "id4": f"modalwatch; mass-normalised, modal mass of unit norm {mass:.6g} kg",
            "modal_a": modal_a,
            "modal_b": -modal_a * pole,
        }
    return {
        "type": 55,
        "id1": f"mode {k + 1}: {frequency:.6g} Hz, {100 * damping:.4g} % of critical damping",
        "id2": f"standard deviations {estimate.frequency_std[k]:.2g} Hz, {100 * estimate.damping_std[k]:.2g} %",
        **scaled,
        "model_type": _STRUCTURAL,
        "analysis_type": _COMPLEX_MODE,
        "data_ch": _THREE_TRANSLATIONS,
        "spec_data_type": _DISPLACEMENT,
        "load_case": 1,
        "mode_n": k + 1,
        "eig": pole,
        "node_nums": list(numbers),
        **{f"r{axis + 1}": motion[:, axis] for axis in range(3)},
    }
