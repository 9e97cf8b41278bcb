"""Searches of digital servos: lanes that neglect what bends within a tick, and differences over many kinks."""

import numpy as np
import pytest

import servotwin as st
from identification.digital_servos import ON_BUS, digital_log
from servotwin.identification.fitting.search.case import Point
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.free import Space

pytestmark = pytest.mark.long

FREE = ("output_torque_constant", "output_inertia", "output_coulomb_torque")
ARM = st.loads.Pendulum(mass=0.2, length=0.15, inertia=0.0)
FADES = {"firmware.control_period": 1e-3, "friction.breakaway_ratio": 1.5, "friction.stribeck_speed": 40.0,
         "friction.load_friction_stribeck": 0.1}
COUNTED = ON_BUS.replace({"firmware.angle_quantum": 2.0 * np.pi / 4096.0, "firmware.duty_quantum": 1e-3})


def seen(servo, load, *, nearly, **how):
    """Return residuals [rad] and derivatives of a log, and whether lanes may go another way."""
    log = digital_log(servo, "prbs", load=load, duration=1.0, std=0.0)
    model = st.DigitalServo(servo)
    space = Space(model, FREE)
    forecast = Forecast([log], model, space, (), ["output_angle"])
    forecast.nearly = nearly and forecast.bent
    (part,) = forecast.at(Point(space.start, (np.zeros(0),)), **how)
    return part.residual, part.shared, forecast.bent


@pytest.mark.parametrize(("changes", "load", "most"), [
    ({}, ARM, 1e-4), ({}, ARM + st.loads.Spring(0.3), 1e-4), (FADES, st.loads.Inertia(4e-3), 1e-3)],
    ids=["pendulum", "spring", "fading friction"])
def test_what_bends_within_a_tick_hardly_counts(changes, load, most):
    (exact, slopes, bent), (near, about, _) = (seen(ON_BUS.replace(changes), load, nearly=way) for way in (False, True))
    assert bent
    assert 0.0 < np.abs(near - exact).max() < most
    assert about == pytest.approx(slopes, abs=0.1 * np.abs(slopes).max())


def test_a_plain_load_goes_one_way():
    (exact, _, bent), (near, _, _) = (seen(ON_BUS, st.loads.Inertia(4e-3), nearly=way) for way in (False, True))
    assert not bent
    assert np.array_equal(exact, near)


def test_differences_of_a_program_that_counts_are_slopes():
    """Forward and central ones agree; over 1e-4 they are those of single counts."""
    ahead, about = (seen(COUNTED, st.loads.Inertia(4e-3), nearly=False, central=side)[1] for side in (False, True))
    fine = seen(COUNTED, st.loads.Inertia(4e-3), nearly=False, step=1e-4)[1]
    same = [np.corrcoef(a, b)[0, 1] for a, b in zip(ahead.T, about.T, strict=True)]
    jagged = [np.corrcoef(a, b)[0, 1] for a, b in zip(fine.T, about.T, strict=True)]
    assert min(same) > 0.8
    assert min(jagged) < 0.8 * min(same)
