"""Names of places by the structure's own names."""

import pytest

from updater import parse_structure
from updater.structure import place_name

PORTAL = """
name = "portal"
[mesh]
element_length = 0.2
[material.steel]
youngs_modulus = 210e9
poisson_ratio = 0.3
density = 7850
[section.tube]
shape = "tube"
diameter = 0.06
thickness = 0.003
[[member]]
name = "left post"
from = [0, 0, 0]
to = [0, 0, 2]
material = "steel"
section = "tube"
[[member]]
name = "right post"
from = [3, 0, 2]
to = [3, 0, 0]
material = "steel"
section = "tube"
[[member]]
name = "beam"
from = [0, 0, 2]
to = [3.5, 0, 2]
material = "steel"
section = "tube"
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
[[support]]
at = [3, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
[[support]]
at = [3.5, 0, 2]
fixed = ["z"]
[[sensor]]
channel = "A3y"
at = [0.8, 0, 2]
direction = [0, 1, 0]
[[sensor]]
channel = "A3z"
at = [0.8, 0, 2]
direction = [0, 0, 1]
"""


@pytest.mark.parametrize(
    ("position", "name"),
    [
        ((0, 0, 0.05), "foot of the left post"),
        ((3, 0, 0), "foot of the right post"),  # that begins at its top
        ((0, 0, 2), "joint of the left post and the beam"),
        ((3, 0, 1.98), "joint of the right post and the beam"),
        ((3.5, 0, 2), "support at the end of the beam"),
        ((0.82, 0, 2), "beam at sensors A3y, A3z"),
        ((1.6, 0, 2), "beam"),
        ((0, 0, 1.3), "left post"),
        ((1, 1, 1), ""),
    ],
)
def test_place_is_named_by_the_parts_next_to_it(position: tuple[float, float, float], name: str) -> None:
    assert place_name(parse_structure(PORTAL), position) == name


def test_free_end_is_named_by_its_height() -> None:
    alone = PORTAL[: PORTAL.index('[[member]]\nname = "right post"')] + PORTAL[PORTAL.index("[[support]]") :]
    structure = parse_structure(alone[: alone.index("[[support]]\nat = [3, 0, 0]")])
    assert place_name(structure, (0, 0, 2)) == "upper end of the left post"
