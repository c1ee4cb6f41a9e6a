"""Signals before identification: conditioning, channel faults, gaps, sampling rates, quality."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from oma.preparation.conditioning import BoolArray as BoolArray
    from oma.preparation.conditioning import Cleaned as Cleaned
    from oma.preparation.conditioning import channel_faults as channel_faults
    from oma.preparation.conditioning import cleaned as cleaned
    from oma.preparation.conditioning import detrended as detrended
    from oma.preparation.conditioning import detrended_pieces as detrended_pieces
    from oma.preparation.conditioning import enough as enough
    from oma.preparation.conditioning import usable as usable
    from oma.preparation.faults import ChannelFault as ChannelFault
    from oma.preparation.faults import FaultKind as FaultKind
    from oma.preparation.gaps import bridged as bridged
    from oma.preparation.gaps import gapless_stretches as gapless_stretches
    from oma.preparation.pyramid import ALIAS_FREE as ALIAS_FREE
    from oma.preparation.pyramid import PASS as PASS
    from oma.preparation.pyramid import TOP as TOP
    from oma.preparation.pyramid import Decimator as Decimator
    from oma.preparation.pyramid import HighPass as HighPass
    from oma.preparation.pyramid import Level as Level
    from oma.preparation.pyramid import levels as levels
    from oma.preparation.pyramid import usable_share as usable_share
    from oma.preparation.quality import BlockQuality as BlockQuality
    from oma.preparation.quality import WindowQuality as WindowQuality
    from oma.preparation.quality import window_quality as window_quality
    from oma.types import SAME_AS as SAME_AS
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
