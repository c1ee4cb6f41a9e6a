"""State of the watch in the state folder: a restart continues where the last run ended."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from monitor.watch.memory.codec import CodecError as CodecError
    from monitor.watch.memory.file import MEMORY as MEMORY
    from monitor.watch.memory.file import NOTHING as NOTHING
    from monitor.watch.memory.file import LoadedState as LoadedState
    from monitor.watch.memory.file import MemoryFile as MemoryFile
    from monitor.watch.memory.mid_log import MidLogState as MidLogState
    from monitor.watch.memory.signals import CalmSignals as CalmSignals
    from monitor.watch.memory.state import VERSION as VERSION
    from monitor.watch.memory.state import Memory as Memory
    from monitor.watch.memory.state import check_saved_state as check_saved_state
    from monitor.watch.memory.state import memory_text as memory_text
    from monitor.watch.memory.state import parse_memory as parse_memory
    from monitor.watch.memory.state import recall as recall
    from monitor.watch.memory.state import state_fingerprint as state_fingerprint
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
