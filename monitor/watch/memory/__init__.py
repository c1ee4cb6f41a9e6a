"""State of the watch in the state folder: a restart continues where the last run ended."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from monitor.watch.memory.codec import CodecError
    from monitor.watch.memory.file import MEMORY, NOTHING, LoadedState, MemoryFile
    from monitor.watch.memory.state import (
        VERSION,
        Memory,
        check_saved_state,
        memory_text,
        parse_memory,
        recall,
        state_fingerprint,
    )
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "MEMORY",
    "NOTHING",
    "VERSION",
    "CodecError",
    "LoadedState",
    "Memory",
    "MemoryFile",
    "check_saved_state",
    "memory_text",
    "parse_memory",
    "recall",
    "state_fingerprint",
]
