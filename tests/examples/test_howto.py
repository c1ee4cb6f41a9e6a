"""The pages of "How-to": their commands run, in their order, on small files of the names that the pages use."""

import itertools
import shlex
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import can
import numpy as np
import pytest
import pyuff

from daq import Channel, Recording, export_recording, write_recording
from monitor.outputs.history import HistoryStore
from tests.contracts.test_pages import commands_of
from tests.support.daq.responses import frequency_response
from tests.support.daq.tower_file import write_tower
from tests.support.monitor import answers
from tests.support.monitor.cli import Commands
from tests.support.monitor.history import run_events, sqlite_url
from updater import Body, build_model, parse_structure, t_structure_toml
from updater.fe import Ambient, AmbientResponse

ROOT = Path(__file__).parents[2]
HOWTO = ROOT / "docs" / "howto"
RATE, SECONDS, SEED = 64.0, 450, 5  # Hz, s
MASS = 8.0  # of the body that was added [kg]
SOFTER = 0.05  # of the stiffness of the whole mast
#: commands that are parsed only (tests/contracts/test_pages.py), and what they need
NOT_RUN = {
    "accept": "a running monitor",
    "acknowledge": "a running monitor",
    "prove": "a running monitor",
    "run": "devices",
    "install-service": "the service manager of the system",
    "new site structure.toml": "a terminal, for its questions; see tests/monitor/cli/test_new.py",
    "fleet": "a PostgreSQL server",
    "diagnose structure.toml modes.csv": "a table of modes; see tests/monitor/analysis/test_modal_table.py",
    "view rerun+http": "a running monitor",
    "new external job_STIF2.mtx": "files of Abaqus; see tests/updater/fe/external/test_programs.py",
    "new external stiffness.matrix": "files of Ansys; see tests/updater/fe/external/test_programs.py",
    "new external kgg.op4": "files of Nastran; see tests/updater/fe/external/test_programs.py",
    "history postgresql": "a PostgreSQL server",
    "report monitored.mcap": "days of measurements; see tests/monitor/views/report",
    "view monitored.mcap": "days of measurements; see tests/monitor/views/report",
    "reanalyse s3": "object storage and a scheduler; see tests/monitor/archive/test_object_storage.py",
}
#: beginnings of commands that take seconds each
SLOW = (
    "bodies", "diagnose", "replay", "reanalyse /data/archive -o results", "identify run.mcap", "log expand",
    "structure t_structure.toml --record", "structure structure.toml --target", "structure examples", "view",
    "report watched", "report run.mcap --pdf", "identify measured.mcap --structure", "identify measured.mcap --picture",
    "identify before.mcap", "identify setup_1", "identify days.mcap", "response",
)  # fmt: skip
#: exit codes of commands that do not end with 0: a person is needed
ALARM = {"replay run.mcap": 1, "reanalyse /data/archive -o results": 1, "bodies": 1}

MAST = """
name = "mast"
[mesh]
element_length = 0.5
[material.steel]
youngs_modulus = 210e9
poisson_ratio = 0.3
density = 7850
[section.box]
shape = "box"
width = 0.10
height = 0.12
thickness = 0.004
[[member]]
name = "mast"
from = [0, 0, 0]
to = [0, 0, 8.0]
material = "steel"
section = "box"
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
""" + "".join(
    f'[[sensor]]\nchannel = "{name}_{axis}"\nat = [0, 0, {place}]\ndirection = {way}\n'
    for name, place in (("top", 8.0), ("mid", 5.0), ("low", 3.0), ("deck", 6.5))
    for axis, way in (("x", [1, 0, 0]), ("y", [0, 1, 0]))
)


def recorded(
    seed: int, added: float = 0.0, seconds: float = SECONDS, known: float = 0.0, softer: float = 0.0
) -> Recording:
    """Return accelerations of the mast under ambient forces, with a body at 6 m and a known mass at 3.5 m.

    `softer` is the share of its stiffness that is lost throughout.
    """
    structure = parse_structure(MAST)
    lost = {
        name: steel.model_copy(
            update={key: getattr(steel, key) * (1 - softer) for key in ("youngs_modulus", "shear_modulus")}
        )
        for name, steel in structure.material.items()
    }
    structure = structure.model_copy(update={"material": lost})
    loaded = structure.with_bodies([Body(at=(0, 0, z), mass=mass) for z, mass in ((6.0, added), (3.5, known)) if mass])
    model = build_model(loaded, shear_flexible=True, mass="consistent")
    damping = np.full((model.modes(8).frequency < 0.49 * RATE).sum(), 0.006)
    points = tuple((0.0, 0.0, z) for z in (2.0, 4.5, 7.5) for _ in "xy")
    ambient = Ambient(points=points, axes=(0, 1) * 3, density=1e-4)
    response = AmbientResponse(model, model.sensor_rows, damping, ambient, rate=RATE, seed=seed)
    response.step(round(30 * RATE))
    data = response.step(round(seconds * RATE))
    data += 1e-3 * data.std() * np.random.default_rng(seed).standard_normal(data.shape)
    channels = tuple(
        Channel(name=name, device=f"logger-{k // 3}", axis=k % 3) for k, name in enumerate(structure.channels)
    )
    return Recording(channels=channels, data=data, rate=RATE, start=1_767_225_600 * 10**9 + seed * 10**12)


def log_of(
    seed: int,
    added: float = 0.0,
    seconds: float = SECONDS,
    places: tuple[str, ...] = ("top", "mid", "low", "deck"),
    known: float = 0.0,
    softer: float = 0.0,
) -> Callable[[Path], None]:
    """Return a function that writes a log of the sensors at some places."""

    def write(path: Path) -> None:
        whole = recorded(seed, added, seconds, known, softer)
        keep = [k for k, channel in enumerate(whole.channels) if channel.name.partition("_")[0] in places]
        part = replace(whole, channels=tuple(whole.channels[k] for k in keep), data=whole.data[:, keep])
        write_recording(path, part, {"structure.toml": MAST})

    return write


def text(content: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_text(content, encoding="utf-8")

    return write


def responses(added: float) -> Callable[[Path], None]:
    """Return a function that writes frequency responses of the mast to a force at its top along x and one along y."""

    def write(path: Path) -> None:
        structure = parse_structure(MAST)
        bodies = [Body(at=(0, 0, 6.0), mass=added)] if added else []
        model = build_model(structure.with_bodies(bodies), shear_flexible=True, mass="consistent")
        modes, line = model.modes(8), np.arange(1, 2400) * 0.025
        at = model.sensor_rows @ modes.shape
        ratio = line[:, None] / modes.frequency
        resonance = -(ratio**2) / (1 - ratio**2 + 2j * 0.008 * ratio)
        random = np.random.default_rng(SEED)
        sets = []
        for force, (k, name) in itertools.product((0, 1), enumerate(structure.channels)):
            found = np.einsum("lm,m->l", resonance, at[k] * at[force])
            noise = random.standard_normal(len(line)) + 1j * random.standard_normal(len(line))
            noisy = found + 0.005 * np.abs(found).mean() * noise
            sets.append(frequency_response(noisy, line, id1=name, rsp_node=0, rsp_dir=0, ref_node=force + 1))
        pyuff.UFF(str(path)).write_sets(sets, "overwrite")

    return write


def bus_messages() -> Iterator[can.Message]:
    """Yield 3 s of the sensor of examples/imu.dbc at 400 Hz: its counter and its scans."""
    for k in range(1200):
        for late, identifier, data in (
            (0.0, 6, f"{k:04X}"),
            (1e-4, 52, f"0100{256 - k % 256:04X}0100"),
        ):
            yield can.Message(
                timestamp=1_767_225_600 + k / 400 + late,
                arbitration_id=identifier,
                data=bytes.fromhex(data),
                is_extended_id=False,
            )


def bus(path: Path) -> None:
    with can.Logger(str(path)) as writer:
        for message in bus_messages():
            writer.on_message_received(message)


CAN_SITE = """structure = "t_structure.toml"
[[device]]
name = "imu"
driver = "can-dbc"
can = {interface = "slcan", channel = "/dev/none"}
rate = 400
channels = {x = "beam_left_y", z = "beam_left_z"}
[device.dbc]
file = "imu.dbc"
signals = {x = "accX", y = "accY", z = "accZ"}
counter = "Counter"
"""

SITE = """structure = "structure.toml"
state = "state"
[analysis]
window_seconds = 90
baseline_windows = 10
""" + "".join(
    f'[[device]]\nname = "{name}"\ndriver = "epson-uart"\nport = "/dev/none-{name}"\nrate = 50\n'
    f'channels = {{x = "{name}_x", y = "{name}_y"}}\n'
    for name in ("top", "mid", "low", "deck")
)


def history(path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    with HistoryStore(sqlite_url(path.parent)) as store:
        store.write(run_events())


def table(path: Path) -> None:
    """Write a minute of measurements."""
    export_recording(path, recorded(SEED, seconds=60))


def tables(path: Path) -> None:
    """Write three tables that follow each other."""
    path.mkdir()
    whole = recorded(SEED, seconds=60)
    for k, part in enumerate(np.split(whole.data, 3)):
        channels = tuple(Channel(name=c.name, device="logger", axis=i) for i, c in enumerate(whole.channels))
        start = whole.start + round(k * len(part) / RATE * 1e9)
        export_recording(path / f"{k}.csv", Recording(channels=channels, data=part, rate=RATE, start=start))


def universal(path: Path) -> None:
    """Write signals of nodes 12, 13, .. along x as a universal file, without a unit."""
    whole = recorded(SEED, seconds=100)
    t = np.arange(len(whole.data)) / RATE
    sets = [
        frequency_response(
            whole.data[:, k], t, func_type=1, rsp_node=12 + k, rsp_dir=1, ref_node=0, ref_dir=0, id1=channel.name,
            abscissa_spec_data_type=17, ordinate_spec_data_type=0, orddenom_spec_data_type=0,
        )
        for k, channel in enumerate(whole.channels)
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


def modes(path: Path) -> None:
    """Write hourly frequencies of three modes, which fall by 2 % after 44 hours."""
    random = np.random.default_rng(SEED)
    rows = ["time,f1 [Hz],f2,f3"]
    for hour in range(56):
        found = np.array([3.9, 5.0, 9.8]) * (1 - 0.02 * (hour >= 44)) * (1 + 0.001 * random.standard_normal(3))
        rows.append(f"1998-08-{1 + hour // 24:02d}T{hour % 24:02d}:00," + ",".join(f"{f:.4f}" for f in found))
    path.write_text("\n".join(rows), encoding="utf-8")


def folder_of(*names: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.mkdir()
        for name in names:
            MAKERS[name](path / name)

    return write


def watched(path: Path) -> None:
    shutil.copy(ROOT / "replay_data" / "t_frame_added_mass.mcap", path)


def calculix(path: Path) -> None:
    """Copy the files of a strip that CalculiX wrote."""
    for file in (ROOT / "tests" / "updater" / "fe" / "external" / "calculix").iterdir():
        shutil.copy(file, path.parent)


#: functions that write the files which pages name
MAKERS: dict[str, Callable[[Path], None]] = {
    "structure.toml": text(MAST),
    "SITE.toml": text(SITE),
    "site.toml": text(SITE),
    "t_structure.toml": text(t_structure_toml()),
    "before.mcap": log_of(SEED),
    "now.mcap": log_of(SEED + 1, MASS),
    "after.mcap": log_of(SEED + 1, MASS),
    "later.mcap": log_of(SEED + 2, MASS),
    "long.mcap": log_of(SEED + 3, seconds=1050.0),
    "repaired.mcap": log_of(SEED + 4),
    "reference.mcap": log_of(SEED, places=("top", "mid", "low")),
    "with_mass.mcap": log_of(SEED + 5, MASS, known=5.0),
    "softer.mcap": log_of(SEED + 6, softer=SOFTER),
    "softer_with_mass.mcap": log_of(SEED + 7, known=5.0, softer=SOFTER),
    "measured.mcap": log_of(SEED),
    "setup_1.mcap": log_of(SEED, seconds=100, places=("top", "mid")),
    "setup_2.mcap": log_of(SEED + 1, seconds=100, places=("top", "low")),
    "setup_3.mcap": log_of(SEED + 2, seconds=100, places=("top", "deck")),
    "run.mcap": watched,
    "demo-output": folder_of("run.mcap"),
    "archive": folder_of("run.mcap"),
    "measured.csv": table,
    "before.csv": table,
    "after.csv": table,
    "measured.uff": universal,
    "logger": tables,
    "before.uff": responses(0.0),
    "hammer.uff": write_tower,
    "after.uff": responses(MASS),
    "bus.log": bus,
    "bus.blf": bus,
    "imu.dbc": text((ROOT / "examples" / "imu.dbc").read_text(encoding="utf-8")),
    "examples": partial(shutil.copytree, ROOT / "examples"),
    "modes.csv": modes,
    "history.sqlite": history,
    "strip.sti": calculix,
    "strip.mas": calculix,
    "diagnosis.json": text(answers.diagnosis().model_dump_json()),
}


def arguments_of(line: str) -> list[str]:
    """Return the arguments of a command; what is at a place of the system is in the present folder."""
    words = shlex.split(line.partition(" > ")[0])[1:]
    words = [word.removeprefix("/data/") for word in words]
    return [str(one) for word in words for one in (sorted(Path().glob(word)) if "*" in word else [word])]


def needs(line: str) -> str | None:
    """Return what a command that is not run needs; None for one that is run."""
    command = line.removeprefix("modalwatch ")
    return next((why for start, why in NOT_RUN.items() if f"{command} ".startswith((f"{start} ", f"{start}:"))), None)


def is_slow(line: str) -> bool:
    command = line.removeprefix("modalwatch ")
    return command.startswith(SLOW) and "--dry-run" not in command


def codes_of(line: str) -> set[int]:
    """Return the exit codes that a command may end with."""
    command = line.removeprefix("modalwatch ")
    if "softer" in command:
        return {1}  # indistinguishable from heavier
    if command.startswith("diagnose") and "--reference" not in command:
        return {0, 1}  # without reference logs a body and a loss of stiffness may be indistinguishable here
    return {next((code for start, code in ALARM.items() if command.startswith(start) and is_slow(line)), 0)}


def provide(page: Path, lines: list[str]) -> None:
    """Write the files that commands read, into the present folder."""
    for line in lines:
        words = shlex.split(line)
        outputs = {after for option, after in itertools.pairwise(words) if option in OUTPUTS}
        for word in (word for word in words if word not in outputs):
            first = Path(word.partition("=")[0].removeprefix("/data/")).parts[0] if word.partition("=")[0] else ""
            if first in MAKERS and not Path(first).exists():
                MAKERS[first](Path(first))
    if page.name == "dbc.md":
        for name in ("imu.dbc", "t_structure.toml"):
            MAKERS[name](Path(name))
        Path("SITE.toml").write_text(CAN_SITE, encoding="utf-8")
    if any("SITE.toml" in line or "site.toml" in line for line in lines) and not Path("structure.toml").exists():
        MAKERS["structure.toml"](Path("structure.toml"))
    if page.name == "history.md":
        history(Path("state/history.sqlite"))
    if page.name == "bodies.md":
        Path("bodies.toml").write_text(BODIES, encoding="utf-8")
        Path("mast.toml").write_text(MAST, encoding="utf-8")


OUTPUTS = {"-o", "--out", "--json", "--csv", "--plot", "--pdf", "--picture", "--new-site"}
BODIES = """structure = "mast.toml"
[[body]]
name = "lamp"
mass = 60
change = "added"
[[record]]
at = [[0, 0, 6.0]]
before = [1.6, 1.9, 10.2, 11.8]
after = [1.5, 1.8, 9.9, 11.5]
"""


def runs() -> Iterator[object]:
    """Yield the pages that have commands to run, with slow ones and without."""
    for page in sorted(HOWTO.rglob("*.md")):
        lines = [line for line in commands_of(page) if needs(line) is None]
        for slow in (False, True):
            if any(is_slow(line) is slow for line in lines):
                name = f"{page.parent.name}/{page.stem}{' slow' * slow}"
                yield pytest.param(page, slow, id=name, marks=[pytest.mark.thorough] * slow)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("page", "slow"), list(runs()))
def test_commands_of_a_page_run(
    page: Path, slow: bool, modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    lines = [line for line in commands_of(page) if needs(line) is None and (slow or not is_slow(line))]
    provide(page, lines)
    for line in lines:
        words = arguments_of(line)
        for path in (Path(after) for option, after in itertools.pairwise(words) if option in {"-o", "--out"}):
            if path.is_file():
                path.unlink()  # of another command of the page
        done = modalwatch(*words)
        assert done.code in codes_of(line), f"{line}: {done}"


def test_few_commands_are_not_run() -> None:
    """Each of them needs what a test has not; a reason that no command has is removed from the table."""
    every = [line for page in HOWTO.rglob("*.md") for line in commands_of(page)]
    left_out = [line for line in every if needs(line)]
    assert len(left_out) < len(every) / 3
    assert {needs(line) for line in left_out} == set(NOT_RUN.values())
