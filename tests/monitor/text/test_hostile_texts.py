"""Texts that are nested too deeply, too large, or hold escape sequences: one printable line names the file."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.bounded_text import one_line, parse_json, parse_toml, printable
from tests.support.monitor.cli import Commands, assert_refused
from updater import StructureError, parse_structure, t_structure_toml

T_FRAME = t_structure_toml()


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Commands:
    return Commands(monkeypatch, capsys)


@given(st.text(st.characters(codec=None), max_size=3000))
def test_a_line_is_printable_and_bounded(text: str) -> None:
    line = one_line(text)
    assert len(line) < 1100
    assert "\n" not in line
    assert not {character for character in line if ord(character) < 32 and character != "\t"}
    assert printable(line) == line


def test_escape_sequences_are_shown_as_text() -> None:
    assert printable("\x1b[31mred\x07 \u202e°²") == "\\x1b[31mred\\x07 \\u202e°²"


@pytest.mark.parametrize(
    "text", ["[" * 30_000, "a = " + "[" * 200 + "]" * 200, "a." * 500 + "b = 1", "a = 0x" + "f" * 99]
)
def test_too_deep_or_too_large_toml_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"nested up to|64 bits|Invalid"):
        parse_toml(text)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("a = 1\nb = steel\n", r"\(at line 2, column 5\): a text needs quotes: \"steel\"$"),
        ("a = [{b = left-post}]", r": a text needs quotes: \"left-post\"$"),
        ("a = True", r": write true$"),
        ("a = \n", r"column 5\)$"),
        ("a = +", r"column 5\)$"),
    ],
)
def test_error_of_a_bare_word_in_toml_names_the_quotes(text: str, hint: str) -> None:
    with pytest.raises(ValueError, match="^Invalid value .*" + hint):
        parse_toml(text)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("a = 1\nb = 0,3", r"line 2, column 6\): the decimal sign is a point$"),
        ("a = -1,5e3", r": the decimal sign is a point$"),
        ("a = 1 b = 2", r"column 7\)$"),
        ('a = "x", 2', r"column 8\)$"),
        ("rate = 500,", r"column 11\)$"),
        ("a = 1, # c", r"column 6\)$"),
    ],
)
def test_error_of_a_comma_in_a_number_of_toml_names_the_point(text: str, hint: str) -> None:
    with pytest.raises(ValueError, match="^Expected newline .*" + hint):
        parse_toml(text)


@pytest.mark.parametrize("text", ["[" * 30_000, "[" * 200 + "]" * 200, "1" * 6000, "1" * 40, '{"a":' * 900])
def test_too_deep_or_too_large_json_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"nested up to|64 bits|digits|Expecting"):
        parse_json(text)


SITE = (
    'structure = "t.toml"\n[[device]]\nname = "a"\ndriver = "epson-uart"\nport = "p"\nchannels = {x = "beam_mid_x"}\n'
)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("x = " + "[" * 30_000, "site.toml: expected tables and lists nested up to 64 deep"),
        ("x = 1" + "0" * 6000, "site.toml: "),
        ("x" * 5000 + " = 1", "characters left out"),
        ('"\\u001b[31m\\u0007" = 1', "\\x1b[31m\\x07: no such setting"),
        ("rate = true", "device.0.rate: expected no truth value"),
        ("rate = 1e-300", "device.0.rate: "),
        ("rate = 9999-12-31", "device.0.rate: "),
        ("[analysis]\nwindow_seconds = 1e200", "analysis.window_seconds: "),
        ("[alarm]\nhold_windows = 9223372036854775807", "alarm.hold_windows: "),
    ],
)
def test_hostile_settings_give_a_short_error(commands: Commands, tmp_path: Path, more: str, message: str) -> None:
    (tmp_path / "t.toml").write_text(T_FRAME)
    (tmp_path / "site.toml").write_text(SITE + more + "\n")
    done = commands("settings", tmp_path / "site.toml")
    assert_refused(done, message)
    assert len(done.err) < 1200


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("youngs_modulus = ", "youngs_modulus = true #", "youngs_modulus: expected a number, found True"),
        ("density = ", "density = 1e-308 #", "density: "),
        ("elements = ", "elements = 100000 #", "elements: expected up to 20000"),
        ("elements = ", "elements = true #", "expected a number, found True"),
    ],
)
def test_invalid_numbers_in_a_structure_are_refused(old: str, new: str, message: str) -> None:
    assert old in T_FRAME
    with pytest.raises(StructureError, match=message):
        parse_structure(T_FRAME.replace(old, new, 1))


def test_too_many_sensors_are_refused() -> None:
    sensors = "".join(
        f'[[sensor]]\nchannel = "s{k}"\nat = [0, 0, {0.1 + 1e-5 * k:.5f}]\ndirection = [1, 0, 0]\n' for k in range(1001)
    )
    with pytest.raises(StructureError, match="sensor: expected up to 1000, found"):
        parse_structure(T_FRAME + sensors)
