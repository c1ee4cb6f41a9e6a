from collections.abc import Iterator

import pytest
import rerun as rr


@pytest.fixture(autouse=True)
def _strict() -> Iterator[None]:
    """Let every wrong call of rerun raise instead of being logged."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)
