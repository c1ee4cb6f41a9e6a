"""Channels and modes in the viewer: spectra, spectrogram, figures of channels, auto-MAC, shapes of windows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq import Channel, Recording
from monitor.results.run_results import find_mode
from monitor.results.windows import ReferenceMode
from monitor.views.geometry import RIB, Geometry
from monitor.views.viewer import write_recording
from monitor.views.viewer.modes.mac_matrix import auto_mac
from monitor.views.viewer.modes.shapes import ribs_of
from monitor.views.viewer.signals.channels import channels_card
from monitor.views.viewer.signals.spectra import channel_spectra
from monitor.views.viewer.signals.spectrogram import spectrogram
from tests.support.monitor import results as made
from tests.support.monitor.rrd_reader import Rrd

SITE = made.Site()
RUN = made.whole_run(SITE, n_learning=3, n_before=1, n_after=2)
RATE = 250.0


def sine(*, amplitude: float, frequency: float, offset: float) -> Recording:
    time = np.arange(round(10 * RATE)) / RATE
    data = np.column_stack([offset + amplitude * np.sin(2 * np.pi * frequency * time), np.full(len(time), np.nan)])
    channels = tuple(Channel(name=name, device="d", axis=i) for i, name in enumerate("ab"))
    return Recording(channels=channels, data=data, rate=RATE, start=0)


def test_spectral_density_of_a_sine_has_its_power_at_its_frequency() -> None:
    frequency, level = channel_spectra(sine(amplitude=0.2, frequency=20.0, offset=3.0))
    density = 10 ** (level[:, 0] / 10)
    assert frequency[np.argmax(density)] == 20.0
    power = density.sum() * (frequency[1] - frequency[0])
    assert power == pytest.approx(0.2**2 / 2, rel=1e-3)  # the offset is no part of it


def test_table_of_channels_has_offset_rms_and_peak() -> None:
    lines = channels_card(sine(amplitude=0.2, frequency=20.0, offset=3.0)).splitlines()
    assert lines[2] == "| a | +3.00e+03 | 141 | 200 | 0.0 |"  # mm/s2: 200 / sqrt(2), and 190 at the next scan
    assert lines[3] == "| b | | | | 100.0 |"


def test_ends_that_no_channel_has_are_not_missing() -> None:
    """Filters have no output there; a gap within is missing."""
    signals = sine(amplitude=0.2, frequency=20.0, offset=3.0)
    data = signals.data.copy()
    data[:10], data[-10:], data[50:60, 0] = np.nan, np.nan, np.nan
    missing = float(channels_card(replace(signals, data=data)).splitlines()[2].split("|")[-2])
    assert missing == pytest.approx(100 * 10 / (len(data) - 20), abs=0.05)


def test_spectrogram_has_the_first_singular_value_of_each_window() -> None:
    run = made.run_results(RUN)
    level, highest = spectrogram(run)
    assert level.shape[1] == len(run.spectra)
    assert highest == pytest.approx(1.12 * run.reference.modes[-1].frequency)  # type: ignore[union-attr]
    grid = np.linspace(0, highest, len(level))
    for column, (_, spectrum) in zip(level.T, run.spectra, strict=True):
        expected = np.interp(grid, spectrum.frequency, spectrum.singular_values[0])
        np.testing.assert_allclose(column, expected)


def test_auto_mac_is_one_for_each_mode_with_itself() -> None:
    mac = auto_mac(RUN["reference"])
    np.testing.assert_allclose(np.diag(mac), 1.0)
    np.testing.assert_allclose(mac, mac.T)
    shapes = SITE.channel_shape
    expected = (shapes @ shapes.T) ** 2 / np.outer((shapes**2).sum(1), (shapes**2).sum(1))
    np.testing.assert_allclose(mac, expected, atol=2e-2)  # nodes are up to half an element from the sensors


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> Rrd:
    path = tmp_path_factory.mktemp("channels") / "run.rrd"
    write_recording(path, made.run_results(RUN))
    return Rrd(path)


def test_shape_of_a_window_is_drawn_at_the_sensors_whatever_its_sign_and_scale(rrd: Rrd, tmp_path: Path) -> None:
    def turned(shape: list[float]) -> list[float]:
        return [-2.0 * value for value in shape]

    windows = [
        w.model_copy(update={"modes": [m.model_copy(update={"shape": turned(m.shape)}) for m in w.modes]})
        for w in RUN["windows"]
    ]
    write_recording(tmp_path / "run.rrd", made.run_results(RUN | {"windows": windows}))
    for entity in ("/modes/mode_1/sensors", "/modes/mode_6/sensors"):
        times, places = rrd.rows(entity, "Points3D:positions")
        assert times.tolist() == [w.end for w in RUN["windows"] if w.phase != "learning"]
        _, again = Rrd(tmp_path / "run.rrd").rows(entity, "Points3D:positions")
        np.testing.assert_allclose(again[-1], places[-1], atol=1e-6)
        assert len(places[-1]) == len({place for place, _ in RUN["reference"].sensors.values()})
    line = np.concatenate(rrd.rows("/modes/mode_1/shape", "LineStrips3D:strips")[1][0])
    rows = rrd.rows("/modes/mode_1/sensors", "Points3D:positions")[1]
    assert rows[0] == []  # this window does not show the mode
    at = np.array(rows[1])
    distance = np.linalg.norm(line[:, None] - at[None], axis=2).min(axis=0)
    assert distance.max() < 0.02 * Geometry(RUN["reference"]).size  # before the change the points are on the line
    found = find_mode(RUN["windows"][-1], 2)
    label = rrd.rows("/modes/mode_2/now", "Points3D:labels")[1][-1]
    assert found is not None
    assert label[0].startswith(f"now: {found.frequency:.2f} Hz, {100 * found.damping:.2f} %\nMAC ")


def test_ribs_turn_with_the_torsion_of_their_member() -> None:
    reference = RUN["reference"]
    geometry, still = Geometry(reference), [(0.0, 0.0, 0.0)] * len(reference.nodes)
    turning = [(0.0, 0.0, 1.0 if at[2] > 0 else 0.0) for at in reference.nodes]  # about the column's axis
    mode = reference.modes[0].model_copy(update={"displacement": still, "rotation": turning})
    at_rest, turned = np.array(ribs_of(geometry, mode, [0.0, 1.0]))
    np.testing.assert_allclose(np.linalg.norm(at_rest[:, 1] - at_rest[:, 0], axis=1), 2 * RIB * geometry.size)
    np.testing.assert_allclose(turned.mean(axis=1), at_rest.mean(axis=1))
    arms = (at_rest[:, 1] - at_rest[:, 0]) / 2
    angle = 0.12 * geometry.size  # a displacement of 1 is drawn so long
    moved = np.cross([0.0, 0.0, angle], arms) * (at_rest.mean(axis=1)[:, 2] > 1e-6)[:, None]
    np.testing.assert_allclose((turned - at_rest)[:, 1], moved, atol=1e-12)
    assert ribs_of(geometry, mode.model_copy(update={"rotation": []}), [1.0]) == [[]]
    assert ReferenceMode.model_fields["rotation"].default == []


def test_learning_windows_are_drawn_near_the_mode_they_belong_to(rrd: Rrd) -> None:
    run = made.run_results(RUN)
    learning = [w for w in RUN["windows"] if w.phase == "learning"]
    for number in run.tracks:
        assert [w for w, _ in run.learned_near(number)] == learning
        times, values = rrd.rows(f"/trend/frequency/mode_{number}/learning", "Scalars:scalars")
        assert times.tolist() == [w.end for w in learning]
        base = next(m.frequency for m in RUN["reference"].modes if m.id == number)
        np.testing.assert_allclose(np.concatenate(values), base, rtol=5e-3)
    bare = replace(run, reference=None)
    assert bare.learned_near(1) == []
