"""What logs cannot say: the fit tells which parameters go together, and what would separate them."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.fits import STD, fitted, near, some
from identification.synthetic_logs import PENDULUM, TRUTH

pytestmark = pytest.mark.long

RAW = ["gear.gear_reduction", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
       "friction.coulomb_torque_forward", "friction.coulomb_torque_backward"]


def test_a_reduction_has_no_interval_from_motion_alone():
    """N k_t, N k_b, N² J and N F are what the output shaft sees: five products of six numbers."""
    found = fitted(some(load=PENDULUM), free=RAW)
    (item,) = found.unidentifiable
    assert set(item.parameters) == set(RAW)
    step = dict(zip(item.parameters, item.direction, strict=True))
    relative = {name: step[name] / (1.0 if found.space.parameters[RAW.index(name)].logarithmic
                                    else found.best[RAW.index(name)]) for name in RAW}
    for name in RAW[1:]:
        power = 2.0 if name == "motor.rotor_inertia" else 1.0
        assert relative[name] / relative[RAW[0]] == pytest.approx(-power, rel=0.02), name
    intervals = found.intervals()
    for name in RAW:
        assert intervals[name].method == "undetermined"
        assert math.isnan(intervals[name].lower)
        assert math.isnan(intervals[name].upper)
    assert intervals["angle_offset"].method in ("normal", "profile")
    assert found.undetermined == item.parameters
    row = found.names.index(RAW[0])
    assert np.isnan(found.covariance[row]).all()
    assert math.isfinite(found.covariance[found.names.index("angle_offset"), found.names.index("angle_offset")])


@pytest.fixture(scope="module")
def free_shaft():
    """Return logs of an unloaded servo: torques are known up to a factor only."""
    return some(load=None, motions=("step", "prbs"), signals=("output_angle", "supply_current"))


SCALED = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque"]


def test_without_a_load_torques_are_known_up_to_a_factor(free_shaft):
    """K² / R, J and F go together: only 1/R per J and F per J are seen, and K by the speed."""
    angle = [replace(log, measured={"output_angle": log.measured["output_angle"]}) for log in free_shaft]
    (item,) = fitted(angle, free=SCALED).unidentifiable
    assert set(item.parameters) == {SCALED[0], *SCALED[2:]}
    assert len(item.combinations) == 2
    assert any("current" in text for text in item.remedies)
    assert "would separate them" in str(item)


def test_a_current_that_is_sampled_between_pulses_misleads_no_search(free_shaft):
    """Beside the angle a pulsed current, noise and all: pulses are found as well as from the angle alone."""
    rng = np.random.default_rng(6)
    logs = [replace(log, measured={**log.measured, "supply_current": log.measured["supply_current"]
                                   + 0.02 * rng.normal(size=len(log))}) for log in free_shaft]
    found = fitted(logs, free=SCALED)
    assert found.intervals()["delay"].upper == pytest.approx(0.05, abs=1e-3)
    assert found.noise["output_angle"] < 2.0 * STD


def test_a_sensor_that_is_named_as_a_remedy_is_one(free_shaft):
    angle = [replace(log, measured={"output_angle": log.measured["output_angle"]}) for log in free_shaft]
    (item,) = fitted(angle, free=SCALED).unidentifiable
    sensor = {"a motor current measurement": "armature_current", "a supply current measurement": "supply_current"}
    for text in item.remedies:
        logs = some(load=None, motions=("step", "prbs"), signals=("output_angle", sensor[text]), delay=0.0)
        rng = np.random.default_rng(1)
        logs = [replace(log, measured={**log.measured, sensor[text]: log.measured[sensor[text]]
                                       + 0.02 * rng.normal(size=len(log))}) for log in logs]
        found = fitted(logs, free=SCALED, nuisance=("angle_offset", "initial_state"))
        assert found.unidentifiable == ()
        near(found)


def test_a_load_that_is_named_as_a_remedy_is_one(free_shaft):
    """Of inertia alone a known inertia tells; the potentiometer's gain by a tap is none of that."""
    both = ["output_inertia", "load.inertia"]
    angle = [replace(log, load=st.loads.Inertia(1e-3), measured={"output_angle": log.measured["output_angle"]})
             for log in free_shaft]
    (item,) = fitted(angle, free=both).unidentifiable
    assert set(item.parameters) == set(both)
    assert not any("tap" in text for text in item.remedies)


def test_inductance_cannot_be_seen_in_motion():
    logs = some(motions=("step",), duration=1.0)
    found = fitted(logs, free=["output_inertia", "motor.armature_inductance"], model=st.PulseServoInductive,
                   servo=TRUTH.replace({"motor.armature_inductance": 1e-4}))
    assert [item.parameters for item in found.unidentifiable] in ([], [("motor.armature_inductance",)])
    if not found.unidentifiable:  # or it is, but hardly
        lower, upper, _ = found.intervals()["motor.armature_inductance"]
        assert upper > 1.5 * max(lower, 1e-9)
