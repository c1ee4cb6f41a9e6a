"""Windows of the recorded log, which several examples identify: once in a process."""

from collections.abc import Iterator
from typing import Any

import pytest

from daq import Recording
from oma import Identification
from oma.identification import identify_cleaned
from oma.preparation import Cleaned


@pytest.fixture(autouse=True, scope="session")
def _identified_once() -> Iterator[None]:
    known: dict[tuple[object, ...], Identification] = {}

    def identified(recording: Recording, clean: Cleaned, *chosen: Any, **how: Any) -> Identification:
        key = (recording.data.tobytes(), recording.start, recording.rate, repr(chosen))
        if key not in known:
            known[key] = identify_cleaned(recording, clean, *chosen, **how)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("oma.windows.identify_cleaned", identified)
        yield
