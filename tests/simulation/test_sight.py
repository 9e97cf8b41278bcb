"""What is seen of a servo along a run, all signals at once, is what its result says signal by signal."""

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.engine import Record
from servotwin.simulation.sight import Sight, switches

ANALOG, DIGITAL, BUS = "hitec-hs-755hb", "towerpro-mg996r", "feetech-sts3215-12v"
HEAT = {"thermal.winding_capacity": 3.0, "thermal.housing_capacity": 30.0, "thermal.winding_to_housing": 8.0,
        "thermal.housing_to_ambient": 20.0, "thermal.ambient": 298.0}
ARM = st.loads.Pendulum(mass=0.1, length=0.1) + st.loads.Coulomb(0.02)
CASES = [
    (st.PulseServo, ANALOG, {}, None),
    (st.PulseServo, ANALOG, {"potentiometer.noise": 2e-3, "electronics.off_state": "coast"}, ARM),
    (st.PulseServo, ANALOG, {"gear.backlash": 0.01}, st.loads.Inertia(2e-4)), (st.PulseServo, ANALOG, HEAT, ARM),
    (st.PulseServoInductive, ANALOG, {}, ARM), (st.BoundedServo, ANALOG, {}, ARM), (st.AveragedServo, ANALOG, {}, None),
    (st.AveragedServoInductive, ANALOG, {}, ARM), (st.DigitalServo, DIGITAL, {}, ARM), (st.DigitalServo, BUS, {}, ARM)]
IDS = [f"{kind.__name__}-{servo}-{len(values)}-{k}" for k, (kind, servo, values, _) in enumerate(CASES)]


@pytest.mark.parametrize(("kind", "servo", "values", "load"), CASES, ids=IDS)
def test_all_signals_are_those_of_a_result(kind, servo, values, load):
    model = kind(st.load_servo(servo).replace(values))
    command = st.signals.step(10.0, 40.0, at=0.03, unit="deg")
    times = np.random.default_rng(4).uniform(0.0, 0.4, 40)
    result = st.simulate(model, command, duration=0.4, load=load, seed=3)
    sim, record = st.Simulator(model, load=load, seed=3), Record([], [])
    sim.recorded(sim.initial(command), 0.4, command, record)
    sight = Sight(model, sim.load)
    rows = np.array(sight.points(sim.plan(command), record.segments, sorted(times.tolist())))
    assert {"output_angle", "armature_current", "load_torque"} <= set(sight.names)
    for name, seen in zip(("time", *sight.names), rows.T, strict=True):
        expected = np.sort(times) if name == "time" else result.at(name, np.sort(times))
        np.testing.assert_allclose(seen, expected, rtol=1e-9, atol=1e-12, err_msg=name)


def test_a_switch_has_a_point_before_and_one_after():
    model, command = st.PulseServo(st.load_servo(ANALOG)), st.signals.step(10.0, 40.0, at=0.03, unit="deg")
    sim, record = st.Simulator(model), Record([], [])
    sim.recorded(sim.initial(command), 0.2, command, record)
    sight, times = Sight(model), switches(record.segments)
    rows = sight.points(sim.plan(command), record.segments, sorted([*times, *times]))
    volts = 1 + sight.names.index("armature_voltage")
    assert len(times) == 8
    assert all(abs(after[volts] - before[volts]) > 1.0 for before, after in zip(rows[::2], rows[1::2], strict=True))
