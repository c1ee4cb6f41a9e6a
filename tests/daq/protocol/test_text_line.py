"""Lines of text: numbers and back, whole, damaged and in pieces."""

import itertools
import re
from functools import reduce
from operator import xor
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from daq.protocol import text_line
from daq.protocol.text_line import (
    UNITS,
    LineFormat,
    TextDecoder,
    TextScans,
    encode_lines,
    has_decimal_commas,
    no_scans,
    unsealed,
)

FORM = LineFormat(columns=("counter", "time_ms", "x", "y", "z", "temperature"), unit="g")
G = 9.80665
seeds = st.integers(0, 2**32)


def some_scans(seed: int, n: int, first: int = 0) -> TextScans:
    """Return scans with random counts over all of int32."""
    random, number = np.random.default_rng(seed), first + np.arange(n)
    counts = random.integers(-(2**31) + 1, 2**31, (n, 3)).astype(np.int32)
    return TextScans(counts, number, np.round(0.01 * number, 6), np.round(random.normal(20, 9, n), 2), np.arange(n))


def fed(stream: bytes, form: LineFormat, cuts: list[int]) -> tuple[TextScans, int]:
    """Return the scans of a stream in pieces, and the bytes outside valid lines."""
    decoder, edges = TextDecoder(form), [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    parts = [decoder.feed(stream[a:b]) for a, b in itertools.pairwise(edges)]
    fields = ("counts", "counter", "time", "temperature", "line")
    return TextScans(*(np.concatenate([getattr(p, name) for p in parts]) for name in fields)), decoder.bad_bytes


def read(text: bytes, columns: str = "x y z", **meaning: object) -> list[list[float]]:
    """Return the accelerations of lines [m/s2]."""
    form = LineFormat(columns=tuple(columns.split()), **(meaning or {"unit": "m/s2"}))  # type: ignore[arg-type]
    found = TextDecoder(form).feed(text)
    return [[round(int(row[axis]) * form.step, 9) for axis in form.axes] for row in found.counts]


@given(
    seeds, st.sampled_from([*UNITS, None]), st.booleans(), st.booleans(), st.lists(st.integers(0, 10_000), max_size=20)
)
@settings(max_examples=40)
def test_encoding_round_trip_is_exact_in_any_pieces(
    seed: int, unit: str | None, checksum: bool, decimal_comma: bool, cuts: list[int]
) -> None:
    form = LineFormat(columns=FORM.columns, unit=unit, scale=None if unit else 1e-3, decimal_comma=decimal_comma)
    scans = some_scans(seed, 30)
    found, bad = fed(encode_lines(scans, form, checksum=checksum), form, cuts)
    assert bad == 0
    np.testing.assert_array_equal(found.counts, scans.counts)
    np.testing.assert_array_equal(found.counter, scans.counter)
    np.testing.assert_array_equal(found.line, scans.line)
    np.testing.assert_allclose(found.time, scans.time, atol=1e-9)
    np.testing.assert_allclose(found.temperature, scans.temperature, atol=1e-9)


def test_checksum_is_that_of_published_nmea_sentences() -> None:
    """Examples of receivers of positions, as in their manuals."""
    for sentence in (
        b"$GPGLL,5300.97914,N,00259.98174,E,125926,A*28",
        b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47",
        b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A",
    ):
        assert unsealed(sentence) == sentence[1:-3]
        assert unsealed(sentence[:-1] + b"0") is None


def test_line_of_the_documentation_has_its_checksum() -> None:
    page = Path(__file__).parents[3] / "docs" / "howto" / "rig" / "text.md"
    (line,) = re.findall(r"`(\$1042[^`]*)`", page.read_text(encoding="utf-8"))
    assert unsealed(line.encode()) == b"1042,10420,0.012,-0.981,0.034"
    assert line in (text_line.__doc__ or "")


@pytest.mark.parametrize(
    "line",
    [
        b"0.5,-1,9.81",
        b" 0.5 ; -1.0;+9.81 \r",
        b"0.5\t-1.\t9.81e0",
        b".5   -1 981e-2",
        b"x:0.5,y:-1,z:9.81",
        b"accX: 0.5\tY = -1\tz=9.81",
        b"$ACC,0.5,-1,9.81*44",
    ],
)
def test_common_forms_of_a_line_are_read(line: bytes) -> None:
    assert read(line + b"\n") == [[0.5, -1.0, 9.81]]


@pytest.mark.parametrize("line", [b"0,5;-1,0;9,81", b"0,5\t-1\t9,81", b"x: 0,5 y: -1 z: 9,81"])
def test_decimal_commas_are_read(line: bytes) -> None:
    assert has_decimal_commas(line)
    assert read(line + b"\n", unit="m/s2", decimal_comma=True) == [[0.5, -1.0, 9.81]]


@pytest.mark.parametrize("line", [b"1,2,3", b"1, 2; 3", b"0.5,1 2", b"1;2;3", b"x:0,y:-1 z:9"])
def test_other_commas_are_separators(line: bytes) -> None:
    assert not has_decimal_commas(line)


@pytest.mark.parametrize(
    "line",
    [
        b"0.5,-1",
        b"0.5,-1,9.81,1",
        b"0.5,,9.81",
        b"nan,-1,9.81",
        b"inf,-1,9.81",
        b"1_0,-1,9.81",
        b"0x5,-1,9.81",
        b"0.5.1,-1,9.81",
        b"3000,-1,9.81",
        b"1e99,-1,9.81",
        b"0,5;-1,0;9,81",
        b"$0.5,-1,9.81*00",
        b"$0.5,-1,9.81",
        "0.5,-1,٣".encode(),
    ],
)
def test_lines_of_another_form_are_counted_as_bad(line: bytes) -> None:
    decoder = TextDecoder(LineFormat(columns=("x", "y", "z"), unit="m/s2"))
    assert len(decoder.feed(b"1,2,3\n" + line + b"\n4,5,6\n")) == 2
    assert decoder.bad_bytes == len(line) + 1


def test_units_counts_and_missing_axes() -> None:
    assert read(b"1,2\n", "z y", unit="g") == [[round(2 * G, 6), round(G, 6)]]
    assert read(b"1,2\n", "y x", unit="mg") == [[round(2e-3 * G, 6), round(1e-3 * G, 6)]]
    assert read(b"7,-3,7\n8,1.5,8\n", "- x -", scale=0.01) == [[-0.03]]


def test_blank_lines_and_comments_are_not_bad() -> None:
    decoder = TextDecoder(LineFormat(columns=("x",), unit="g"))
    scans = decoder.feed(b"# ready\r\n\r\n1\r\n\n2\n")
    assert (len(scans), decoder.bad_bytes, scans.line.tolist()) == (2, 0, [0, 1])


def test_damaged_lines_count_as_the_lines_that_fill_them() -> None:
    """Without a counter the number of a scan is that of its line; a lost line feed joins two lines."""
    decoder = TextDecoder(LineFormat(columns=("x", "y"), unit="g"))
    scans = decoder.feed(b"10,0\n11,0\n12,013,0\n14,0\n\x00\x01\n16,0\n")
    assert scans.line.tolist() == [0, 1, 4, 6]


@given(st.integers(0, 2**32))
@settings(max_examples=20)
def test_sealed_lines_with_one_damaged_byte_each_give_no_false_scan(seed: int) -> None:
    """The exclusive or notices any one wrong byte; once a line has a checksum, all must have one."""
    random, scans = np.random.default_rng(seed), some_scans(seed, 60)
    lines = encode_lines(scans, FORM, checksum=True).splitlines(keepends=True)
    wrong = random.choice(np.arange(1, 60), 20, replace=False)
    for k in wrong:
        damaged = bytearray(lines[k])
        damaged[random.integers(0, len(damaged) - 2)] ^= 1 << int(random.integers(0, 8))
        lines[k] = bytes(damaged)
    found, bad = fed(b"".join(lines), FORM, [])
    true = np.setdiff1d(np.arange(60), wrong)
    kept = np.isin(true, found.counter)
    np.testing.assert_array_equal(found.counts, scans.counts[np.isin(scans.counter, found.counter)])
    assert np.count_nonzero(~kept) <= len(wrong)  # a byte that becomes a line feed cuts one line only
    assert bad > 0


def test_stream_without_line_feeds_is_dropped() -> None:
    decoder = TextDecoder(LineFormat(columns=("x",), unit="g"))
    for _ in range(100):
        assert len(decoder.feed(b"1" * 90)) == 0
    assert decoder.bad_bytes >= 9000 - 490
    assert len(decoder.feed(b"\n1\n")) == 1


@given(
    st.one_of(st.binary(max_size=300), st.lists(st.sampled_from(list(b"$*,;.-+e0123456789ABF:= \t\r\n#"))).map(bytes))
)
def test_arbitrary_bytes_are_read_or_counted(data: bytes) -> None:
    decoder = TextDecoder(LineFormat(columns=("counter", "time_us", "x", "temperature"), unit="mg"))
    found = decoder.feed(data)
    assert np.all(np.isfinite(found.time))
    assert 0 <= decoder.bad_bytes <= len(data)


def test_empty_scans_are_encoded_to_nothing() -> None:
    assert encode_lines(no_scans(), FORM) == b""
    assert reduce(xor, b"A", 0) == 0x41  # as of a line of one character


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"columns": ("x", "q")}, "columns: expected counter, .* found 'q'"),
        ({"columns": ("x", "x")}, "columns: expected each name once"),
        ({"columns": ("time_s", "time_ms", "x")}, "columns: expected each name once, and one time"),
        ({"columns": ("counter",)}, "columns: expected an axis, x, y, z, found none"),
        ({"unit": None}, "expected one of `unit` and `scale`"),
        ({"scale": 1.0}, "expected one of `unit` and `scale`"),
        ({"unit": "kg"}, "unit: expected m/s2, g, mg, cm/s2, mm/s2, found 'kg'"),
        ({"unit": None, "scale": -1.0}, "scale: expected a positive number"),
        ({"counter_bits": 12}, "counter_bits: expected 8, 16, 32, found 12"),
    ],
)
def test_invalid_formats_are_refused(wrong: dict[str, object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        LineFormat(**{"columns": ("x",), "unit": "g"} | wrong)  # type: ignore[arg-type]
