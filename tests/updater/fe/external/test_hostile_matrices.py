"""Matrices of other programs whose indices or sizes exceed them: one error instead of a crash."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.updater.reference_frame import t_frame
from updater import Matrices, StructureError, build_model, read_matrices, save_matrices


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    model = build_model(t_frame(), shear_flexible=True, mass="consistent")
    path = tmp_path / "m.npz"
    save_matrices(path, Matrices(stiffness=model.stiffness, mass=model.mass, nodes=model.nodes, dofs=model.dofs))
    read_matrices(path, path, path)
    return path


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("stiffness_indices", 2**30),
        ("stiffness_indices", -1),
        ("mass_indptr", 2**30),
        ("mass_indptr", -1),
        ("dofs", 2**30),
        ("dofs", 0),
        ("nodes", np.nan),
    ],
)
def test_matrices_with_invalid_indices_or_coordinates_are_refused(sound: Path, name: str, value: float) -> None:
    with np.load(sound) as found:
        arrays = dict(found)
    arrays[name] = np.full_like(arrays[name], value)
    np.savez(sound.with_name("wrong.npz"), **arrays)
    wrong = sound.with_name("wrong.npz")
    with pytest.raises(StructureError, match=r"wrong\.npz: "):
        read_matrices(wrong, wrong, wrong)


@pytest.mark.parametrize(
    "body", ["999999999999 3 2\n1 1 2.0", "3 3 999999999999\n", "3 3 2\n1 1 2. 0\n2 2 1.0", "3 3 1\n9 9 1.0", ""]
)
def test_matrix_files_with_wrong_stated_sizes_are_refused(sound: Path, body: str) -> None:
    wrong = sound.with_name("wrong.mtx")
    wrong.write_text(f"%%MatrixMarket matrix coordinate real symmetric\n%\n{body}\n")
    with pytest.raises(StructureError, match="stiffness: no matrix can be read"):
        read_matrices(wrong, sound, sound)


@pytest.mark.parametrize(("field", "value"), [(4, 255), (6, 0x41)], ids=["version", "encrypted"])
def test_archive_that_cannot_be_unpacked_is_refused(sound: Path, field: int, value: int) -> None:
    """Each entry states the version needed to extract it and its flags; the directory at the end, two bytes later."""
    content = bytearray(sound.read_bytes())
    for signature, at in ((b"PK\x03\x04", field), (b"PK\x01\x02", field + 2)):
        begin = content.find(signature)
        while begin >= 0:
            content[begin + at] = value
            begin = content.find(signature, begin + 4)
    wrong = sound.with_name("wrong.npz")
    wrong.write_bytes(content)
    with pytest.raises(StructureError, match=r"wrong\.npz: "):
        read_matrices(wrong, wrong, wrong)
