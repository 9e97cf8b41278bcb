"""The table of pieces that every function of time lowers to: its values by the formula, whoever asks."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin.errors import InputError
from servotwin.physics.pieces import Piece, Pieces, constant_pieces, piece_range, piece_rate, piece_value, table_rows

numbers = st.floats(-5.0, 5.0)


@st.composite
def tables(draw, oscillating=True):
    starts = np.cumsum([draw(numbers), *draw(st.lists(st.floats(0.1, 2.0), max_size=4))])
    zero = st.just(0.0)
    return Pieces(tuple(
        Piece(float(start), draw(numbers), draw(numbers), draw(numbers if oscillating else zero),
              draw(st.floats(0.0, 20.0)), draw(numbers), draw(numbers)) for start in starts))


def formula(piece, t):
    s = t - piece.start
    return piece.value + piece.slope * s + piece.amplitude * math.sin(
        piece.phase + piece.frequency * s + piece.sweep * s * s / 2.0)


@given(tables(), st.floats(-8.0, 12.0))
def test_one_time_and_many_times_agree_with_the_formula(pieces, t):
    piece, end = pieces.at(t)
    assert piece_value(piece, t) == pytest.approx(formula(piece, t), abs=1e-11)
    np.testing.assert_allclose(pieces([t, t]), formula(piece, t), atol=1e-10)
    assert t < end
    assert pieces.at(math.nextafter(end, -math.inf))[0] == piece or end == math.inf


@given(tables())
def test_a_piece_starts_at_its_start(pieces):
    starts = [piece.start for piece in pieces.table]
    for k, piece in enumerate(pieces.table):
        assert pieces.at(piece.start)[0] == piece
        assert pieces.at(piece.start)[1] == (starts[k + 1] if k + 1 < len(starts) else math.inf)
        assert float(pieces(piece.start)) == pytest.approx(formula(piece, piece.start), abs=1e-12)
    first = pieces.table[0]
    assert pieces.at(first.start - 1.0) == (first, starts[1] if len(starts) > 1 else math.inf)


@given(tables(), st.floats(0.0, 3.0))
def test_the_rate_is_the_derivative(pieces, t):
    piece, h = pieces.at(t)[0], 1e-5
    slope = (piece_value(piece, t + h) - piece_value(piece, t - h)) / (2.0 * h)
    assert piece_rate(piece, t) == pytest.approx(slope, rel=1e-5, abs=1e-5)


@given(tables(), numbers, numbers)
def test_scaled(pieces, gain, offset):
    t = np.linspace(-6.0, 12.0, 60)
    np.testing.assert_allclose(pieces.scaled(gain, offset)(t), gain * pieces(t) + offset, atol=1e-9)


@given(tables(), st.floats(0.0, 5.0))
def test_bounds_hold(pieces, more):
    first = pieces.table[0].start
    end = first + more
    low, high = pieces.bounds(end)
    values = pieces(np.linspace(first, end, 200)[:-1] if more else [first])
    assert low - 1e-9 <= values.min()
    assert values.max() <= high + 1e-9


@given(tables(oscillating=False), st.floats(0.0, 5.0))
def test_bounds_of_lines_are_reached(pieces, more):
    first = pieces.table[0].start
    end = first + more
    inside = [(piece, stop) for piece, stop in
              zip(pieces.table, [*(p.start for p in pieces.table[1:]), math.inf], strict=True) if piece.start <= end]
    ends = [formula(piece, t) for piece, stop in inside for t in (piece.start, min(stop, end))]
    assert pieces.bounds(end) == pytest.approx((min(ends), max(ends)), abs=1e-11)


def test_bounds_end_where_they_are_told_to():
    step = Pieces((Piece(0.0, 1.0), Piece(1.0, 5.0)))
    assert step.bounds(0.5) == (1.0, 1.0)
    assert step.bounds(1.0) == (1.0, 5.0)
    assert step.bounds() == (1.0, 5.0)
    assert Pieces((Piece(0.0, 1.0, 1.0),)).bounds() == (1.0, math.inf)
    assert Pieces((Piece(0.0, 1.0, 0.0, -2.0, 1.0),)).bounds() == (-1.0, 3.0)
    assert piece_range(Piece(0.0, 3.0, -1.0), 2.0) == (1.0, 3.0)


@given(tables(), st.sampled_from([1, 5]))
def test_extremes_are_the_bounds_until_the_last_piece_starts(pieces, times):
    shift = 20.0 * (1.0 + np.arange(times))  # a long table goes another way
    table = tuple(piece._replace(start=piece.start + more) for more in shift for piece in pieces.table)
    longer = Pieces(table)
    assert longer.extremes == longer.bounds(table[-1].start)
    assert all(type(value) is float for value in longer.extremes)


@given(st.lists(tables(), min_size=1, max_size=4))
def test_rows_of_many_tables(functions):
    rows = table_rows(functions)
    np.testing.assert_array_equal(rows, [piece for pieces in functions for piece in pieces.table])
    np.testing.assert_array_equal(rows, np.concatenate([pieces.rows for pieces in functions]))


def test_huge_numbers_are_finite():
    assert Pieces((Piece(value=1e308), Piece(1.0, value=1.7e308))).extremes == (1e308, 1.7e308)


def test_a_constant():
    assert constant_pieces(3.0)([-1e9, 0.0, 1e9]).tolist() == [3.0, 3.0, 3.0]
    assert constant_pieces(3.0).at(1e9) == (Piece(value=3.0), math.inf)


@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3), (2, 3, 4)])
def test_shapes(shape):
    pieces = Pieces((Piece(0.0, 1.0, 2.0), Piece(1.0, 5.0, 0.0, 1.0, 3.0)))
    assert pieces(np.zeros(shape)).shape == shape


def test_what_was_asked_before_leaves_no_trace():
    fresh, used = (Pieces((Piece(0.0, 1.0), Piece(1.0, 2.0))) for _ in range(2))
    used(0.5), used.at(0.5), used.bounds()
    assert pickle.dumps(used) == pickle.dumps(fresh)
    again = pickle.loads(pickle.dumps(used))
    assert again == used == fresh
    assert again(1.0) == 2.0


@pytest.mark.parametrize("table", [
    (), (Piece(1.0), Piece(1.0)), (Piece(1.0), Piece(0.0)), (Piece(math.nan),), (Piece(value=math.inf),),
    (Piece(slope=-math.inf),), (Piece(sweep=math.nan),),
])
def test_a_bad_table_is_refused(table):
    with pytest.raises(InputError) as caught:
        Pieces(table)
    assert "allowed" in str(caught.value)
    assert str(caught.value).isprintable()
