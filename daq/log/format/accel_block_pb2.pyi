from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class AccelBlock(_message.Message):
    __slots__ = ("time", "rate", "first_index", "n_axes", "scale", "temperature", "flags", "n_scans", "coding", "start", "bits", "clock", "pair_offset")
    TIME_FIELD_NUMBER: _ClassVar[int]
    RATE_FIELD_NUMBER: _ClassVar[int]
    FIRST_INDEX_FIELD_NUMBER: _ClassVar[int]
    N_AXES_FIELD_NUMBER: _ClassVar[int]
    SCALE_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_FIELD_NUMBER: _ClassVar[int]
    FLAGS_FIELD_NUMBER: _ClassVar[int]
    N_SCANS_FIELD_NUMBER: _ClassVar[int]
    CODING_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    BITS_FIELD_NUMBER: _ClassVar[int]
    CLOCK_FIELD_NUMBER: _ClassVar[int]
    PAIR_OFFSET_FIELD_NUMBER: _ClassVar[int]
    time: int
    rate: float
    first_index: int
    n_axes: int
    scale: float
    temperature: float
    flags: int
    n_scans: int
    coding: _containers.RepeatedScalarFieldContainer[int]
    start: _containers.RepeatedScalarFieldContainer[int]
    bits: bytes
    clock: str
    pair_offset: int
    def __init__(self, time: _Optional[int] = ..., rate: _Optional[float] = ..., first_index: _Optional[int] = ..., n_axes: _Optional[int] = ..., scale: _Optional[float] = ..., temperature: _Optional[float] = ..., flags: _Optional[int] = ..., n_scans: _Optional[int] = ..., coding: _Optional[_Iterable[int]] = ..., start: _Optional[_Iterable[int]] = ..., bits: _Optional[bytes] = ..., clock: _Optional[str] = ..., pair_offset: _Optional[int] = ...) -> None: ...
