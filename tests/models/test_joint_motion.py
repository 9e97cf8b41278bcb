"""How servos on one source move together: the short way for plain members against the general one, and the step."""

import math

import pytest

import servotwin as st
from servotwin.loads import Constant, Inertia, as_load
from servotwin.models.engine import joint_motion, shared_source
from servotwin.models.engine.modes import BACKWARD, CURRENT_BACKWARD, CURRENT_FORWARD, FORWARD, FREE, RIGID, Mode
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import Piece

SOURCE = Source(6.0, 0.4, 1.5)
STATES = (shared_source.FOLLOWING, shared_source.LIMITED, shared_source.BROKEN_DOWN, shared_source.KEEPING)


def members(stiffness=0.0):
    """Return two plain members that drive, one each way; a spring makes them take the general way."""
    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    found, states = [], []
    for k, (sign, contact, zone) in enumerate([(1.0, FORWARD, CURRENT_FORWARD), (-1.0, BACKWARD, CURRENT_BACKWARD)]):
        numbers = shared_source.on_stiff_source(model.pack(as_load(Inertia(1e-3 * (k + 1)) + Constant(0.1))), False)
        numbers = numbers._replace(load=numbers.load._replace(stiffness=stiffness))
        found.append(shared_source.Member(numbers, Mode(zone, contact, RIGID, FREE, 0), sign, Piece(value=0.1), False))
        w = sign * (1.0 + k)
        states.append((0.5, w, 0.0, 0.0, 0.0, 0.5, w))
    return found, states


@pytest.mark.parametrize("state", STATES)
def test_the_short_way_for_plain_members_is_the_general_one(state):
    length = 0.4 * joint_motion.longest_series(members()[0])
    short = joint_motion.series(SOURCE, state, *members(), 0.0, length)
    general = joint_motion.series(SOURCE, state, *members(1e-300), 0.0, length)  # a spring that nobody feels
    for one, other in zip(short, general, strict=True):
        for ours, theirs in ((one.speed, other.speed), (one.current, other.current)):
            at_end = [sum(c * length**n for n, c in enumerate(series)) for series in (ours, theirs)]
            assert at_end[0] == pytest.approx(at_end[1], rel=1e-13)


@pytest.mark.parametrize("state", STATES)
def test_a_series_is_what_the_step_finds(state):
    found, states = members()
    length, _, _, ends = joint_motion.joint_step(SOURCE, state, found, states, 0.0, 1e-3)
    for one, end in zip(joint_motion.series(SOURCE, state, found, states, 0.0, length), ends, strict=True):
        assert sum(c * length**n for n, c in enumerate(one.speed)) == pytest.approx(end[1], abs=1e-11)


def test_a_step_that_cannot_be_made_says_so():
    found, states = members()
    broken = [(y[0], math.nan, *y[2:]) for y in states]
    length, _, dense, _ = joint_motion.joint_step(SOURCE, shared_source.FOLLOWING, found, broken, 0.0, 1e-3)
    assert length == 0.0
    assert not dense
