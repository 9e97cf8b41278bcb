"""Columns: what a formula makes of them is, lane by lane, what it makes of numbers."""

import numpy as np
import pytest

import servotwin as st
from servotwin import loads, signals
from servotwin.models.columns import LanePieces
from servotwin.models.state.records import mapped
from servotwin.physics.pieces import Piece, Pieces
from servotwin.simulation.lanes.inputs import column_load, structure

TABLES = [
    Pieces((Piece(value=1.0),)),
    Pieces((Piece(0.0, 1.0, slope=2.0), Piece(0.5, -1.0, amplitude=0.3, frequency=7.0, phase=0.2, sweep=3.0))),
    signals.samples(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9) ** 2, unit="V").pieces,
    Pieces((Piece(0.25, 3.0), Piece(0.5, 4.0), Piece(0.75, 5.0))),
]
TIME = np.array([-0.1, 0.0, 0.2, 0.25, 0.49999, 0.5, 0.6, 0.75, 0.9, 2.0])


def lane_pieces(of):
    count = np.array([len(pieces.table) for pieces in TABLES])
    first = np.cumsum(count) - count
    return LanePieces(np.concatenate([np.array(pieces.table) for pieces in TABLES]), first[of], count[of])


@pytest.mark.parametrize("of", [[0, 1, 2, 3], [3, 3, 0], [2], [1, 1]])
def test_pieces_at_many_times(of):
    found = np.broadcast_to(lane_pieces(np.array(of))(TIME), (len(of), len(TIME)))
    for lane, k in enumerate(of):
        np.testing.assert_array_equal(found[lane], TABLES[k](TIME))


@pytest.mark.parametrize("gain", [2.0, np.array([[2.0], [-1.0], [0.5]])])
def test_tables_hold_what_is_used(gain):
    of = np.array([2, 0, 2])
    first, count, rows = lane_pieces(of).scaled(gain, 0.1).tables()
    shared = isinstance(gain, float)
    assert len(rows) == sum(len(TABLES[k].table) for k in (of[:2] if shared else of))
    for lane, k in enumerate(of):
        own = gain if shared else float(gain[lane, 0])
        wanted = np.array(TABLES[k].scaled(own, 0.1).table)
        np.testing.assert_array_equal(rows[first[lane]:first[lane] + count[lane]], wanted)


def test_scaling_twice():
    pieces = lane_pieces(np.arange(4)).scaled(2.0, 1.0).scaled(np.array([[1.0], [2.0], [3.0], [4.0]]), 0.5)
    for lane, table in enumerate(TABLES):
        np.testing.assert_allclose(pieces(TIME)[lane], (lane + 1.0) * (2.0 * table(TIME) + 1.0) + 0.5, rtol=1e-14)


@pytest.mark.parametrize("of", [[0, 1, 2], [1, 1, 0, 2, 2], [2]])
def test_loads_as_columns(of):
    arms = [loads.Pendulum(mass=m, length=0.1) + loads.Pendulum(mass=0.2, length=0.1, hanging_angle=1.0)
            + loads.Spring(0.1) + loads.Spring(k, 0.4) + loads.Constant(0.01 * k) for m, k in ((0.1, 0.0), (0.2, 2.0))]
    hung = [*arms, arms[0] + loads.Recorded([0.0, 3.0], [0.0, 0.3])]
    assert len({structure(load) for load in hung}) == 1
    load = column_load(hung, np.array(of), {})
    angle, time = np.linspace(-1.0, 1.0, 5), np.linspace(0.0, 2.0, 5)
    torque = np.broadcast_to(load.external_torque(time, angle), (len(of), 5))
    for lane, k in enumerate(of):
        np.testing.assert_allclose(torque[lane], hung[k].external_torque(time, angle), rtol=0.0, atol=1e-14)
        assert np.ravel(load.total_inertia)[lane if np.size(load.total_inertia) > 1 else 0] == hung[k].total_inertia


def test_a_load_without_stiffness_has_no_rest_angle():
    assert (loads.Spring(0.0, 1.0) + loads.Spring(0.0, 2.0)).elasticity == (0.0, 0.0)
    assert all(type(number) is float for number in (*loads.Load().elasticity, *loads.Load().gravity))


@pytest.mark.parametrize("model", [st.PulseServo, st.BoundedServo])
def test_models_pack_plain_floats(model):
    plant = model(st.load_servo("hitec-hs-755hb")).pack(loads.Load())
    kinds = set()
    mapped(lambda number: kinds.add(type(number)), plant)
    assert kinds == {float}
