"""Estimates as tables of pandas and data sets of xarray."""

import importlib.util
import sys
from dataclasses import replace

import numpy as np
import pytest

from oma import ModalEstimate, identify
from oma.windows import Windows, identify_windows
from tests.support.oma.structures import chain, simulate

CHAIN = chain(3, first=2.0, damping=0.01)


@pytest.fixture(scope="module")
def estimate() -> ModalEstimate:
    return identify(simulate(CHAIN, 200.0, 40.0, seed=5))


@pytest.fixture(scope="module")
def windows() -> Windows:
    first = simulate(CHAIN, 200.0, 40.0, seed=6)
    return identify_windows([first, replace(simulate(CHAIN, 200.0, 40.0, seed=7), start=first.end)])


def test_table_has_a_row_per_mode(estimate: ModalEstimate) -> None:
    table = estimate.to_dataframe()
    assert table.index.tolist() == [1, 2, 3]
    np.testing.assert_array_equal(table["frequency"], estimate.frequency)
    np.testing.assert_array_equal(table["damping_std"], estimate.damping_std)
    assert not [name for name in table.columns if name.startswith("shape")]


def test_table_has_the_shapes_if_requested(estimate: ModalEstimate) -> None:
    table = estimate.to_dataframe(shapes=True)
    shape = table[[f"shape_{channel}" for channel in estimate.channels]].to_numpy()
    std = table[[f"shape_std_{channel}" for channel in estimate.channels]].to_numpy()
    np.testing.assert_array_equal(shape, estimate.shape)
    np.testing.assert_array_equal(std, estimate.shape_std)


def test_table_of_windows_has_the_time_of_each(windows: Windows) -> None:
    table = windows.to_dataframe()
    assert table.index.names == ["start", "mode"]
    starts = table.index.get_level_values("start").unique()
    assert [time.value for time in starts] == [estimate.start for estimate in windows.estimates]
    second = table.loc[starts[1]]
    np.testing.assert_array_equal(second["frequency"], windows.estimates[1].frequency)


def test_table_of_no_windows_is_empty(windows: Windows) -> None:
    assert replace(windows, estimates=()).to_dataframe().empty


@pytest.mark.skipif(importlib.util.find_spec("xarray") is None, reason="xarray is not installed")
def test_data_set_is_over_modes_and_channels(estimate: ModalEstimate) -> None:
    found = estimate.to_xarray()
    assert dict(found.sizes) == {"mode": 3, "channel": 3}
    np.testing.assert_array_equal(found["shape"].sel(mode=2), estimate.shape[1])
    np.testing.assert_array_equal(found["shape_std"].sel(channel=estimate.channels[1]), estimate.shape_std[:, 1])
    np.testing.assert_array_equal(found["frequency"], estimate.frequency)
    assert found["frequency"].attrs == {"units": "Hz"}
    assert found.attrs == {"start": estimate.start, "end": estimate.end}


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_dataframe"), ("xarray", "to_xarray")])
def test_missing_package_names_the_extra(
    estimate: ModalEstimate, package: str, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=rf"{package} is not installed: pip install 'modalwatch\[notebook\]'"):
        getattr(estimate, method)()
