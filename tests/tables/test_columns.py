"""Columns written by this package come back as they were."""

import math

import numpy as np
import pytest

from servotwin.errors import InputError
from servotwin.tables import csv_text, read_columns

FLOATS = [0.1, 1.0 / 3.0, 5e-324, -1.7976931348623157e308, math.inf, 1e22]
WORDS = ["a, b", 'says "so"', "two\nlines", "ångström", "1.5 V", "x"]


@pytest.fixture
def read(tmp_path):
    def write_and_read(text):
        (tmp_path / "a.csv").write_bytes(text.encode())
        return read_columns(tmp_path / "a.csv")

    return write_and_read


def test_floats_come_back_to_the_last_bit_and_words_letter_by_letter(read):
    found = read(csv_text({"lane": range(6), "servo, or so": WORDS, "torque_Nm": FLOATS}))
    assert found["torque_Nm"].tolist() == FLOATS
    assert found["servo, or so"].tolist() == WORDS
    assert found["lane"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_digits_are_those_of_floats_alone():
    text = csv_text({"n": [1234567], "x": np.array([1234567.0]), "word": ["1234567.0"]}, digits=3)
    assert text == "n,x,word\n1234567,1.23e+06,1234567.0\n"


def test_shorter_columns_end_in_empty_cells(read):
    found = read(csv_text({"a": [1.0, 2.0, 3.0], "b": [4.0], "c": []}))
    assert {name: column.tolist() for name, column in found.items()} == {
        "a": [1.0, 2.0, 3.0], "b": ["4.0", "", ""], "c": ["", "", ""]}


@pytest.mark.parametrize(("text", "why"), [
    ("", "no rows"), ("a,b\n", "no rows"), ("a,a\n1,2\n", "not a table of columns"),
    ("a,b\n1\n", "not a table of columns"), ("a,b\n1,2,3\n", "not a table of columns")])
def test_what_is_no_table_is_said(read, text, why):
    with pytest.raises(InputError, match=why):
        read(text)
