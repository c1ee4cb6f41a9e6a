"""Error for a structure that is not supported: the motion of the whole, or the member that moves."""

import itertools
from typing import Any

import numpy as np
import pytest
from scipy import sparse

from daq import FloatArray
from tests.support.updater.frames import ALL, beam, t_frame
from tests.support.updater.published_frames import frame
from updater import Structure, build_model
from updater.errors import MechanismError
from updater.fe.mechanism import free_motion
from updater.structure import Support

HANGS = "a freely suspended structure needs its soft springs as the stiffness of a support"
EVERY_WAY = "along x, along y, along z, about x, about y, about z"


def _said(structure: Structure) -> str:
    with pytest.raises(MechanismError) as caught:
        build_model(structure, mass="consistent").modes(2)
    return str(caught.value).partition("is missing")[2]


@pytest.mark.parametrize("elements", [3, 40, 240])  # all of the matrix, and its lowest vectors only
@pytest.mark.parametrize(
    ("fixed", "ways"),
    [
        ((), EVERY_WAY),
        (("x", "y", "z"), "about x, about y, about z"),
        (("x", "y", "z", "rx", "ry"), "about z"),
        (("x", "rx", "ry", "rz"), "along y, along z"),
        (("z", "rx", "ry"), "along x, along y, about z"),
    ],
)
def test_free_rigid_body_motions_are_named(fixed: tuple[str, ...], ways: str, elements: int) -> None:
    support = Support.model_validate({"at": (0, 0, 0), "fixed": fixed})
    structure = beam(length=1.0, elements=elements, support=(support,), second_moment=(1e-3, 2e-3))
    assert _said(structure).partition("; a freely")[0] == f"; all of it is free {ways}"


def test_frame_without_a_foot_is_free_in_all_directions() -> None:
    reported = _said(t_frame().model_copy(update={"support": ()}))
    assert reported == f"; all of it is free {EVERY_WAY}; {HANGS}"


def test_frame_on_soft_springs_has_six_slow_rigid_body_modes() -> None:
    """Springs of 1 N/m move the first elastic mode of the free frame, near 60 Hz, by under (0.2 Hz / 60 Hz)^2."""
    frequency = []
    for stiffness in (1.0, 2.0):
        hung = Support(at=(0, 0, 1.48), stiffness=dict.fromkeys(ALL, stiffness))
        frequency.append(build_model(t_frame().model_copy(update={"support": (hung,)})).modes(8).frequency)
    assert frequency[0][5] < 0.5
    assert frequency[0][6] > 20
    np.testing.assert_allclose(frequency[1][:6] / frequency[0][:6], np.sqrt(2), rtol=0.05)
    np.testing.assert_allclose(frequency[1][6:], frequency[0][6:], rtol=1e-3)


def test_free_rotation_axis_is_found_at_any_position_and_direction() -> None:
    ends = (Support(at=(0, 0, 0), fixed=("x", "y", "z")), Support(at=(1, 0, 0), fixed=("y", "z")))
    level = beam(length=1.0, elements=6, support=ends, second_moment=(1e-3, 2e-3))
    assert _said(level) == "; all of it is free about x"
    far = float(0.5**0.5)
    ends = (ends[0], Support(at=(far, far, 0), fixed=("x", "y", "z")))
    askew = beam(length=1.0, elements=6, support=ends, second_moment=(1e-3, 2e-3), direction=(1, 1, 0))
    assert _said(askew) == "; all of it is free about an axis askew"


def _portal(foot: Any, spans: list[tuple[int, int]], points: FloatArray) -> Structure:
    material = {"youngs_modulus": 200e9, "poisson_ratio": 0.3, "density": 8000.0}
    support = [{"at": tuple(points[0]), "fixed": foot}]
    section = {"shape": "circle", "diameter": 0.02}
    return frame(points, section, elements=4, material=material, support=support, spans=spans)


def test_unconnected_member_is_named() -> None:
    points = np.array([[0, 0, 0], [0, 0, 1.0], [1.0, 0, 1.0], [3.0, 0, 0], [3.0, 0, 1.0]])
    reported = _said(_portal(ALL, [(0, 1), (1, 2), (3, 4)], points))
    assert reported.startswith("; free to move by itself: 2 at [3.0, 0.0, ")


def test_member_free_to_rotate_about_its_axis_is_named() -> None:
    """A strut between two balls next to a supported frame."""
    points = np.array([[0, 0, 0], [0, 0, 1.0], [1.0, 0, 1.0], [3.0, 0, 0], [3.0, 0, 1.0]])
    structure = _portal(ALL, [(0, 1), (1, 2), (3, 4)], points)
    balls = tuple(Support(at=(3.0, 0.0, z), fixed=("x", "y", "z")) for z in (0.0, 1.0))
    reported = _said(structure.model_copy(update={"support": (*structure.support, *balls)}))
    assert reported.startswith("; free to turn by itself: 2 at [3.0, 0.0, ")


def test_translation_only_nodes_leave_all_rigid_motions_free() -> None:
    """A tetrahedron of bars, three DOFs a node, as matrices of another program may be: free every way, and no more."""
    nodes = np.array([[0, 0, 0], [1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
    dofs = np.full((4, 6), -1, np.int32)
    dofs[:, :3] = np.arange(12).reshape(4, 3)
    stiffness = np.zeros((12, 12))
    for a, b in itertools.combinations(range(4), 2):
        along = (nodes[b] - nodes[a]) / np.linalg.norm(nodes[b] - nodes[a])
        rows = np.r_[dofs[a, :3], dofs[b, :3]]
        stiffness[np.ix_(rows, rows)] += np.outer(np.r_[along, -along], np.r_[along, -along])
    found = free_motion(nodes, dofs, sparse.csc_array(stiffness))
    assert ", ".join(found.whole) == EVERY_WAY
    assert found.node is None
