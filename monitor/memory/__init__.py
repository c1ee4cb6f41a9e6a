"""State of the watch in the state folder: a restart continues where the last run ended."""

from monitor.memory.codec import CodecError
from monitor.memory.contents import MEMORY, Memory, matters, memory_text, parse_memory
from monitor.memory.file import NOTHING, MemoryFile, Recalled, fitting, recall

__all__ = [
    "MEMORY",
    "NOTHING",
    "CodecError",
    "Memory",
    "MemoryFile",
    "Recalled",
    "fitting",
    "matters",
    "memory_text",
    "parse_memory",
    "recall",
]
