from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class AccelBlock(_message.Message):
    __slots__ = ("time", "rate", "first_index", "n_axes", "difference", "scale", "temperature", "flags", "pair_index", "pair_time", "n_scans", "packed", "coding", "start", "bits", "clock", "pair_offset")
    TIME_FIELD_NUMBER: _ClassVar[int]
    RATE_FIELD_NUMBER: _ClassVar[int]
    FIRST_INDEX_FIELD_NUMBER: _ClassVar[int]
    N_AXES_FIELD_NUMBER: _ClassVar[int]
    DIFFERENCE_FIELD_NUMBER: _ClassVar[int]
    SCALE_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_FIELD_NUMBER: _ClassVar[int]
    FLAGS_FIELD_NUMBER: _ClassVar[int]
    PAIR_INDEX_FIELD_NUMBER: _ClassVar[int]
    PAIR_TIME_FIELD_NUMBER: _ClassVar[int]
    N_SCANS_FIELD_NUMBER: _ClassVar[int]
    PACKED_FIELD_NUMBER: _ClassVar[int]
    CODING_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    BITS_FIELD_NUMBER: _ClassVar[int]
    CLOCK_FIELD_NUMBER: _ClassVar[int]
    PAIR_OFFSET_FIELD_NUMBER: _ClassVar[int]
    time: int
    rate: float
    first_index: int
    n_axes: int
    difference: _containers.RepeatedScalarFieldContainer[int]
    scale: float
    temperature: float
    flags: int
    pair_index: int
    pair_time: int
    n_scans: int
    packed: _containers.RepeatedCompositeFieldContainer[PackedAxis]
    coding: _containers.RepeatedScalarFieldContainer[int]
    start: _containers.RepeatedScalarFieldContainer[int]
    bits: bytes
    clock: str
    pair_offset: int
    def __init__(self, time: _Optional[int] = ..., rate: _Optional[float] = ..., first_index: _Optional[int] = ..., n_axes: _Optional[int] = ..., difference: _Optional[_Iterable[int]] = ..., scale: _Optional[float] = ..., temperature: _Optional[float] = ..., flags: _Optional[int] = ..., pair_index: _Optional[int] = ..., pair_time: _Optional[int] = ..., n_scans: _Optional[int] = ..., packed: _Optional[_Iterable[_Union[PackedAxis, _Mapping[str, object]]]] = ..., coding: _Optional[_Iterable[int]] = ..., start: _Optional[_Iterable[int]] = ..., bits: _Optional[bytes] = ..., clock: _Optional[str] = ..., pair_offset: _Optional[int] = ...) -> None: ...

class PackedAxis(_message.Message):
    __slots__ = ("order", "start", "n_low", "low", "high")
    ORDER_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    N_LOW_FIELD_NUMBER: _ClassVar[int]
    LOW_FIELD_NUMBER: _ClassVar[int]
    HIGH_FIELD_NUMBER: _ClassVar[int]
    order: int
    start: _containers.RepeatedScalarFieldContainer[int]
    n_low: int
    low: bytes
    high: bytes
    def __init__(self, order: _Optional[int] = ..., start: _Optional[_Iterable[int]] = ..., n_low: _Optional[int] = ..., low: _Optional[bytes] = ..., high: _Optional[bytes] = ...) -> None: ...
