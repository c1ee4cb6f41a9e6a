"""State of the watch in the state folder: a restart continues where the last run ended."""

from monitor.watch.memory.codec import CodecError
from monitor.watch.memory.file import NOTHING, LoadedState, MemoryFile, fitting, recall
from monitor.watch.memory.state import MEMORY, Memory, matters, memory_text, parse_memory

__all__ = [
    "MEMORY",
    "NOTHING",
    "CodecError",
    "LoadedState",
    "Memory",
    "MemoryFile",
    "fitting",
    "matters",
    "memory_text",
    "parse_memory",
    "recall",
]
