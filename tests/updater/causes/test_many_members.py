"""A frame of many members: stretches are screened before they are fitted."""

import numpy as np
import pytest

from tests.support.updater.reference_frame import measure, t_frame
from updater import Structure, build_model, learn_reference, matched, stack_tracks
from updater.causes import CATALOGUE
from updater.inference import compare, fit
from updater.structure import Segment

TRACK = np.arange(8)


def tower(bays: int = 2, storeys: int = 4) -> Structure:
    """Columns 0.8 m and beams 1 m long in one plane, clamped below, seen at three heights of two columns."""
    frame = t_frame().model_dump(by_alias=True)
    common = {"material": "steel", "section": "tube_40x40x3", "elements": 4}
    columns = [
        {"name": f"column {i} {j}", "from": (i, 0, 0.8 * j), "to": (i, 0, 0.8 * (j + 1)), **common}
        for i in range(bays + 1)
        for j in range(storeys)
    ]
    beams = [
        {"name": f"beam {i} {j}", "from": (i, 0, 0.8 * j), "to": (i + 1, 0, 0.8 * j), **common}
        for i in range(bays)
        for j in range(1, storeys + 1)
    ]
    fixed = ["x", "y", "z", "rx", "ry", "rz"]
    return Structure.model_validate(
        {
            "name": "tower",
            "material": frame["material"],
            "section": frame["section"],
            "member": columns + beams,
            "support": [{"at": (i, 0, 0), "fixed": fixed} for i in range(bays + 1)],
            "sensor": [
                {"channel": f"{i} {j} {axis}", "at": (i, 0, 0.8 * j), "direction": way}
                for i in (0, bays)
                for j in (2, 3, storeys)
                for axis, way in (("x", (1, 0, 0)), ("y", (0, 1, 0)))
            ],
        }
    )


@pytest.mark.thorough
def test_softened_column_of_a_tower_is_found() -> None:
    """20 members have hundreds of stretches more than are fitted: the true one is not left out, and the likeliest."""
    random, gain = np.random.default_rng(196), np.ones(12)
    structure = tower()
    bare, reached = structure.with_mesh(0.1), Segment(member="column 1 1", at=(1, 0, 1.2), extent=0.3, stiffness=0.3)
    models = [
        build_model(s, shear_flexible=True, mass="consistent")
        for s in (bare, bare.model_copy(update={"segment": (reached,)}))
    ]
    before, after = ([measure(model, random, gain) for _ in range(5)] for model in models)
    reference = learn_reference(structure, before, [TRACK] * 5)
    data = compare(reference, matched(reference.baseline, reference.mean_of(stack_tracks(after, [TRACK] * 5))))
    cause = CATALOGUE["local_stiffness"].propose(reference, data)
    assert cause is not None
    assert len(cause.start) < 300
    found = fit(data, cause)
    assert found.p_value > 1e-3
    where = found.hypotheses.where(found)
    assert where is not None
    assert where.member == "column 1 1"
    assert where.position is not None
    assert where.position_std is not None
    assert abs(where.position[2] - 1.2) < 4 * where.position_std
