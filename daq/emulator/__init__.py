"""The device side of each protocol, on a pty: real bytes between real processes."""

from daq.emulator.can_dbc import EmulatedDbc
from daq.emulator.epson import EmulatedEpson
from daq.emulator.epson_can import EmulatedEpsonCan
from daq.emulator.line_faults import LineFaults, LineSpell
from daq.emulator.node import EmulatedNode
from daq.emulator.serving import EmulatedPort, SampleSource, serve_all, unplugging
from daq.emulator.slcan import EmulatedSlcan
from daq.emulator.witmotion import EmulatedWitmotion
from daq.emulator.witmotion_can import EmulatedWitmotionCan

__all__ = [
    "EmulatedDbc",
    "EmulatedEpson",
    "EmulatedEpsonCan",
    "EmulatedNode",
    "EmulatedPort",
    "EmulatedSlcan",
    "EmulatedWitmotion",
    "EmulatedWitmotionCan",
    "LineFaults",
    "LineSpell",
    "SampleSource",
    "serve_all",
    "unplugging",
]
