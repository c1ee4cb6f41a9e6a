"""The device side of each protocol, on a pty: real bytes between real processes."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.emulator.can.can_dbc import EmulatedDbc as EmulatedDbc
    from daq.emulator.can.epson_can import EmulatedEpsonCan as EmulatedEpsonCan
    from daq.emulator.can.slcan import EmulatedSlcan as EmulatedSlcan
    from daq.emulator.can.witmotion_can import EmulatedWitmotionCan as EmulatedWitmotionCan
    from daq.emulator.epson import EmulatedEpson as EmulatedEpson
    from daq.emulator.network import EmulatedAdapter as EmulatedAdapter
    from daq.emulator.network import EmulatedShake as EmulatedShake
    from daq.emulator.network import FaultyNetwork as FaultyNetwork
    from daq.emulator.network import free_port as free_port
    from daq.emulator.node import EmulatedNode as EmulatedNode
    from daq.emulator.serving import EmulatedPort as EmulatedPort
    from daq.emulator.serving import LineFaults as LineFaults
    from daq.emulator.serving import LineSpell as LineSpell
    from daq.emulator.serving import serve_all as serve_all
    from daq.emulator.serving import unplugging as unplugging
    from daq.emulator.text_lines import EmulatedTextLines as EmulatedTextLines
    from daq.emulator.witmotion import EmulatedWitmotion as EmulatedWitmotion
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
