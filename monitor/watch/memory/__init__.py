"""State of the watch in the state folder: a restart continues where the last run ended."""

from monitor.watch.memory.codec import CodecError
from monitor.watch.memory.file import NOTHING, LoadedState, MemoryFile, check_saved_state, recall
from monitor.watch.memory.state import MEMORY, VERSION, Memory, memory_text, parse_memory, state_fingerprint

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
