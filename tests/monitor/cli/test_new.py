"""New structure and site files can be used as they are written."""

from pathlib import Path

import pytest

from monitor.settings import load_settings
from tests.support.monitor.cli import Commands, assert_refused
from updater import load_structure
from updater.fe import build_model

PORTAL = ("portal", "--height", 2, "--length", 3, "--section", "box:0.06,0.04,0.003")


@pytest.mark.parametrize(
    ("arguments", "n_members", "n_sensors"),
    [
        (PORTAL, 3, 12),
        ((*PORTAL, "--pinned", "--beam-section", "circle:0.02", "--sensors", 1), 3, 6),
        (("cantilever", "--height", 1.2, "--section", "rectangle:0.05,0.005", "--sensors", 3), 1, 6),
        (("beam", "--length", 4, "--section", "i:0.055,0.1,0.0041,0.0057", "--material", "concrete"), 1, 4),
        (("storeys", "--storeys", 3, "--height", 0.5, "--length", 0.8, "--section", "tube:0.04,0.003"), 5, 24),
        (("t-frame", "--height", 1.48, "--length", 0.8, "--section", "box:0.04,0.04,0.003"), 2, 8),
    ],
)
def test_structure_of_each_kind_has_a_model(
    modalwatch: Commands, tmp_path: Path, arguments: tuple[object, ...], n_members: int, n_sensors: int
) -> None:
    path = tmp_path / "frame.toml"
    done = modalwatch("new", "structure", *arguments, "-o", path)
    assert (done.code, done.err) == (0, "")
    found = load_structure(path)
    assert (len(found.member), len(found.sensor)) == (n_members, n_sensors)
    assert len({sensor.channel for sensor in found.sensor}) == n_sensors
    build_model(found)  # refuses a mechanism


def test_structure_has_given_sensors_and_corner_radius(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "frame.toml"
    places = ("--sensors-at", "left post:1.2", "--sensors-at", "beam:0.8,3", "--sensors", 1)
    assert modalwatch("new", "structure", *PORTAL, *places, "-o", path).code == 0
    found = load_structure(path)
    at = {sensor.channel: sensor.at for sensor in found.sensor}
    assert at["left_post_1_x"] == (0.0, 0.0, 1.2)
    assert (at["beam_1_z"], at["beam_2_z"]) == ((0.8, 0.0, 2.0), (3.0, 0.0, 2.0))
    assert at["right_post_1_y"] == (3.0, 0.0, 1.0)
    assert "corner_radius = 0.006 " in path.read_text(encoding="utf-8")
    assert modalwatch("new", "structure", *PORTAL[:-1], "box:0.06,0.04,0.003,0.005", "-o", path, "--force").code == 0
    assert "corner_radius = 0.005 " in path.read_text(encoding="utf-8")


def test_structure_has_listed_sensors(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "frame.toml"
    sensors = ("--sensor", "A=1=left post:1.2:x", "--sensor", "up [g]=beam:3:-z", "--sensor-mass", 0.1)
    assert modalwatch("new", "structure", *PORTAL, *sensors, "-o", path).code == 0
    found = load_structure(path)
    assert [(s.channel, s.at, s.direction) for s in found.sensor] == [
        ("A=1", (0.0, 0.0, 1.2), (1.0, 0.0, 0.0)),
        ("up [g]", (3.0, 0.0, 2.0), (0.0, 0.0, -1.0)),
    ]
    assert [body.at for body in found.body] == [(0.0, 0.0, 1.2), (3.0, 0.0, 2.0)]


def test_structure_has_channels_of_a_log_and_masses_of_sensors(modalwatch: Commands, tmp_path: Path) -> None:
    table, log, path = tmp_path / "before.csv", tmp_path / "before.mcap", tmp_path / "frame.toml"
    head = 'time,foot x,"the ""top""",mid_x,mid_y'
    rows = "\n".join(f"{k / 100},1,2,3,{k % 7}" for k in range(300))
    table.write_text(f"{head}\n{rows}\n", encoding="utf-8")
    assert modalwatch("import", table, "-o", log).code == 0
    cantilever = "new", "structure", "cantilever", "--height", 1, "--section", "circle:0.02", "-o", path
    done = modalwatch(*cantilever, "--channels", log, "--sensor-mass", 0.02)
    assert (done.code, done.err) == (0, "")
    found = load_structure(path)
    at = [(0.0, 0.0, 0.5), (0.0, 0.0, 1.0)]
    assert [(s.channel, s.at, s.direction) for s in found.sensor] == [
        ("foot x", at[0], (1, 0, 0)),
        ('the "top"', at[0], (0, 1, 0)),
        ("mid_x", at[1], (1, 0, 0)),
        ("mid_y", at[1], (0, 1, 0)),
    ]
    assert [(body.at, body.mass) for body in found.body] == [(place, 0.02) for place in at]
    more = modalwatch(*cantilever, "--force", "--channels", log, "--sensors", 3)
    assert_refused(more, "--channels: ", "before.mcap has 4 channels, expected 6: column_1_x, column_1_y, column_2_x")
    table.write_text(table.read_text(encoding="utf-8").replace("mid_x", "mid_z"), encoding="utf-8")
    assert modalwatch("import", table, "-o", log, "--force").code == 0
    wrong = modalwatch(*cantilever, "--force", "--channels", log)
    assert_refused(wrong, "channel 'mid_z' has the place of column_2_x; expected order: column_1_x, column_1_y,")


def test_site_has_a_device_per_place_and_its_channels(modalwatch: Commands, tmp_path: Path) -> None:
    structure, path = tmp_path / "frame.toml", tmp_path / "sites" / "site.toml"
    path.parent.mkdir()
    assert modalwatch("new", "structure", *PORTAL, "-o", structure).code == 0
    done = modalwatch("new", "site", structure, "-o", path, "--driver", "epson-can", "--can", "slcan:/dev/ttyACM0")
    assert (done.code, done.err) == (0, "")
    settings = load_settings(path)
    assert [device.name for device in settings.device][:2] == ["left_post_1", "left_post_2"]
    assert settings.structure == "../frame.toml"
    assert [device.can.node for device in settings.device if device.can] == [1, 2, 3, 4, 5, 6]
    channels = {(axis, channel) for device in settings.device for axis, channel in device.channels.items()}
    sensors = load_structure(structure).sensor
    assert channels == {("xyz"[[abs(d) for d in s.direction].index(1)], s.channel) for s in sensors}


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("portal", "--height", 2, "--section", "circle:0.1"), "--length: needed: length of the beam [m]"),
        (("arch",), "KIND: expected one of cantilever, beam, portal, storeys, t-frame, found 'arch'"),
        ((*PORTAL, "--storeys", 2), "--storeys: is no dimension of a portal"),
        (
            (*PORTAL[:-1], "box:0.1,0.1"),
            "--section: expected box:WIDTH,HEIGHT,THICKNESS[,CORNER_RADIUS] in m, found",
        ),
        ((*PORTAL[:-1], "box:0.1,0.1,0.2"), "thickness"),
        ((*PORTAL, "--sensors-at", "left post"), "--sensors-at: expected MEMBER:DISTANCE,.. in m, found 'left post'"),
        ((*PORTAL, "--sensors-at", "post:1"), "--sensors-at: no member is named 'post'; there are left post, right"),
        ((*PORTAL, "--sensor", "A1=beam:1"), "--sensor: expected CHANNEL=MEMBER:DISTANCE:AXIS, found 'A1=beam:1'"),
        ((*PORTAL, "--sensor", "A1=post:1:x"), "--sensor: A1=post:1:x: no member is named 'post'; there are left post"),
        ((*PORTAL, "--sensor", "A1=beam:3.5:z"), "--sensor: beam: expected distances from 0 to 3 m, found 3.5"),
        ((*PORTAL, "--sensor", "A1=beam:1:z", "--sensors-at", "beam:1"), "--sensor: expected neither --sensors-at nor"),
        ((*PORTAL, "--sensors-at", "beam:3.5"), "--sensors-at: beam: expected distances from 0 to 3 m, found 3.5"),
        (("cantilever", "--height", -1, "--section", "circle:0.1"), "--height: expected a positive number, found -1"),
        (("cantilever", "--height", 1, "--section", "circle:0.1", "--pinned"), "--pinned: a cantilever needs fixed"),
        ((*PORTAL, "--pinned", "--foot-stiffness", 2e3), "--pinned: expected no --foot-stiffness with it"),
        ((*PORTAL, "--foot-stiffness", 0), "--foot-stiffness: expected a positive number, found 0"),
    ],
)
def test_invalid_structures_are_refused(
    modalwatch: Commands, tmp_path: Path, arguments: tuple[object, ...], expected: str
) -> None:
    path = tmp_path / "frame.toml"
    assert_refused(modalwatch("new", "structure", *arguments, "-o", path), expected)
    assert not path.exists()


def test_existing_file_is_replaced_only_by_force(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "frame.toml"
    path.write_text("mine")
    assert_refused(modalwatch("new", "structure", *PORTAL, "-o", path), "frame.toml exists", "--force")
    assert path.read_text() == "mine"
    assert modalwatch("new", "structure", *PORTAL, "-o", path, "--force").code == 0
    again = modalwatch("new", "site", path, "-o", path, "--driver", "epson-can", "--can", "slcan:/dev/ttyACM0")
    assert_refused(again, "frame.toml exists")


def test_missing_port_names_its_place(modalwatch: Commands, tmp_path: Path) -> None:
    structure = tmp_path / "frame.toml"
    assert modalwatch("new", "structure", *PORTAL, "-o", structure).code == 0
    done = modalwatch("new", "site", structure, "-o", tmp_path / "s.toml", "--driver", "epson-uart", "--port", "a")
    assert_refused(done, "--port: needed: serial port of device left_post_2 at [0, 0, 1.3333] m")


def test_driver_of_a_log_is_refused_with_the_command_for_logs(modalwatch: Commands, tmp_path: Path) -> None:
    structure, path = tmp_path / "frame.toml", tmp_path / "s.toml"
    assert modalwatch("new", "structure", *PORTAL, "-o", structure).code == 0
    done = modalwatch("new", "site", structure, "-o", path, "--driver", "replay")
    named = f"`modalwatch import FILES -o run.mcap --structure {structure} --new-site {path}`"
    assert_refused(done, "--driver: replay reads a log", named)
    assert not path.exists()


CALCULIX = Path(__file__).parents[2] / "updater" / "fe" / "external" / "calculix"
STRIP = (CALCULIX / "strip.sti", CALCULIX / "strip.mas", "--nodes", CALCULIX / "strip.inp")


def test_external_structure_has_the_matrices_of_the_other_program(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "strip.toml"
    done = modalwatch("new", "external", *STRIP, "--doubled", f"root={CALCULIX / 'doubled.sti'}", "-o", path)
    assert (done.code, done.err) == (0, "")
    assert "72 degrees of freedom, 32 nodes, 10 faces, 1 groups, 8 members" in " ".join(done.out.split())
    sensor = '\n[[sensor]]\nchannel = "a"\nat = [0.22, 0.04, 0.01]\ndirection = [0, 0, 1]\n'
    path.write_text(path.read_text(encoding="utf-8") + sensor, encoding="utf-8")
    model = build_model(load_structure(path), mass="consistent")
    assert model.modes(1).frequency[0] == pytest.approx(104.45, rel=1e-4)  # modes.dat of CalculiX
    assert list(model.groups) == ["root"]
    assert model.sensor_rows.sum() == pytest.approx(1.0)  # shares of the corners of a face


def test_names_with_quotes_are_written_as_they_are(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / 'a "strip".toml'
    done = modalwatch("new", "external", *STRIP, "--doubled", f'ro"ot={CALCULIX / "doubled.sti"}', "-o", path)
    assert (done.code, done.err) == (0, "")
    assert list(build_model(load_structure(path)).groups) == ['ro"ot']


def test_structure_file_and_matrices_are_two_files(modalwatch: Commands, tmp_path: Path) -> None:
    done = modalwatch("new", "external", *STRIP, "-o", tmp_path / "strip.npz")
    assert_refused(done, "--out: expected the structure file, such as")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--group", "root"), "--group: expected NAME=FILE, found 'root'"),
        (("--group", "a=x", "--group", "a=y"), "--group: the group 'a' is given twice"),
        (("--group", "a=x", "--doubled", "a=y"), "--doubled: the group 'a' is given by --group too"),
        (("--rows", "none.dof"), "none.dof: cannot be read"),
        (("--file-unit", "inch"), "--file-unit: expected"),
    ],
)
def test_external_structure_is_refused_with_the_option(
    modalwatch: Commands, tmp_path: Path, arguments: tuple[object, ...], expected: str
) -> None:
    done = modalwatch("new", "external", *STRIP, *arguments, "-o", tmp_path / "strip.toml")
    assert_refused(done, expected)
    assert not list(tmp_path.iterdir())


def test_existing_matrices_are_kept_without_force(modalwatch: Commands, tmp_path: Path) -> None:
    (tmp_path / "strip.npz").write_bytes(b"own")
    done = modalwatch("new", "external", *STRIP, "-o", tmp_path / "strip.toml")
    assert_refused(done, "--out:")
    assert [path.name for path in tmp_path.iterdir()] == ["strip.npz"]
    assert (tmp_path / "strip.npz").read_bytes() == b"own"
    assert modalwatch("new", "external", *STRIP, "-o", tmp_path / "strip.toml", "--force").code == 0
