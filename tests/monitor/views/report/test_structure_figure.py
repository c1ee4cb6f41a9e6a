"""Names of members on the drawn structure."""

import itertools

import numpy as np

from monitor.results.convert import bare_reference
from monitor.views.report.structure_figure import Frame
from updater import Structure, parse_structure

CORNERS = ((0.0, 0.0), (1.2, 0.0), (1.2, 0.8), (0.0, 0.8))


def two_storeys() -> Structure:
    """Return a frame of four columns, with four beams on each of two floors."""
    ends = [(f"column {k}", (*at, 0.0), (*at, 2.0)) for k, at in enumerate(CORNERS)]
    for floor, height in (("middle", 1.0), ("top", 2.0)):
        sides = zip(CORNERS, (*CORNERS[1:], CORNERS[0]), strict=True)
        ends += [(f"{floor} beam {k}", (*a, height), (*b, height)) for k, (a, b) in enumerate(sides)]
    members = "".join(
        f'[[member]]\nname = "{name}"\nfrom = {list(start)}\nto = {list(end)}\nmaterial = "m"\nsection = "s"\n'
        for name, start, end in ends
    )
    return parse_structure(
        'name = "frame"\n[mesh]\nelement_length = 0.1\n'
        "[material.m]\nyoungs_modulus = 2.1e11\npoisson_ratio = 0.3\ndensity = 7850\n"
        '[section.s]\nshape = "box"\nwidth = 0.05\nheight = 0.03\nthickness = 0.002\n' + members
    )


def test_names_of_twelve_members_do_not_overlap() -> None:
    frame = Frame(bare_reference(two_storeys()))
    places = frame.name_places()
    assert len(places) == 12
    letter, height = 0.02 * frame.geometry.size, 0.04 * frame.geometry.size
    for (a, one), (b, other) in itertools.combinations(places.items(), 2):
        apart = np.abs(one - other)
        left = a if one[0] < other[0] else b
        assert apart[0] >= letter * len(left) or apart[1] >= height


def test_names_without_room_are_left_out() -> None:
    """Members of one place on paper, such as two lines of a truss that lie one behind the other."""
    structure = two_storeys()
    column = structure.member[0]
    same = [column.model_copy(update={"name": f"{column.name} {k}"}) for k in range(9)]
    frame = Frame(bare_reference(structure))
    names = [member.name for member in same]
    frame.geometry.lines = dict.fromkeys(names, frame.geometry.lines[column.name])
    assert 1 <= len(frame.name_places()) < len(names)
