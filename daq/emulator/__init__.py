"""The device side of each protocol, on a pty: real bytes between real processes."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.emulator.can.can_dbc import EmulatedDbc
    from daq.emulator.can.epson_can import EmulatedEpsonCan
    from daq.emulator.can.slcan import EmulatedSlcan
    from daq.emulator.can.witmotion_can import EmulatedWitmotionCan
    from daq.emulator.epson import EmulatedEpson
    from daq.emulator.network import EmulatedAdapter, EmulatedShake, FaultyNetwork, free_port
    from daq.emulator.node import EmulatedNode
    from daq.emulator.serving import EmulatedPort, LineFaults, LineSpell, serve_all, unplugging
    from daq.emulator.text_lines import EmulatedTextLines
    from daq.emulator.witmotion import EmulatedWitmotion
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "EmulatedAdapter",
    "EmulatedDbc",
    "EmulatedEpson",
    "EmulatedEpsonCan",
    "EmulatedNode",
    "EmulatedPort",
    "EmulatedShake",
    "EmulatedSlcan",
    "EmulatedTextLines",
    "EmulatedWitmotion",
    "EmulatedWitmotionCan",
    "FaultyNetwork",
    "LineFaults",
    "LineSpell",
    "free_port",
    "serve_all",
    "unplugging",
]
