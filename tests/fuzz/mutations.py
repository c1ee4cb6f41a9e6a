"""Mutations of files: bytes, tokens of text, fields of MCAP records and of archives, drawn from a seeded generator."""

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from random import Random

import numpy as np
from mcap.writer import CompressionType, Writer

from daq.log.format.accel_block_pb2 import AccelBlock
from daq.log.format.rice import pack

Mutation = Callable[[bytes, Random], bytes]
BOMB = object()  # an array that is far larger than its archive

_TOKEN = re.compile(rb'"(?:[^"\\\n]|\\.)*"|[-+]?\d[\w.+:-]*|\w+')
#: values in the place of a token
NASTY = (
    *(b"0", b"-1", b"1", b"true", b"false", b"nan", b"inf", b"-inf", b'""', b"[]", b"{}", b"null"),
    *(b"1e-308", b"1e-300", b"1e300", b"1e30", b"1e-9", b"1e9", b"20000", b"100000", b"99999999"),
    *(b"4294967296", b"9223372036854775808", b"99999999999999999999", b"-2147483649", b"1" * 6000),
    *(b"9999-12-31", b"9999-12-31T23:59:59Z", b"0001-01-01T00:00:00+14:00", b'"9999-12-31T23:59:59Z"', b"23:59:60"),
    *(b'"\\u001b[31mred\\u0007"', b'"a\\nb"', b'"\\u0000"', b"'" + b"x" * 5000 + b"'", b'"' + "é☃".encode() * 9 + b'"'),
    *(b"[" * 3000 + b"]" * 3000, b"[" * 30000, b'{"a":' * 3000, b"\xff\xfe", b"\x1b[2J", b"[1, 2]", b"[0.0, 0.0, 0.0]"),
    *(b"0x" + b"f" * 6000, b"1e-29", b"1e29", b"2020-02-30", b"[[0.0]]"),
    *(b'"../../x"', b'"{{ 9 ** 9 ** 9 }}"', b"\"{{ '%999999999d' % 5 }}\""),
)
_INTEGERS = (0, 1, 2, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 6 * 10**9, (1 << 63) - 1, (1 << 64) - 1)


def mutated_bytes(data: bytes, random: Random) -> bytes:
    """Return bytes with one to four random changes: flips, cuts, repeated or inserted pieces, extreme integers."""
    found = bytearray(data)
    for _ in range(random.randint(1, 4)):
        at = random.randrange(len(found) + 1)
        kind = random.randrange(6)
        if kind == 0 and at < len(found):
            found[at] = random.randrange(256)
        elif kind == 1:
            del found[at : at + random.choice((1, 4, 100, 1 << 20))]
        elif kind == 2:
            found[at:at] = found[at : at + random.choice((1, 8, 500))]
        elif kind == 3:
            found[at:at] = random.randbytes(random.choice((1, 9, 60)))
        else:
            size = random.choice((2, 4, 8))
            value = random.choice(_INTEGERS) & ((1 << 8 * size) - 1)
            found[at : at + size] = value.to_bytes(size, random.choice(("little", "big")))
    return bytes(found)


def mutated_text(data: bytes, random: Random) -> bytes:
    """Return text with one or two tokens or lines changed, seldom bytes."""
    if random.random() < 0.1:
        return mutated_bytes(data, random)
    for _ in range(random.choice((1, 1, 1, 2))):
        kind = random.random()
        if kind < 0.75:
            tokens = list(_TOKEN.finditer(data))
            if not tokens:
                return mutated_bytes(data, random)
            place = random.choice(tokens)
            new = _replacement(place[0], tokens, random)
            data = data[: place.start()] + new + data[place.end() :]
            continue
        lines = data.splitlines(keepends=True) or [b"\n"]
        at = random.randrange(len(lines))
        if kind < 0.85:
            del lines[at]
        elif kind < 0.95:
            lines[at:at] = [lines[at]] * random.choice((1, 1, 300))
        else:
            lines[at:at] = [random.choice(NASTY) + b"\n"]
        data = b"".join(lines)
    return data


def _replacement(old: bytes, tokens: list[re.Match[bytes]], random: Random) -> bytes:
    """Return another token: a scaled number for a number, an extreme value, or a token from elsewhere."""
    kind = random.random()
    if kind < 0.4:
        with suppress(ValueError, OverflowError):
            number = float(old) * random.choice((-1, 1, 1, 1)) * 10 ** random.uniform(-9, 9)
            return f"{number:.6g}".encode() if b"." in old or random.random() < 0.3 else str(round(number)).encode()
    return random.choice(NASTY) if kind < 0.85 else random.choice(tokens)[0]


def json_value(random: Random, depth: int = 0) -> object:
    """Return any JSON value, also extreme, deep or of the wrong kind."""
    kinds: list[Callable[[], object]] = [
        lambda: random.choice((None, True, False, 0, -1, 1e-300, 1e300, float("nan"), float("inf"), 2**70, 1 << 63)),
        lambda: random.choice(("", "x", "\x1b[31m", "a\nb", "beam", "x" * 3000, "9999-12-31T23:59:59Z")),
    ]
    if depth < 3:
        kinds += [
            lambda: [json_value(random, depth + 1) for _ in range(random.randrange(4))],
            lambda: {random.choice(("device", "a", "missing")): json_value(random, depth + 1) for _ in range(2)},
        ]
    return random.choice(kinds)()


def mutated_json(data: bytes, random: Random) -> bytes:
    """Return a JSON text with one value replaced by another kind of value, or mutated as text."""
    if random.random() < 0.4:
        return mutated_text(data, random)
    content = json.loads(data)
    places: list[tuple[dict[str, object] | list[object], object]] = []

    def walk(value: object) -> None:
        items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for key, inner in items:
            places.append((value, key))  # type: ignore[arg-type]
            walk(inner)

    walk(content)
    if not places:
        return json.dumps(json_value(random)).encode()
    holder, key = random.choice(places)
    if random.random() < 0.15:
        del holder[key]  # type: ignore[arg-type]
    else:
        holder[key] = json_value(random)  # type: ignore[index,call-overload]
    return json.dumps(content).encode()


# --- MCAP -------------------------------------------------------------------------------------------------------------

_RECORD = struct.Struct("<BQ")
_MAGIC = b"\x89MCAP0\r\n"


def mutated_mcap(data: bytes, random: Random) -> bytes:
    """Return a log with a record changed inside (checksums made right where that is simple), or bytes changed."""
    if random.random() < 0.3:
        return mutated_bytes(data, random)
    records = _records(data)
    if not records:
        return mutated_bytes(data, random)
    for _ in range(random.choice((1, 1, 2))):
        at = random.randrange(len(records))
        opcode, content = records[at]
        kind = random.random()
        if kind < 0.1:
            del records[at]
        elif kind < 0.2:
            records.insert(random.randrange(len(records)), records[at])
        elif kind < 0.3:
            records[at] = (random.randrange(20), content)
        elif opcode == 0x06 and kind < 0.8:
            records[at] = (opcode, _chunk(content, random))
        elif opcode == 0x09 and len(content) > 4:
            changed = mutated_bytes(content[:-4], random)
            records[at] = (opcode, changed + struct.pack("<I", zlib.crc32(changed)))
        else:
            records[at] = (opcode, mutated_bytes(content, random))
        if not records:
            return data
    return _MAGIC + b"".join(_RECORD.pack(opcode, len(c)) + c for opcode, c in records) + _MAGIC


def _records(data: bytes) -> list[tuple[int, bytes]]:
    at, found = len(_MAGIC), []
    while at + _RECORD.size <= len(data) - len(_MAGIC):
        opcode, length = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        found.append((opcode, data[at : at + length]))
        at += length
    return found


def _chunk(content: bytes, random: Random) -> bytes:
    """Return a chunk with another stated size, checksum, compression or content."""
    first, last, size, checksum, named = struct.unpack_from("<QQQII", content)
    name, body = content[32 : 32 + named], content[40 + named :]
    kind = random.randrange(5)
    if kind == 0:
        size = random.choice(_INTEGERS)
    elif kind == 1:
        name = random.choice((b"lz4", b"", b"zstd", b"gzip", b"\xff"))
    elif kind == 2:
        checksum = random.choice((0, 1, checksum))
        body = mutated_bytes(body, random)
    elif kind == 3:
        name, body, checksum = b"lz4", _lz4(random), 0
        size = random.choice((size, 6 * 10**9))
    else:
        import zstandard

        raw = bytes(random.choice((1 << 20, 300 << 20)))
        name, body, checksum, size = b"zstd", zstandard.compress(raw), 0, len(raw)
    head = struct.pack("<QQQII", first, last, size, checksum, len(name))
    return head + name + struct.pack("<Q", len(body)) + body


def _lz4(random: Random) -> bytes:
    return b"\x04\x22\x4d\x18" + random.randbytes(random.randrange(40))


def crafted_mcap(_: bytes, random: Random) -> bytes:
    """Return a valid log whose blocks, events, channel map and attachments have extreme values."""
    file = io.BytesIO()
    writer = Writer(file, compression=random.choice((CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE)))
    profile = "modalwatch" if random.random() < 0.95 else "ros2"
    writer.start(profile=profile, library="x\x1b[2J")
    device = random.choice(("imu", "imu", "imu", "\x1b[31mred\x1b[0m", "", "x" * 3000, "a\nb", "beam/left"))
    channels = {
        "channels": [{"name": f"c{axis}", "device": device, "axis": axis} for axis in range(3)],
        "on_grid": random.random() < 0.5,
    }
    text = json.dumps(channels).encode()
    if random.random() < 0.2:
        text = mutated_json(text, random)
    if random.random() < 0.9:
        writer.add_attachment(0, 0, "channels.json", "text/plain", text)
    for name in ("site.toml", "structure.toml", "memory.json", "channels.json"):
        if random.random() < 0.12:
            writer.add_attachment(0, 0, name, "", random.choice((b"\xff\xfe", b"", b"[" * 30000, *NASTY)))
    if random.random() < 0.2:
        metadata = {"run": "r", "started": random.choice(("0", "x", "1" * 5000, "-1")), "number": "0"}
        writer.add_metadata("modalwatch.part", metadata)
    schema = writer.register_schema("s", "protobuf", b"")
    topic = writer.register_channel(f"/accel/{device}", "protobuf", schema)
    kind = random.choice(
        ("gap", "device_failed", "window", "reference", "alarm", "stopped", "diagnosis", "clock", "device", "note")
    )
    events = writer.register_channel(random.choice((f"/event/{kind}", f"/{kind}", f"/result/{kind}")), "json", schema)
    odd, fields = random.random() < 0.7, _block_fields(random)
    n, rate = 100, 100.0
    for number in range(random.choice((1, 4, 30))):
        counts = np.round(1e4 * np.random.default_rng(number).standard_normal((3, n))).astype(np.int32)
        packed = pack(counts.T)
        block = AccelBlock(
            time=1_767_225_600 * 10**9 + round(number * n / rate * 1e9),
            rate=rate,
            first_index=number * n,
            n_axes=3,
            n_scans=n,
            scale=1e-5,
            temperature=20.0,
            coding=[64 * order + n_low for order, n_low in zip(packed.order, packed.n_low, strict=True)],
            start=packed.start,
            bits=packed.bits,
        )
        if odd and random.random() < 0.5:
            for name, value in fields.items():
                with suppress(ValueError):  # some fields have no sign
                    setattr(block, name, value)
        time = random.choice(_INTEGERS) if random.random() < 0.02 else block.time & ((1 << 63) - 1)
        writer.add_message(topic, time, block.SerializeToString(), time, number)
        if random.random() < 0.3:
            reported = json.dumps(json_value(random)) if random.random() < 0.8 else "[" * 30000
            writer.add_message(events, time, reported.encode(), time, number)
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()


def _block_fields(random: Random) -> dict[str, object]:
    """Return one or two extreme fields of a block."""
    numbers = (0.0, -1.0, 1e-300, 1e300, float("nan"), float("inf"))
    whole = (0, -1, 1, 2**31 - 1, 2**62, -(2**63))
    fields: dict[str, tuple[object, ...]] = {
        "rate": numbers,
        "scale": numbers,
        "temperature": numbers,
        "time": whole,
        "first_index": whole,
        "pair_offset": whole,
        "n_axes": (0, 1, 2, 7, 2**31 - 1),
        "n_scans": (0, 1, 2**31 - 1),
        "flags": (1 << 20, 2**31 - 1, 3),
        "clock": ("sync", "\x1b[31m"),
    }
    return {name: random.choice(fields[name]) for name in random.sample(sorted(fields), random.choice((1, 1, 2)))}


# --- arrays -----------------------------------------------------------------------------------------------------------


def crafted_npz(data: bytes, random: Random) -> bytes:
    """Return an archive whose arrays have other headers, sizes, kinds or orientations than expected."""
    file = io.BytesIO()
    values = np.random.default_rng(0).standard_normal((200, 3))
    arrays: dict[str, object] = {"data": values, "rate": np.array(100.0), "channels": np.array(["a", "b", "c"])}
    odd: tuple[object, ...] = (
        values.T,
        np.zeros((3, 20000)),
        np.zeros((2, 2, 2)),
        np.array([]),
        np.array(np.nan),
        np.array([1e308, -1e308]),
        np.full((200, 3), 1e300),
        np.array(["x\x1b[31m", "y", "y" * 5000]),
        values.astype(np.complex128),
        np.zeros(200, [("a", "f8"), ("b", "i4")]),
        np.array(["2020-01-01"], "datetime64[D]"),
        np.array(1e-300),
        np.array(-1.0),
        np.array(True),
        _npy_head("<f8", (10**10,)),
        _npy_head("<f8", (10**5, 10**5)) + bytes(1000),
        _npy_head("|O", (3,)) + b"junk",
        _npy_head("<f8", (-3, 5)),
        _npy_head("<U1000000000", (3,)),
        BOMB,
        random.randbytes(300),
    )
    for _ in range(random.choice((1, 1, 2))):
        arrays[random.choice(("data", "rate", "channels", "t", "origin", "other"))] = random.choice(odd)
    stored = not any(array is BOMB for array in arrays.values()) and random.random() < 0.5
    packing = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
    with zipfile.ZipFile(file, "w", packing) as archive:
        for name, array in arrays.items():
            archive.writestr(f"{name}.npy", _npy(array))
    return file.getvalue() if random.random() < 0.9 else mutated_bytes(file.getvalue(), random)


def mutated_archive(data: bytes, random: Random) -> bytes:
    """Return an archive with one array replaced, resized or with extreme values."""
    with np.load(io.BytesIO(data)) as found:
        arrays = dict(found)
    name = random.choice(sorted(arrays))
    array = arrays[name]
    changes: tuple[Callable[[], object], ...] = (
        lambda: array[:-1],
        lambda: array * random.choice((-1, 0, 1e30, 1e-30)),
        lambda: np.full_like(array, random.choice((-1, 0, 2**30))),
        lambda: array.ravel()[: random.randrange(max(array.size, 1))],
        lambda: np.array(["x"]),
        lambda: np.zeros((3, 3, 3)),
        lambda: np.where(np.arange(array.size).reshape(array.shape) == 1, 2**31 - 1, array),
    )
    with np.errstate(all="ignore"):
        arrays[name] = np.asarray(random.choice(changes)())
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def _npy(array: object) -> bytes:
    if array is BOMB:
        return _npy_head("<f8", (150 << 20,)) + bytes(1200 << 20)
    if isinstance(array, bytes):
        return array
    piece = io.BytesIO()
    np.save(piece, np.asarray(array), allow_pickle=True)
    return piece.getvalue()


def _npy_head(dtype: str, shape: tuple[int, ...]) -> bytes:
    text = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}"
    return b"\x93NUMPY\x01\x00v\x00" + text.ljust(117).encode() + b"\n"


# --- CAN logs ---------------------------------------------------------------------------------------------------------


def mutated_blf(data: bytes, random: Random) -> bytes:
    """Return a BLF file with bytes changed, or with a container that states another size or expands beyond it."""
    at = data.find(b"LOBJ")
    if at < 0 or random.random() < 0.6:
        return mutated_bytes(data, random)
    size = random.choice((0, 16, 1 << 20, 1200 << 20))
    packed = zlib.compress(bytes(size), 9)
    stated = random.choice((size, 16, 0xFFFFFFFF))
    container = struct.pack("<HHLL", 2, 0, 0, stated) + bytes(4) + packed
    head = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(container), 10)
    return data[:at] + head + container + data[at:]
