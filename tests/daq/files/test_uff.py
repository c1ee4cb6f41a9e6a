from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from daq import DataError, read_data
from daq.files import differentiated, read_in_order
from daq.files.measurement_file import read_measured
from daq.files.options import DataOptions

RATE, N = 200.0, 400
SIGNALS = np.random.default_rng(1).standard_normal((N, 3))


def time_response(column: Any, node: int = 1, direction: int = 1, **other: Any) -> dict[str, Any]:
    fields: dict[str, Any] = {"binary": 0, "id1": "NONE", "rsp_ent_name": "NONE", "ordinate_spec_data_type": 12} | other
    return dict(
        pyuff.prepare_58(
            func_type=fields.pop("func_type", 1),
            rsp_node=node,
            rsp_dir=direction,
            ref_ent_name="NONE",
            ref_node=0,
            ref_dir=0,
            abscissa_spacing=1,
            abscissa_spec_data_type=17,
            orddenom_spec_data_type=0,
            data=column,
            x=np.arange(len(column)) / fields.pop("rate", RATE) + fields.pop("start", 0.0),
            **fields,
        )
    )


def universal(path: Path, *datasets: dict[str, Any]) -> Path:
    pyuff.UFF(str(path)).write_sets(list(datasets), "overwrite")
    return path


UNITS = {"type": 164, "units_code": 5, "length": 1000.0, "force": 1000.0, "temp": 1.0, "temp_offset": 273.15}  # mm


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # pyuff leaves a binary file that it writes open
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("suffix", [".uff", ".UNV"])
def test_time_responses_are_read_with_channel_names(tmp_path: Path, binary: int, suffix: str) -> None:
    places = ((12, 1), (12, -2), (7, 3))
    sets = [time_response(s, *p, binary=binary) for s, p in zip(SIGNALS.T, places, strict=True)]
    sets.insert(0, time_response(SIGNALS[:, 0], 12, 1, func_type=4))  # a function of another kind
    recording = read_data(universal(tmp_path / f"test{suffix}", *sets))
    assert [c.name for c in recording.channels] == ["12_x", "12_-y", "7_z"]
    assert recording.rate == pytest.approx(RATE, rel=1e-9)
    # text has twelve digits
    np.testing.assert_allclose(recording.data, SIGNALS, atol=1e-11)


def test_units_are_applied_to_chosen_columns(tmp_path: Path) -> None:
    sets = [time_response(s, 1 + k, rsp_ent_name="tower") for k, s in enumerate(SIGNALS.T)]
    path = universal(tmp_path / "test.uff", UNITS, *sets)
    recording = read_data(path, columns={"tower_3_x": "top", "tower_1_x": "foot"})
    assert [c.name for c in recording.channels] == ["foot", "top"]
    np.testing.assert_allclose(recording.data, SIGNALS[:, [0, 2]] / 1000, atol=1e-14)


@pytest.mark.parametrize(
    ("kind", "label", "converted", "factor", "used"),
    [
        (1, "mg", False, 9.80665e-3, True),
        (12, "mm/s2", False, 1e-3, True),
        (12, "mm/s2", True, 1e-3, True),  # as dataset 164 states
        (0, "m/s2", True, 1e-3, False),
        *((kind, label, False, 1.0, False) for kind in (0, 1, 12) for label in ("EU", "G's", "m/s2 rms")),
        *((12, label, False, 1.0, False) for label in ("V", "mm")),
    ],
)
def test_labels_are_used_if_they_are_units_of_the_data_type(
    tmp_path: Path, kind: int, label: str, converted: bool, factor: float, used: bool
) -> None:
    """Others are in a remark, and the data are taken as without a label."""
    response = time_response(SIGNALS[:, 0], ordinate_spec_data_type=kind, ordinate_axis_units_lab=label)
    found = read_measured(universal(tmp_path / "test.uff", *[UNITS] * converted, response), DataOptions())
    np.testing.assert_allclose(found.recording.data[:, 0], factor * SIGNALS[:, 0], rtol=1e-9, atol=1e-11)
    assert any("labels of units not used" in remark for remark in found.remarks) is not used


def test_channels_with_equal_nodes_are_named_by_id_line(tmp_path: Path) -> None:
    path = universal(tmp_path / "test.uff", *(time_response(s, 0, 0, id1=f"acc {k}") for k, s in enumerate(SIGNALS.T)))
    assert [c.name for c in read_data(path).channels] == ["acc 0", "acc 1", "acc 2"]


def test_channel_without_node_is_named_by_id_line(tmp_path: Path) -> None:
    assert [
        c.name for c in read_data(universal(tmp_path / "a.uff", time_response(SIGNALS[:, 0], 0, id1="top"))).channels
    ] == ["top"]
    assert [c.name for c in read_data(universal(tmp_path / "b.uff", time_response(SIGNALS[:, 0], 0))).channels] == [
        "0_x"
    ]


def test_velocities_are_differentiated_to_accelerations(tmp_path: Path) -> None:
    sets = time_response(SIGNALS[:, 0], 1, ordinate_spec_data_type=11), time_response(SIGNALS[:, 1], 2)
    found = read_data(universal(tmp_path / "test.uff", *sets))
    plain = read_data(universal(tmp_path / "plain.uff", *(s | {"ordinate_spec_data_type": 12} for s in sets)))
    np.testing.assert_array_equal(found.data, differentiated(plain, ["1_x"]).data)
    reported = read_data(tmp_path / "plain.uff", velocities=["1_x"])
    np.testing.assert_array_equal(reported.data, found.data)


@pytest.mark.parametrize(
    ("dates", "order", "start", "place"),
    [
        (("16-JUN-94 16:01:20", "16-JUN-94 16:01:21"), None, "1994-06-16T16:01:20", "dataset 1"),
        (("30-Jul-08 10:11:12", " 9-Jul-08 10:11:12"), None, "2008-07-09T10:11:12", "dataset 2"),
        (("NONE", "2026-01-31 12:00:00.5"), None, "2026-01-31T12:00:00", "dataset 2"),
        (("NONE", "31/01/2026"), None, "2026-01-31T00:00:00", "dataset 2"),
        (("02/01/2026 10:00:00", "NONE"), "dmy", "2026-01-02T10:00:00", "dataset 1"),
        (("02/01/2026 10:00:00", "NONE"), None, "1970-01-01T00:00:00", "dataset 1 not used"),
        (("run 3, 12 Hz", "NONE"), None, "1970-01-01T00:00:00", None),
    ],
)
def test_start_is_the_earliest_date_of_id_line_3(
    tmp_path: Path, dates: tuple[str, str], order: str | None, start: str, place: str | None
) -> None:
    sets = [time_response(SIGNALS[:, k], 1 + k, id3=date) for k, date in enumerate(dates)]
    path = universal(tmp_path / "test.uff", *sets)
    found = read_measured(path, DataOptions(date_order=order))
    assert str(np.datetime64(found.recording.start, "ns"))[:19] == start
    said = [remark for remark in found.remarks if "start" in remark]
    assert len(said) == (place is not None)
    assert place is None or f"ID line 3 of {place}" in said[0]
    assert found.dated == ("T00:00:00" not in start)
    assert not said or said[0].endswith("(no time of day: midnight)") == start.startswith("2026-01-31T00")
    given = read_measured(path, DataOptions(start=10**18, date_order=order))
    assert given.recording.start == 10**18
    assert not [remark for remark in given.remarks if "start" in remark]


def test_files_with_dates_follow_each_other(tmp_path: Path) -> None:
    """400 samples are 2 s: of the three seconds between the dates, the last one has no samples."""
    paths = [
        universal(tmp_path / f"{k}.uff", time_response(SIGNALS[:, 0], id3=f"31-Jan-26 12:00:0{3 * k}")) for k in (1, 0)
    ]
    first, second = (part.recording for part in read_in_order(paths, DataOptions()))
    assert second.start - first.end == 10**9


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (time_response(SIGNALS[:, 1]), "datasets 1, 2: expected different channels, found '1_x' in each"),
        (time_response(SIGNALS[:300, 1], 2), "dataset 2: expected 400 samples every 0.005 s"),
        (time_response(SIGNALS[:, 1], 2, rate=100.0), "dataset 2: expected 400 samples every 0.005 s"),
        (time_response(SIGNALS[:, 1], 2, start=1.0), "found 400 every 0.005 s from 1 s"),
        (
            time_response(SIGNALS[:, 1], 2, ordinate_spec_data_type=13),
            "dataset 2 (2_x): expected acceleration, velocity or displacement",
        ),
        (time_response(1j * SIGNALS[:, 1], 2), "dataset 2 (2_x): expected finite real numbers"),
    ],
)
def test_inconsistent_dataset_is_named_with_its_file(tmp_path: Path, second: dict[str, Any], message: str) -> None:
    path = universal(tmp_path / "test.uff", time_response(SIGNALS[:, 0]), second)
    with pytest.raises(DataError) as caught:
        read_data(path)
    assert str(caught.value).startswith(f"{path}: dataset")
    assert message in str(caught.value)


def test_unselected_force_channel_is_ignored(tmp_path: Path) -> None:
    force = time_response(SIGNALS[:, 2], 3, ordinate_spec_data_type=13)
    path = universal(tmp_path / "test.uff", time_response(SIGNALS[:, 0]), time_response(SIGNALS[:, 1], 2), force)
    assert len(read_data(path, columns={"1_x": "a", "2_x": "b"}).channels) == 2
    with pytest.raises(DataError, match="expected a channel 'c', found 1_x, 2_x, 3_x"):
        read_data(path, columns={"c": "c"})


def test_invalid_universal_files_are_refused(tmp_path: Path) -> None:
    text, cut, geometry = tmp_path / "text.uff", tmp_path / "cut.uff", tmp_path / "geometry.unv"
    text.write_text("t,a\n0,1\n")
    universal(cut, time_response(SIGNALS[:, 0]))
    lines = cut.read_text().splitlines()
    lines[8] = lines[8][:12] + "many".rjust(8) + lines[8][20:]
    cut.write_text("\n".join(lines) + "\n")
    universal(geometry, UNITS)
    for path, message in (
        (text, "its datasets are of type none"),
        (cut, "dataset 1: cannot be read"),
        (geometry, "holds no time response (dataset 58, function type 1); its datasets are of type 164"),
        (tmp_path / "none.uff", "cannot be read: No such file"),
    ):
        with pytest.raises(DataError) as caught:
            read_data(path)
        assert str(path) in str(caught.value)
        assert message in str(caught.value)
