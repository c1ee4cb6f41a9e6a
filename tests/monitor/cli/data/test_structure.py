"""`structure`: detectability by the sensors, in figures that are known beforehand, and a picture of it."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from daq import McapWriter
from tests.support.monitor.cli import Commands, assert_refused
from updater import Structure, parse_structure, t_structure_toml
from updater.planning import look
from updater.structure import odd_units

CANTILEVER = """
name = "cantilever"
[material.steel]
youngs_modulus = 210e9
shear_modulus = 80e9
density = 7850
[section.bar]
area = 1e-4
second_moment = [8e-10, 4e-10]
torsion_constant = 1e-9
[[member]]
name = "bar"
from = [0, 0, 0]
to = [1, 0, 0]
material = "steel"
section = "bar"
elements = 20
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
"""


def cantilever(*sensors: tuple[float, str]) -> str:
    """Return a cantilever along x with sensors at distances [m] in the directions y or z."""
    entries = [
        f'[[sensor]]\nchannel = "s{i}"\nat = [{at}, 0, 0]\ndirection = {[0, int(way == "y"), int(way == "z")]}\n'
        for i, (at, way) in enumerate(sensors)
    ]
    return CANTILEVER + "".join(entries)


def parsed(*sensors: tuple[float, str]) -> Structure:
    return parse_structure(cantilever(*sensors))


def test_sensors_along_one_axis_measure_one_bending_plane() -> None:
    sight = look(parsed((1.0, "z"), (0.5, "z")), 4)
    in_z = np.abs(sight.motion[:, -1, 2]) > 0.5  # at the tip, where bending is largest: 1
    assert in_z.sum() == 2
    np.testing.assert_allclose(sight.seen, in_z, atol=1e-6)
    assert [sight.is_seen(k) for k in range(4)] == in_z.tolist()


def test_sensor_at_a_node_of_a_mode_does_not_measure_it() -> None:
    # the node of a cantilever's second mode is at 0.7834 of its length (Blevins 1979, table 8-1)
    sight = look(parsed((0.7834, "y")), 6)
    in_y = [k for k in range(6) if np.abs(sight.motion[k, :, 1]).max() > 0.5]
    assert sight.seen[in_y[1]] < 0.01
    # a quarter of the length from the tip the first mode has 0.725 of its largest motion, at 0.7834 0.697
    assert sight.seen[in_y[0]] == pytest.approx(0.70, abs=0.01)


def test_two_sensors_distinguish_modes_but_one_does_not() -> None:
    one = look(parsed((1.0, "y")), 6)
    seen = [k for k in range(6) if one.is_seen(k)]
    assert len(seen) > 1
    assert all(one.alike(k) == tuple(other for other in seen if other != k) for k in seen)
    two = look(parsed((1.0, "y"), (0.5, "y")), 4)
    assert all(two.alike(k) == () for k in range(4))


def test_structure_writes_json_and_a_picture(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "frame.toml"
    path.write_text(t_structure_toml(), encoding="utf-8")
    done = modalwatch("structure", path, "--json", tmp_path / "frame.json", "--modes", 8)
    assert (done.code, done.err) == (0, "")
    found = json.loads((tmp_path / "frame.json").read_text())
    model = look(parse_structure(t_structure_toml()), 8)
    assert found["frequencies"] == model.modes.frequency.tolist()
    # two tubes of 1.48 and 0.80 m
    assert found["total_mass"] == pytest.approx(7850 * 4.1934e-4 * 2.28)
    assert f"{found['total_mass']:.3f} kg; 2 members" in done.out
    assert np.diag(np.array(found["auto_mac"])) == pytest.approx(1.0)
    assert min(found["seen"]) > 0.8
    assert found["alike"] == [[]] * 8
    assert f"picture: {path.with_suffix('.png')}" in done.out
    assert all(f"{frequency:.3f}" in done.out for frequency in found["frequencies"])
    colours = np.asarray(Image.open(path.with_suffix(".png")).convert("RGB")).reshape(-1, 3)
    # members, sensors, support, and where no mass is seen
    for colour in ((0x37, 0x47, 0x4F), (0x15, 0x65, 0xC0), (0x2E, 0x7D, 0x32), (0xC6, 0x28, 0x28)):
        assert (colours == colour).all(axis=1).sum() > 100
    body = found["body"]
    weakest = dict(zip([tuple(p["position"]) for p in body["places"]], body["weakest_mass"], strict=True))
    assert weakest[(0, 0, 0)] is None
    assert weakest[(-0.4, 0, 1.48)] == pytest.approx(weakest[(0.4, 0, 1.48)], rel=1e-6)  # the frame is symmetric
    assert f"{1000 * weakest[(0.4, 0, 1.48)]:.2g} g" in done.out
    assert body["one_more"]["position_std"]["after"] < body["one_more"]["position_std"]["before"]
    assert found["target"] is None


@pytest.mark.usefixtures("undrawn")
def test_member_without_modal_motion_has_no_detectable_mass(modalwatch: Commands, tmp_path: Path) -> None:
    """It is a third of all places, and needs masses without bounds."""
    path = tmp_path / "bar.toml"
    stub = CANTILEVER[CANTILEVER.index("[[member]]") :].replace('"bar"\nfrom', '"stub"\nfrom')
    stub = stub.replace("to = [1, 0, 0]", "to = [0, 0, -0.6]").replace("at = [0, 0, 0]", "at = [0, 0, -0.6]")
    path.write_text(cantilever((1.0, "z"), (0.7, "y"), (0.4, "z"), (0.4, "y")) + stub)
    done = modalwatch("structure", path, "--highest", 90, "--json", tmp_path / "bar.json")
    assert (done.code, done.err) == (0, "")
    weakest = json.loads((tmp_path / "bar.json").read_text())["body"]["weakest_mass"]
    assert sum(mass is None for mass in weakest) > 0.2 * len(weakest)
    assert "0.00 to 0.60" in done.out
    assert path.with_suffix(".png").exists()


@pytest.mark.thorough
@pytest.mark.usefixtures("undrawn")
def test_fewer_sensors_need_longer_records_for_the_same_target(modalwatch: Commands, tmp_path: Path) -> None:
    path, written = tmp_path / "bar.toml", tmp_path / "bar.json"
    path.write_text(cantilever((0.3, "y"), (0.6, "y"), (1.0, "y"), (0.6, "z"), (1.0, "z")))
    # the bar weighs 785 g
    done = modalwatch(
        "structure", path, "--json", written, "--target-mass", "3g", "--tolerance", "30mm", "--record-seconds", 120
    )
    assert (done.code, done.err) == (0, "")
    target = json.loads(written.read_text())["target"]
    assert (target["mass"], target["within"], target["chance"]) == (0.003, 0.03, 0.95)
    shares = [record["share"] for record in target["records"]]
    assert shares == sorted(shares)
    assert 0.5 < shares[-1] < 1  # never at the clamp
    assert target["seconds"][0] is None
    needed = [s["seconds_for_share"]["0.9"] or np.inf for s in target["sensors"]]
    assert [len(s["channels"]) for s in target["sensors"]] == list(range(5, 5 - len(needed), -1))
    assert needed[-1] > 1.5 * needed[0]
    assert "3 g found within 30 mm in 95 of 100 cases" in done.out
    assert "2 min before and after" in done.out


@pytest.mark.usefixtures("undrawn")
def test_sensor_for_unmeasured_modes_is_suggested(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "bar.toml"
    path.write_text(cantilever((0.6, "z"), (1.0, "z")))
    done = modalwatch("structure", path, "--modes", 4)
    assert done.code == 0, done.err
    # the bar is softer about y, so that modes 1 and 3 move in y
    assert "no sensor measures modes 1, 3" in " ".join(done.out.split())
    assert "a sensor at (1.000, 0.000, 0.000) m along y shows modes 1, 3, but does not distinguish 1 and 3" in " ".join(
        done.out.split()
    )


def test_a_structure_without_sensors(modalwatch: Commands, tmp_path: Path) -> None:
    (tmp_path / "bar.toml").write_text(cantilever())
    done = modalwatch("structure", tmp_path / "bar.toml", "--json", tmp_path / "bar.json", "--out", tmp_path / "x.png")
    assert done.code == 0, done.err
    found = json.loads((tmp_path / "bar.json").read_text())
    assert (found["channels"], set(found["seen"])) == ([], {0.0})
    assert found["auto_mac"][0][0] is None
    assert found["body"] is None
    assert "expected at least two sensors that measure three modes" in " ".join(done.out.split())
    assert (tmp_path / "x.png").stat().st_size > 10_000


def test_invalid_structure_requests_are_refused(modalwatch: Commands, tmp_path: Path) -> None:
    good, free, bad = tmp_path / "good.toml", tmp_path / "free.toml", tmp_path / "bad.toml"
    good.write_text(cantilever((1.0, "y")))
    free.write_text(CANTILEVER.split("[[support]]")[0])
    bad.write_text(cantilever((1.5, "y")))
    for arguments, says in (
        ((tmp_path / "none.toml",), (tmp_path / "none.toml", "cannot be read")),
        ((free,), (free, "the stiffness is singular: a support or a member is missing")),
        ((bad,), (bad, "sensor s0: [1.5, 0.0, 0.0] lies on no member")),
        ((good, "--out", tmp_path / "none" / "x.png"), ("--out: ", tmp_path / "none" / "x.png", "cannot be written")),
        ((good, "--out", tmp_path / "x.sketch"), ("--out: ", tmp_path / "x.sketch", "cannot be written")),
        ((good, "--target-mass", "50"), ("--target-mass: expected a mass in kg or g, such as 50g, found '50'",)),
        ((good, "--target-mass", "50mm"), ("--target-mass: expected a mass",)),
        ((good, "--target-mass", "1.2.3g"), ("--target-mass: expected a mass",)),
        ((good, "--target-mass", "50g", "--tolerance", "5g"), ("--tolerance: expected a length in m or mm",)),
        ((good, "--record-seconds", 0), ("--record-seconds: expected a positive number, found 0",)),
        ((good, "--damping", 2), ("--damping: expected a ratio",)),
        ((good, "--target-mass", "50g"), (good, "expected at least two sensors that measure three modes")),
        ((good, "--json", tmp_path / "none" / "x.json"), ("--json: ", tmp_path / "none" / "x.json", "cannot be wri")),
    ):
        assert_refused(modalwatch("structure", *arguments), *says)


@pytest.mark.usefixtures("undrawn")
def test_sensors_are_compared_with_channels(modalwatch: Commands, tmp_path: Path) -> None:
    bar, site = tmp_path / "bar.toml", tmp_path / "site.toml"
    bar.write_text(cantilever((0.5, "y"), (1.0, "y"), (1.0, "z"), (1.0, "y")))

    def with_channels(**channels: str) -> None:
        named = ", ".join(f'{axis} = "{name}"' for axis, name in channels.items())
        device = f'name = "d"\ndriver = "epson-uart"\nport = "/dev/none"\nrate = 1000\nchannels = {{{named}}}\n'
        site.write_text(f'structure = "bar.toml"\n[[device]]\n{device}')

    with_channels(x="s0", y="s1", z="typo")
    done = modalwatch("structure", bar, "--channels", site, "--modes", 3)
    assert done.code == 1
    assert f"{site}: no sensor of the structure for typo" in done.out
    assert f"{site}: no channel for s2, s3, left out above" in done.out
    assert "1 member, 120 degrees of freedom, 2 sensors" in done.out
    bar.write_text(cantilever((0.5, "y"), (1.0, "y"), (1.0, "y")))
    with_channels(x="s0", y="s1", z="s2")
    done = modalwatch("structure", bar, "--channels", site, "--modes", 3)
    assert done.code == 0, done.err
    assert f"{site}: its 3 channels are the structure's sensors" in done.out
    assert f"picture: {bar.with_suffix('.png')} exists and was not drawn again: --force replaces it" in done.out
    assert "up to 400 Hz" in done.out
    site.write_text(site.read_text(encoding="utf-8").replace("rate = 1000", "rate = 200"), encoding="utf-8")
    done = modalwatch("structure", bar, "--channels", site, "--modes", 3)
    assert "up to 80 Hz" in done.out
    assert "--highest says" not in done.out
    with_channels(x="s0", y="s1")
    slower = site.read_text(encoding="utf-8")
    other = 'name = "e"\ndriver = "epson-uart"\nport = "/dev/e"\nrate = 100\nchannels = {x = "s2"}\n'
    slower += f"[[device]]\n{other}"
    log = tmp_path / "log.mcap"
    for more, heard in (("", 40), ("[analysis]\nband = [1, 30]\n", 30)):  # of the slower device; of its band
        site.write_text(slower + more, encoding="utf-8")
        writer = McapWriter(log, {"structure.toml": bar.read_text(), "site.toml": site.read_text(encoding="utf-8")})
        writer.close()
        for of in (site, log):
            done = modalwatch("structure", bar, "--channels", of, "--modes", 3)
            assert f"up to {heard} Hz" in done.out
        log.unlink()
    assert "s1 and s2 measure the same motion" in done.out
    assert_refused(modalwatch("structure", bar, "--channels", tmp_path / "none.toml"), "none.toml: cannot be read")


@pytest.mark.usefixtures("undrawn")
def test_record_is_as_long_as_the_log_of_the_channels(modalwatch: Commands, tmp_path: Path) -> None:
    bar, table, log = tmp_path / "bar.toml", tmp_path / "log.csv", tmp_path / "log.mcap"
    bar.write_text(cantilever((0.5, "y"), (1.0, "y")))
    rows = "".join(f"{i / 1000:.3f},{i % 7},{i % 5}\n" for i in range(30_000))
    table.write_text("t,s0,s1\n" + rows)
    assert modalwatch("import", table, "-o", log).code == 0
    for options, title in (((), "10 min before and after"), (("--channels", log), "30 s before and after")):
        assert title in modalwatch("structure", bar, "--modes", 3, *options).out
    pausing, paused = tmp_path / "pausing.csv", tmp_path / "pausing.mcap"
    rows = "".join(f"{i / 1000 + 3600 * (i >= 15_000):.3f},{i % 7},{i % 5}\n" for i in range(30_000))
    pausing.write_text("t,s0,s1\n" + rows)
    assert modalwatch("import", pausing, "-o", paused).code == 0
    assert "30 s before and after" in modalwatch("structure", bar, "--modes", 3, "--channels", paused).out
    done = modalwatch("structure", bar, "--channels", log, "--record-seconds", 1200)
    assert "20 min before and after" in done.out


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("210e9", "210e3", "material steel: waves would run through it at 5.2 m/s (steel: 5200); is"),
        ("7850", "7.85", "material steel: waves would run through it at 1.6e+05 m/s (steel: 5200); is"),
        ("[8e-10, 4e-10]", "[800, 400]", "section bar: its radius of gyration is 2.83e+03 m, the whole structure 1 m"),
    ],
)
def test_values_in_implausible_units_are_noted(old: str, new: str, says: str) -> None:
    assert not odd_units(parse_structure(CANTILEVER))
    (note,) = odd_units(parse_structure(CANTILEVER.replace(old, new)))
    assert note.startswith(says)


@pytest.mark.usefixtures("undrawn")
def test_structure_command_prints_note_on_implausible_units(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "bar.toml"
    path.write_text(cantilever((1.0, "y"), (0.5, "z")).replace("210e9", "210e3"), encoding="utf-8")
    done = modalwatch("structure", path)
    assert (done.code, done.err) == (0, "")
    assert "\nnote: material steel: waves would run through it at 5.2 m/s" in done.out


def test_lengths_in_millimetres_are_noted() -> None:
    """A bar of 3 m and 1 cm2 has 2.4 kg, and 1e9 times as much if its millimetres are read as metres."""
    text = CANTILEVER.replace("1e-4", "100").replace("[8e-10, 4e-10]", "[800, 400]").replace("1e-9", "1000")
    (note,) = odd_units(parse_structure(text.replace("[1, 0, 0]", "[3000, 0, 0]")))
    assert note == "the members weigh 2.4e+09 kg, and the structure is 3e+03 m long; are lengths in m?"


@pytest.mark.usefixtures("undrawn")
def test_member_that_no_mode_moves_detects_no_mass(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "bar.toml"
    plinth = """
[[member]]
name = "plinth"
from = [0.0, 0.0, 0.0]
to = [-0.05, 0.0, 0.0]
material = "steel"
section = "bar"
elements = 1
[[support]]
at = [-0.05, 0.0, 0.0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
"""
    path.write_text(cantilever((1.0, "y"), (0.5, "z")) + plinth, encoding="utf-8")
    done = modalwatch("structure", path)
    assert (done.code, done.err) == (0, "")
    (row,) = (line.split() for line in done.out.splitlines() if line.startswith("  plinth"))
    assert row == ["plinth", "none", "-", "none", "none", "0.00", "to", "0.05"]


def test_parameters_are_listed_with_their_sensitivities(tmp_path: Path, modalwatch: Commands) -> None:
    """A cantilever's frequency goes with the square root of E: half of the 3 % that the prior allows."""
    file, out = tmp_path / "bar.toml", tmp_path / "bar.json"
    file.write_text(cantilever((1.0, "z")), encoding="utf-8")
    done = modalwatch("structure", file, "--parameters", "--modes", 4, "--json", out)
    assert done.code == 0
    assert not file.with_suffix(".png").exists()  # that of an earlier call is kept
    assert "steel.E" in done.out
    assert "support 0.rz" in done.out
    listed = {entry["name"]: entry for entry in json.loads(out.read_text(encoding="utf-8"))["parameters"]}
    np.testing.assert_allclose(listed["steel.E"]["frequency_change"], -0.015, rtol=1e-4)
    assert listed["steel.E"]["file"] == 210e9
    assert listed["support 0.ry"]["file"] is None


def test_wrong_units_are_stated_before_what_they_lead_to(modalwatch: Commands, tmp_path: Path) -> None:
    """A box of 18 m on feet that yield: its stiffness is beyond the digits of a number."""
    file = tmp_path / "portal.toml"
    size = (
        "--height",
        1,
        "--length",
        1,
        "--foot-stiffness",
        2e3,
        "--section",
        "box:15,18,1.5,0",
        "--beam-section",
        "box:0.015,0.018,0.0015,0",
    )
    done = modalwatch("new", "structure", "portal", *size, "-o", file)
    odd = "section main: its radius of gyration is 6.6 m, the whole structure 1 m long; is it in m, m2, m4?"
    assert f"note: {odd}" in done.err + done.out
    assert_refused(modalwatch("structure", file), f"{file}: {odd}; portal: it can move without deforming")


def test_file_that_is_no_structure_is_refused(modalwatch: Commands, tmp_path: Path) -> None:
    log, table = tmp_path / "log.mcap", tmp_path / "table.csv"
    table.write_text("t,s0\n" + "".join(f"{i / 100:.2f},{i % 7}\n" for i in range(500)))
    assert modalwatch("import", table, "-o", log).code == 0
    assert_refused(modalwatch("structure", log), f"{log}: expected a structure file, found no text in UTF-8")
    assert_refused(modalwatch("import", log, "-o", tmp_path / "b.mcap"), f"DATA: {log} is a log already")
    (tmp_path / "ros.mcap").write_bytes(bytes(200))
    for foreign, text in ((tmp_path / "none.mcap", "cannot be read"), (tmp_path / "ros.mcap", "is not an MCAP log")):
        assert_refused(modalwatch("import", foreign, "-o", tmp_path / "b.mcap"), f"{foreign}: {text}")
    missing = f"{tmp_path / 'none.toml'}: cannot be read: No such file or directory\n"
    assert_refused(modalwatch("structure", tmp_path / "none.toml"), missing)
    history = tmp_path / "none.db"
    assert_refused(modalwatch("history", history), f"found '{history}', which does not exist")
