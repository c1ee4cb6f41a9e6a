"""Windows of the recorded log, which several examples identify: once in a process."""

from collections.abc import Iterator

import pytest

from daq import Recording
from oma import Identification, Method
from oma.identification import identify_cleaned
from oma.preparation import Cleaned


@pytest.fixture(autouse=True, scope="session")
def _identified_once() -> Iterator[None]:
    known: dict[tuple[object, ...], Identification] = {}

    def identified(
        recording: Recording,
        clean: Cleaned,
        method: Method | None = None,
        band: tuple[float, float] | None = None,
        *,
        overwrite: bool = False,
    ) -> Identification:
        key = (recording.data.tobytes(), recording.start, recording.rate, repr(method), band)
        if key not in known:
            known[key] = identify_cleaned(recording, clean, method, band, overwrite=overwrite)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("oma.windows.identify_cleaned", identified)
        yield
