"""Universal file of an impact test of the simulated tower, with header, geometry and coherences."""

from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from daq.files import header_set
from tests.support.daq.responses import COHERENCE, frequency_response
from tests.support.oma.impact_test import CHANNELS, REFERENCES, ImpactTest, tower

DECAY = 1.0  # time constant of the exponential window [s]
_AXES = {"x": 1, "y": 2}


def write_tower(path: Path) -> None:
    """Write accelerances at eight places to two forces, with an exponential window of `DECAY`."""
    line, response, coherence = ImpactTest(noise=0.02, decay=DECAY).h1_with_coherence(tower(), 1)
    height = [0.0, 1.0, 2.0, 3.0, 4.0]
    sets: list[Any] = [
        header_set("hammer test of a tower"),
        {"type": 15, "node_nums": [9, 1, 2, 3, 4], "x": [0.0] * 5, "y": [0.0] * 5, "z": height},
        {"type": 82, "trace_num": 1, "nodes": np.array([9, 1, 2, 3, 4]), "id": "tower", "color": 0},
    ]
    sets += [
        frequency_response(
            values[1:, k, i],
            line[1:],
            **of_function,
            rsp_ent_name="NONE",
            rsp_node=int(name[0]),
            rsp_dir=_AXES[name[-1]],
            ref_ent_name="NONE",
            ref_node=int(CHANNELS[force][0]),
            ref_dir=_AXES[CHANNELS[force][-1]],
        )
        for i, force in enumerate(REFERENCES)
        for k, name in enumerate(CHANNELS)
        for values, of_function in ((response, {}), (coherence, COHERENCE))
    ]
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")
