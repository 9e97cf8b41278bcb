"""A run that is only looked at, compiled, shows what `simulate` shows."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.rest import rest_of
from servotwin.simulation.watched_run import watched

NAMES = ("command_angle", "output_angle", "armature_current")
TIMES = np.arange(0.0, 3.0, 2e-3)
HS = st.load_servo("hitec-hs-422")
STS = st.load_servo("feetech-sts3215-12v")


def changed(servo, **values):
    return servo.replace({name.replace("__", "."): value for name, value in values.items()})


CASES = {
    "swings": (st.PulseServo(changed(HS, electronics__stretcher_gain=2500.0)), st.loads.Inertia(1e-3)),
    "pendulum": (st.PulseServo(HS), st.loads.Pendulum(mass=0.3, length=0.1)),
    "current limit": (st.PulseServo(changed(HS, supply__current_limit=0.3)), st.loads.Inertia(2e-3)),
    "play": (st.DigitalServo(changed(STS, gear__backlash=0.08)), st.loads.Inertia(0.02)),
    "trips": (st.DigitalServo(changed(STS, firmware__trip_current=0.3)), st.loads.Constant(0.5)),
    "bounded": (st.BoundedServo(HS), st.loads.Inertia(1e-3)),
    "spring between two bodies": (st.PulseServo(HS), st.loads.Flexible(stiffness=5.0, inertia=1e-4)),
}


@pytest.mark.long(but="bounded")
@pytest.mark.parametrize("case", CASES)
def test_it_shows_what_a_whole_run_shows(case):
    model, load = CASES[case]
    command = st.signals.step(-0.9, 0.1, at=0.1, unit="rad")
    whole = st.simulate(model, command, duration=3.0, load=load, output_times=[3.0])
    run = watched(model, command, duration=3.0, load=load, outputs=NAMES, times=TIMES)
    for name in NAMES:
        np.testing.assert_allclose(run.at(name, TIMES), whole.at(name, TIMES), rtol=0.0, atol=1e-9)
    own, wanted = (np.array(found._replace(current=math.nan), float) for found in (run.rest, rest_of(whole)))
    np.testing.assert_allclose(own, wanted, rtol=0.0, atol=1e-9)
    trips = [[event for event in each.events if event.kind.startswith("trips by")] for each in (run, whole)]
    assert [event.kind for event in trips[0]] == [event.kind for event in trips[1]]
    np.testing.assert_allclose([event.time for event in trips[0]], [event.time for event in trips[1]], atol=1e-9)


def test_a_run_that_ends_early_says_so():
    model = st.PulseServo(changed(HS, electronics__stretcher_gain=2500.0))
    with pytest.raises(st.errors.InputError):
        watched(model, st.signals.constant(0.0, unit="rad"), duration=-1.0, outputs=NAMES, times=TIMES)
