"""Structure file and matrices made of the files of another finite element program."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from daq import FloatArray
from daq.errors import writing
from monitor.cli.options import DONE
from monitor.cli.output import check_outputs, replacing, write_new
from monitor.cli.terminal import echo, progress
from monitor.errors import ArgumentError
from updater import Matrices, ProgramFiles, parse_structure, read_program_files, save_matrices

_MAX_LINES = 12
_SAME = 1e-6  # of the largest extent: nodes on one line


def write_external(
    path: Path, given: ProgramFiles, *, groups: Sequence[str], doubled: Sequence[str], force: bool
) -> int:
    """Write a structure file and its matrices.

    Raises
    ------
    ArgumentError
        If a group is not NAME=FILE or named twice, the structure file has the ending of matrices, or a file exists.
    StructureError
        If a file of the program cannot be read; names the file and the node or row.
    """
    npz = path.with_suffix(".npz")
    if npz == path:
        raise ArgumentError("--out", f"expected the structure file, such as {path.with_suffix('.toml')}, found {path}")
    own, twice = _named("--group", groups), _named("--doubled", doubled)
    repeated = sorted(own.keys() & twice.keys())
    if repeated:
        raise ArgumentError("--doubled", f"the group {repeated[0]!r} is given by --group too")
    with progress("reading"):
        matrices = read_program_files(replace(given, groups=own, doubled=twice))
        text = "\n".join(_lines(npz, given, matrices))
        loaded = parse_structure(text, path)
    check_outputs({"--out": npz}, force=force)
    write_new(path, text, force=force)
    with writing(npz, ArgumentError.of_file("--out")), replacing(npz, force=force):
        save_matrices(npz, matrices)
    echo(
        f"written: {path} and {npz}: {matrices.stiffness.shape[0]} degrees of freedom, {len(matrices.nodes)} nodes, "
        f"{len(matrices.faces)} faces, {len(matrices.groups)} groups, {len(loaded.member)} members"
    )
    echo(f"next: edit members and sensors, then draw and check it: modalwatch structure {path}")
    return DONE


def _named(option: str, given: Sequence[str]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for text in given:
        name, equals, file = text.partition("=")
        if not (name and equals and file):
            raise ArgumentError(option, f"expected NAME=FILE, found {text!r}")
        if name in found:
            raise ArgumentError(option, f"the group {name!r} is given twice")
        found[name] = Path(file)
    return found


def _lines(npz: Path, given: ProgramFiles, matrices: Matrices) -> Iterator[str]:
    yield f"name = {json.dumps(given.stiffness.stem)}\n"
    yield "[external]"
    yield f"matrices = {json.dumps(npz.name)}          # stiffness, mass, nodes and faces, in m, N and kg\n"
    for name in matrices.groups:
        yield f"[external.group.{json.dumps(name)}]   # its stiffness may change: cause local_stiffness"
        yield "uncertainty = 0.03             # of its stiffness before the calibration; a foot or joint: 0.3 or more\n"
    yield "# Lines along which masses are sought: between two nodes, or between any points on faces."
    for number, (start, end) in enumerate(_straight_lines(matrices), start=1):
        yield f'[[member]]\nname = "line {number}"\nfrom = {_place(start)}\nto = {_place(end)}\n'
    yield "# Supports of the other program are in its matrices. Further ones: [[support]] with at, fixed, stiffness.\n"
    yield "# One entry per measured direction, at a node, on a member or on a face:"
    yield '# [[sensor]]\n# channel = "a_z"\n# at = [0, 0, 0]\n# direction = [0, 0, 1]'


def _place(point: FloatArray) -> list[float]:
    return [float(f"{x:.9g}") + 0.0 for x in point]


def _straight_lines(matrices: Matrices) -> list[tuple[FloatArray, FloatArray]]:
    """Return the ends of the longest lines of nodes parallel to an axis; if there is none, the nodes farthest apart."""
    nodes = matrices.nodes
    size = float(np.ptp(nodes, axis=0).max())
    found = []
    for axis in range(3):
        across = np.round(np.delete(nodes, axis, axis=1) / (_SAME * size + np.finfo(float).tiny))
        _, line = np.unique(across, axis=0, return_inverse=True)
        order = np.lexsort((nodes[:, axis], line))
        begins = np.flatnonzero(np.diff(line[order], prepend=-1))
        ends = np.append(begins[1:], len(order)) - 1
        long = ends - begins > 1
        found += list(zip(nodes[order[begins[long]]], nodes[order[ends[long]]], strict=True))
    if not found:
        centre = np.linalg.norm(nodes - nodes.mean(0), axis=1)
        first = nodes[int(np.argmax(centre))]
        return [(first, nodes[int(np.argmax(np.linalg.norm(nodes - first, axis=1)))])]
    lengths = np.array([np.linalg.norm(end - start) for start, end in found])
    longest = np.argsort(-lengths, kind="stable")
    longest = longest[lengths[longest] > lengths.max() / 2]
    chosen = np.unique(np.linspace(0, len(longest) - 1, _MAX_LINES).round().astype(int))
    return [found[i] for i in longest[chosen].tolist()]
