"""What is seen of a servo along a run, all signals at once, is what its result says signal by signal."""

import numpy as np
import pytest

import servotwin as st
from servotwin.models.engine.live import stretch
from servotwin.models.engine.live.posts import NONE_BEFORE
from servotwin.models.engine.live.screen import COLUMNS, NO_LOW, USED, Looks, Screen
from servotwin.models.engine.step import COMPLETED
from servotwin.models.terms import control
from servotwin.simulation.bus_run import Endless
from servotwin.simulation.engine import RunLog
from servotwin.web.live.station import lines_of, names_of

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
def rows_of(kind, servo, values, load, rate, switches):
    """Return a result of `simulate`, and the rows of the same run by the kernel that benches go on by."""
    model = kind(st.load_servo(servo).replace(values))
    command = st.signals.step(10.0, 40.0, at=0.03, unit="deg")
    result = st.simulate(model, command, duration=0.4, load=load, seed=3)
    sim = st.Simulator(model, load=load, seed=3)
    plan, memory, screen = sim.plan(command), sim.initial(command).memory, Screen(
        Endless(), Endless(), np.zeros(USED, np.int64))
    if plan.digital:
        memory = memory._replace(firm=(control.thawed(memory.firm[0]),))
    _, _, _, status = stretch.go_on(plan.numbers, plan.chip, plan.inputs, memory, True, NONE_BEFORE, NO_LOW,
                                 Looks(1, rate, 0.4, 1, switches), lines_of(model), screen, RunLog().lists)
    assert status == COMPLETED
    return result, dict(zip(COLUMNS, np.array(screen.rows.rows).T, strict=True)), names_of(model, sim.load)


@pytest.mark.long(but="AveragedServoInductive-hitec-hs-755hb-0-7")
@pytest.mark.parametrize(("kind", "servo", "values", "load"), CASES, ids=IDS)
def test_all_signals_are_those_of_a_result(kind, servo, values, load):
    result, rows, names = rows_of(kind, servo, values, load, 97.3, 0)
    assert {"output_angle", "armature_current", "load_torque"} <= set(names)
    assert len(rows["time"]) == 39
    for name in names:
        np.testing.assert_allclose(rows[name], result.at(name, rows["time"]), rtol=1e-9, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("servo", [ANALOG, DIGITAL])
def test_a_switch_has_a_row_before_and_one_after(servo):
    kind = st.DigitalServo if servo == DIGITAL else st.PulseServo
    _, rows, _ = rows_of(kind, servo, {}, None, 1e-3, 1)
    time, volts = rows["time"][:-1].reshape(-1, 2), rows["armature_voltage"][:-1].reshape(-1, 2)
    assert len(time) > 2
    assert (time[:, 0] == time[:, 1]).all()
    jumps = np.abs(np.diff(volts, axis=1)[servo == DIGITAL:])  # a program begins without a goal, and open
    assert (jumps > (1.0 if servo == ANALOG else 0.1)).all()
