"""Frame with unmeasured points, and its response model."""

import pytest

from tests.support.updater.unmeasured_points import FRAME_SEED, UnmeasuredPoints, unmeasured_points
from updater.validation import ResponseModel


@pytest.fixture(scope="module")
def frame() -> UnmeasuredPoints:
    print(f"seed {FRAME_SEED}")
    return unmeasured_points("frame", FRAME_SEED)


@pytest.fixture(scope="module")
def learned(frame: UnmeasuredPoints) -> ResponseModel:
    return ResponseModel.learn(frame.reference, frame.record(25.0, FRAME_SEED)[0])
