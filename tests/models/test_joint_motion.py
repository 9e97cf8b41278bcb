"""How servos on one source move together: the short way for plain mates against the general one, and the step."""

import math

import pytest

import servotwin as st
from servotwin.loads import Constant, Inertia, as_load
from servotwin.models.engine.bus import coupled_step
from servotwin.models.engine.bus.bus_records import Mate
from servotwin.models.engine.dynamics import currents
from servotwin.models.state.modes import (
    BACKWARD,
    CURRENT_BACKWARD,
    CURRENT_FORWARD,
    FORWARD,
    FREE,
    RIGID,
    Mode,
    Vector,
)
from servotwin.models.state.records import object_of
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import Piece

SOURCE = Source(6.0, 0.4, 1.5)
STATES = (coupled_step.FOLLOWING, coupled_step.LIMITED, coupled_step.BROKEN_DOWN, coupled_step.KEEPING)


def mates(stiffness=0.0):
    """Return two plain mates that drive, one each way; a spring makes them take the general way."""
    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    found = []
    for k, (sign, contact, zone) in enumerate([(1.0, FORWARD, CURRENT_FORWARD), (-1.0, BACKWARD, CURRENT_BACKWARD)]):
        numbers = currents.on_stiff_source(model.pack(as_load(Inertia(1e-3 * (k + 1)) + Constant(0.1))), False)
        mate, w = object_of(Mate), sign * (1.0 + k)
        mate.numbers = numbers._replace(load=numbers.load._replace(stiffness=stiffness))
        mate.mode, mate.sign, mate.tau = Mode(zone, contact, RIGID, FREE, 0), sign, Piece(value=0.1)
        mate.start = Vector(0.5, w, 0.0, 0.0, 0.0, 0.5, w)
        found.append(mate)
    return found


def value(coefficients, terms, s):
    return sum(c * s**n for n, c in enumerate(coefficients[:terms]))


@pytest.mark.parametrize("state", STATES)
def test_the_short_way_for_plain_mates_is_the_general_one(state):
    short, general = mates(), mates(1e-300)  # a spring that nobody feels
    length = 0.4 * coupled_step.longest_series(short, 2)
    terms = [coupled_step.series(SOURCE, state, some, 2, 0.0, length) for some in (short, general)]
    for one, other in zip(short, general, strict=True):
        for name in ("speed", "current"):
            at_end = [value(getattr(mate, name), n, length) for mate, n in zip((one, other), terms, strict=True)]
            assert at_end[0] == pytest.approx(at_end[1], rel=1e-13)


@pytest.mark.parametrize("state", STATES)
def test_a_series_is_what_the_step_finds(state):
    found = mates()
    length = coupled_step.joint_step(SOURCE, state, found, 2, 0.0, 1e-3).length
    terms = coupled_step.series(SOURCE, state, found, 2, 0.0, length)
    for mate in found:
        assert value(mate.speed, terms, length) == pytest.approx(mate.end.w, abs=1e-11)
        assert value(mate.speed, terms, 0.3 * length) == pytest.approx(coupled_step.between(mate, 0.3).w, abs=1e-10)


def test_a_step_that_cannot_be_made_says_so():
    found = mates()
    for mate in found:
        mate.start = mate.start._replace(w=math.nan)
    assert coupled_step.joint_step(SOURCE, coupled_step.FOLLOWING, found, 2, 0.0, 1e-3).length < 0.0
