"""Signals before identification: conditioning, channel faults, gaps, sampling rates, quality."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from oma.preparation.bandwidth import usable_share
    from oma.preparation.conditioning import BoolArray, channel_faults, cleaned, detrended, enough, usable
    from oma.preparation.faults import ChannelFault, FaultKind
    from oma.preparation.gaps import bridged
    from oma.preparation.pyramid import ALIAS_FREE, PASS, TOP, Decimator, HighPass, Level, levels
    from oma.preparation.quality import BlockQuality, WindowQuality, window_quality
    from oma.types import SAME_AS
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "ALIAS_FREE",
    "PASS",
    "SAME_AS",
    "TOP",
    "BlockQuality",
    "BoolArray",
    "ChannelFault",
    "Decimator",
    "FaultKind",
    "HighPass",
    "Level",
    "WindowQuality",
    "bridged",
    "channel_faults",
    "cleaned",
    "detrended",
    "enough",
    "levels",
    "usable",
    "usable_share",
    "window_quality",
]
