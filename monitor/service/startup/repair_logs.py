"""Repair of unfinished logs at the start."""

from collections.abc import Iterator
from pathlib import Path

from daq import LogError, repair_log
from daq.bounded_text import one_line
from daq.log import has_end


def mend_logs(folder: Path) -> Iterator[str]:
    """Repair the unfinished logs of a folder; yield a text for each.

    A log that is still being written, or is past mending, is left as it is.
    """
    for path in sorted(folder.glob("*.mcap")):
        try:
            if not has_end(path):
                state = repair_log(path)
                yield f"{path}: repaired, {state.n_messages} messages kept"
        except LogError as error:
            yield str(error)
        except Exception as error:  # noqa: BLE001 - a file that somebody left there must not stop a start
            yield one_line(f"{path}: cannot be repaired: {type(error).__name__}: {error}")
