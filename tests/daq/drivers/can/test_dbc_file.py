"""DBC files: content that is read, and one line for each error, with file and line, message or signal."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq import DbcError, DbcSensor
from daq.drivers import read_layout

FILE = Path(__file__).parents[4] / "examples" / "imu.dbc"
AXES = ("accX", "accY", "accZ")
HEAD = 'VERSION ""\nBU_: N\n'


def layout(folder: Path, text: str, **sensor: object) -> object:
    file = folder / "x.dbc"
    file.write_text(HEAD + text, encoding="utf-8")
    return read_layout(DbcSensor(**{"file": file, "signals": ("a",), "counter": "n", **sensor}))  # type: ignore[arg-type]


def signal(name: str, place: str, *, factor: str = "(1,0)", span: str = "[0|0]", unit: str = "m/s2") -> str:
    return f' SG_ {name} : {place} {factor} {span} "{unit}" N\n'


MESSAGE = "BO_ 1 A: 8 N\n"
A, N = signal("a", "0|16@1-"), signal("n", "16|8@1+")
WRONG = {
    "no message": ("", {}, "holds no messages"),
    "no DBC": ("what is this\n", {}, "holds no messages"),
    "cut": (MESSAGE + A + N[:-3], {}, "cannot be understood from line 5 or the one before it on"),
    "syntax": (MESSAGE + A + N + "BO_ 2 B 8 N\n" + A, {}, 'Invalid syntax at line 6, column 9: "BO_ 2 B >>!<<8 N"'),
    "too long": ("BO_ 1 A: 1 N\n" + A + N, {}, "The signal a does not fit in message A."),
    "far too long": (MESSAGE + signal("a", "0|123716039@1-") + N, {}, "line 4: expected a message of up to 1785 bytes"),
    "far behind": (MESSAGE + signal("a", "587338489|16@1-") + N, {}, "line 4: expected a message of up to 1785 bytes"),
    "before it": (MESSAGE + signal("a", "-2147483649|16@1-") + N, {}, "line 4: expected a message of up to 1785 bytes"),
    "two in one place": (MESSAGE + A + signal("n", "8|8@1+"), {}, "The signals n and a are overlapping in message A."),
    "no such axis": (MESSAGE + A + N, {"signals": ("A",)}, "has no signal 'A', did you mean 'a'?"),
    "no such message": (MESSAGE + A + N, {"signals": ("B.a",)}, "has no signal 'B.a', did you mean 'A.a'?"),
    "no counter": (MESSAGE + A, {}, "has no signal 'n'"),
    "axis in two messages": (
        MESSAGE + A + N + "BO_ 2 B: 8 N\n" + A,
        {},
        "signal 'a' could be any of A.a, B.a: name the message too",
    ),
    "no unit": (
        MESSAGE + signal("a", "0|16@1-", unit="V") + N,
        {},
        "signal A.a: its unit 'V' is none of m/s2, mm/s2, g, mg, ug: give `scale`",
    ),
    "two units": (
        MESSAGE + A + signal("b", "32|16@1-", unit="g") + N,
        {"signals": ("a", "b")},
        "the axes have different units: A.a [m/s2], A.b [g]",
    ),
    "counter of a bit": (MESSAGE + A + signal("n", "16|1@1+"), {}, "signal A.n: expected a counter, an integer of at"),
    "counter is a float": (
        MESSAGE + A + signal("n", "32|32@1-") + "SIG_VALTYPE_ 1 n : 1;\n",
        {},
        "signal A.n: expected a counter, an integer of at least 2 bits, found a float",
    ),
    "counter too long": (MESSAGE + A + signal("n", "32|32@1+", span="[0|99999999]"), {}, "A.n: counts to 99999999"),
    "multiplexed": (
        MESSAGE + signal("a m1", "0|16@1-") + signal("k M", "32|8@1+") + N,
        {},
        "signal A.a is multiplexed, which is not supported",
    ),
    "CAN FD": ("BO_ 1 A: 64 N\n" + A + N, {}, "message A: expected 1 to 8 bytes of classic CAN, found 64"),
    "no factor": (MESSAGE + signal("a", "0|16@1-", factor="(0,0)") + N, {}, "signal A.a: expected a factor, found 0"),
    "order": (MESSAGE + A + N, {"order": ("B",)}, "order: expected A in some order, found B"),
}


@pytest.mark.parametrize(("text", "sensor", "says"), WRONG.values(), ids=WRONG)
def test_invalid_dbc_gives_one_line_error_naming_the_file(
    tmp_path: Path, text: str, sensor: dict[str, object], says: str
) -> None:
    with pytest.raises(DbcError) as caught:
        layout(tmp_path, text, **sensor)
    assert str(caught.value).startswith(f"{tmp_path / 'x.dbc'}: ")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_is_named_in_the_error(tmp_path: Path) -> None:
    with pytest.raises(DbcError, match=r"none\.dbc: cannot be read: No such file"):
        read_layout(DbcSensor(file=tmp_path / "none.dbc", signals=("a",), counter="n"))


@given(st.data())
def test_damaged_file_is_read_or_refused_with_one_clear_error(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Bytes are cut out, doubled or overwritten: either there is a layout, or one clear error."""
    text = FILE.read_bytes()
    start = data.draw(st.integers(0, len(text)))
    stop = data.draw(st.integers(start, min(len(text), start + 40)))
    damaged = text[:start] + data.draw(st.sampled_from([b"", b"@", b"0", b"64|", text[start:stop] * 2])) + text[stop:]
    file = tmp_path_factory.getbasetemp() / "damaged.dbc"
    file.write_bytes(damaged)
    reported = refusal(DbcSensor(file=file, signals=AXES, counter="Counter", temperature="Temp"))
    assert reported is None or (reported.startswith(f"{file}: ") and "\n" not in reported)


def refusal(sensor: DbcSensor) -> str | None:
    """Return why a sensor's layout cannot be read, None if it can."""
    try:
        read_layout(sensor)
    except DbcError as error:
        return str(error)
    return None


def test_messages_of_shipped_dbc_are_in_arbitration_order() -> None:
    found = read_layout(DbcSensor(file=FILE, signals=AXES, counter="Counter", temperature="Temp"))
    assert [message.name for message in found.messages] == ["GroupCounter", "Acceleration"]
    assert found.all_identifiers == {6, 52, 98}
    assert (found.scale, found.unit, found.modulus) == (2**-8, 1.0, 1 << 16)
    turned = read_layout(DbcSensor(file=FILE, signals=AXES, counter="Counter", order=("Acceleration", "GroupCounter")))
    assert [place for place, _ in turned.axes] == [0, 0, 0]
    assert turned.counters[0][0] == 1


@pytest.mark.parametrize(
    ("text", "scale", "unit", "modulus"),
    [
        (A + N, 1.0, 1.0, 256),
        (signal("a", "0|16@1-", unit="m/s²") + signal("n", "16|4@1+", span="[0|14]"), 1.0, 1.0, 15),
        (signal("a", "0|16@1-", unit="m g") + signal("n", "32|32@1+"), 9.80665e-3, 9.80665e-3, 1 << 24),
        (signal("a", "0|16@1-", factor="(0.25,-4)", unit="g") + N, 0.25 * 9.80665, 9.80665, 256),
        # an offset that is no whole number of steps, and more bits than a count has: counts are finer, coarser
        (signal("a", "0|4@1+", factor="(0.5,-1.25)") + N, 6.25 / (2**31 - 1), 1.0, 256),
        (signal("a", "24|40@1+", factor="(1e-9,0)") + N, 1e-9 * (2**40 - 1) / (2**31 - 1), 1.0, 256),
        (signal("a", "32|32@1-") + N + "SIG_VALTYPE_ 1 a : 1;\n", 1e-6, 1.0, 256),
    ],
)
def test_scale_unit_and_counter_modulus_are_read_from_dbc(
    tmp_path: Path, text: str, scale: float, unit: float, modulus: int
) -> None:
    found = layout(tmp_path, MESSAGE + text)
    assert (found.scale, found.unit, found.modulus) == (pytest.approx(scale), pytest.approx(unit), modulus)  # type: ignore[attr-defined]


def test_given_scale_replaces_the_unit(tmp_path: Path) -> None:
    found = layout(tmp_path, MESSAGE + signal("a", "0|16@1-", factor="(2,0)", unit="LSB") + N, scale=0.01)
    assert found.scale == pytest.approx(0.02)  # type: ignore[attr-defined]


def test_dbc_in_cp1252_encoding_is_read(tmp_path: Path) -> None:
    file = tmp_path / "old.dbc"
    file.write_bytes((HEAD + MESSAGE + signal("a", "0|16@1-", unit="m/s²") + N).encode("cp1252"))
    assert read_layout(DbcSensor(file=file, signals=("a",), counter="n")).unit == 1.0


@pytest.mark.parametrize("signals", [(), ("a", "b", "c", "d")])
def test_sensor_with_invalid_axis_count_or_scale_is_refused(signals: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match=f"signals: expected those of x, .*, found {len(signals)}"):
        DbcSensor(file=FILE, signals=signals, counter="n")
    with pytest.raises(ValueError, match="scale: expected a positive number of m/s2 a unit, found -1"):
        DbcSensor(file=FILE, signals=("a",), counter="n", scale=-1.0)
