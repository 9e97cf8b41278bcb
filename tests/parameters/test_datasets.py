"""The tables of the paper, as printed."""

import numpy as np
import pytest

from servotwin.errors import UnknownNameError
from servotwin.parameters import dataset_names, load_dataset


def test_names():
    assert dataset_names() == ("urrea-kern-table-1", "urrea-kern-table-2")


def test_table_1():
    table = load_dataset("urrea-kern-table-1")
    assert {k: v.tolist() for k, v in table.columns.items()} == {
        "q_deg": [0.0, 180.0], "t_a_us": [500.0, 2500.0], "V_o_V": [0.5, 2.0]}
    assert table.units == {"q_deg": "deg", "t_a_us": "us", "V_o_V": "V"}


def test_table_2():
    table = load_dataset("urrea-kern-table-2")
    assert {k: v.tolist() for k, v in table.columns.items()} == {
        "q_deg": [0.0, 45.0, 90.0, 135.0, 180.0], "V_i_V": [0.609, 1.002, 1.425, 1.827, 2.246],
        "ADC_i": [250.0, 411.0, 582.0, 748.0, 920.0], "t_a_us": [646.0, 1078.0, 1526.0, 1974.0, 2438.0],
        "f_Hz": [61.0] * 5, "V_o_V": [0.590, 0.912, 1.253, 1.572, 1.908],
        "ADC_o": [212.0, 350.0, 497.0, 636.0, 782.0]}
    assert table.units == {"q_deg": "deg", "V_i_V": "V", "ADC_i": "1", "t_a_us": "us", "f_Hz": "Hz", "V_o_V": "V",
                           "ADC_o": "1"}


@pytest.mark.parametrize("name", dataset_names())
def test_every_table_is_of_floats_and_says_its_source(name):
    table = load_dataset(name)
    assert table.name == name
    assert set(table.units) == set(table.columns)
    assert len({column.shape for column in table.columns.values()}) == 1
    assert all(column.dtype == np.float64 and np.isfinite(column).all() for column in table.columns.values())
    for part in ("Urrea", "Kern", "A New Model for Analog Servo Motors", "Vol. 2, No. 2", "March 2011"):
        assert part in " ".join(table.source.split())


def test_loading_twice_shares_nothing():
    first = load_dataset("urrea-kern-table-1")
    first.columns["q_deg"][0] = 99.0
    assert load_dataset("urrea-kern-table-1").columns["q_deg"][0] == 0.0


@pytest.mark.parametrize("name", ["urrea-kern-table-3", "", "../catalog/x", "urrea-kern-table-2.csv"])
def test_an_unknown_name_is_refused_in_one_line(name):
    with pytest.raises(UnknownNameError, match="unknown data set") as caught:
        load_dataset(name)
    assert "urrea-kern-table-2" in str(caught.value)
    assert "\n" not in str(caught.value)
