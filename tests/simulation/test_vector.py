"""Many servos that stop and go on: the same as one that does, however time is cut, and whatever is changed between."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from conftest import EVERYTHING
from servotwin.errors import CommandError, InputError, ServotwinError, UnknownNameError
from servotwin.models.engine.memory import memory_of, time_of
from servotwin.physics.pieces import Piece, Pieces
from servotwin.simulation.engine import State
from servotwin.simulation.lanes.lane_threads import ThreadedLanes
from vector_cases import CASES, INDUCTIVE, INTEGRATED, WIDTHS, model_of


def one(model, load, seed, cuts, widths, torques=None):
    """Return states of one servo at `cuts` [s], where width and torque change."""
    sim = st.Simulator(model, load, seed)
    state = sim.initial(st.signals.constant(1500.0, unit="us"))
    states = []
    for k, until in enumerate(cuts):
        command = st.signals.constant(1e6 * widths[k % len(widths)], unit="us")
        state = sim.advance(state, until, command, external_torque=0.0 if torques is None else torques[k])
        states.append(state)
    return sim, states


NO_TORQUE = st.loads.Recorded([0.0, 99.0], [0.0, 0.0])  # recorded: lanes go one by one


@pytest.mark.long(but="PulseServo-coasting, with noise")
@pytest.mark.parametrize(("kind", "name"), [
    *((st.PulseServo, name) for name in CASES), *((st.PulseServoInductive, name) for name in INDUCTIVE)])
def test_it_is_many_simulators(servo, kind, name):
    changes, load = CASES[name]
    model = model_of(servo, changes, kind)
    near = 1e-9 if name in INTEGRATED and kind is st.PulseServo else 1e-12
    rng = np.random.default_rng(3)
    cuts = np.sort(rng.uniform(0.0, 0.4, 60))
    torques = np.repeat(rng.uniform(-0.05, 0.05, 12), 5)
    sims = st.VectorSimulator(model, 3, load=load, seed=11)
    sims.reset(pulse_width=1500e-6)
    every = [np.roll(WIDTHS, -lane) for lane in range(3)]
    alone = [one(model, load, 11 + lane, cuts, np.repeat(every[lane], 20), torques) for lane in range(3)]
    before = 0.0
    for k, until in enumerate(cuts):
        sims.advance(until - before, pulse_width=[every[lane][k // 20 % 3] for lane in range(3)],
                     external_torque=torques[k])
        before = until
        for signal in (place.name for place in model.states):
            np.testing.assert_allclose(sims[signal], [states[k][signal] for _, states in alone], rtol=near, atol=near)
    np.testing.assert_allclose(sims.time, cuts[-1], rtol=1e-12)
    last = [st.signals.constant(1e6 * every[lane][59 // 20 % 3], unit="us") for lane in range(3)]
    for signal in set(model.available) - {"command_voltage"}:
        expected = [sim.observe(states[-1], signal, last[lane], external_torque=torques[-1])
                    for lane, (sim, states) in enumerate(alone)]
        np.testing.assert_allclose(sims[signal], expected, rtol=1e-9, atol=1e-10, err_msg=signal)


@pytest.mark.long(but="worn potentiometer-PulseServo-float64")
@pytest.mark.parametrize(("kind", "dtype"), [(st.PulseServo, "float64"), (st.PulseServo, "float32"),
                                             (st.PulseServoInductive, "float64"), (st.BoundedServo, "float64")])
@pytest.mark.parametrize("name", CASES)
def test_every_signal_is_that_of_a_simulator_that_stands_there(servo, name, kind, dtype):
    changes, load = CASES[name]
    model = model_of(servo, changes, kind)
    sim = st.Simulator(model, load)
    sims = st.VectorSimulator(model, 5, load=load, dtype=dtype)
    sims.reset(output_angle=[1.2, 1.9, 1.5, 1.5, 1.5])  # two rest on a stop where there are some
    widths, torques = np.array([1.0e-3, 2.0e-3, 1.2e-3, 1.8e-3, 1.5e-3]), np.array([0.1, -0.1, 0.0, 0.02, 0.0])
    for duration in (0.0, 0.011, 0.013, 1e-4, 0.031, 0.2):
        sims.advance(duration, pulse_width=widths, external_torque=torques)
        seen = {signal: sims[signal] for signal in model.available}
        for lane, record in enumerate(sims.save().records):
            memory = memory_of(record, ())
            state = State(time_of(memory), model.states, memory)
            command = st.signals.constant(1e6 * widths[lane], unit="us")
            for signal, values in seen.items():
                expected = sim.observe(state, signal, command, external_torque=torques[lane])
                assert values[lane] == pytest.approx(expected, rel=1e-12, abs=1e-12), (signal, lane, duration)
        widths = np.roll(widths, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plain", "coasting, with noise", "frames as short as pulses", "stops"])
def test_a_thousand_cuts(servo, name):
    changes, load = CASES[name]
    model = model_of(servo, changes)
    cuts = np.sort(np.random.default_rng(8).uniform(0.0, 3.0, 1000))
    every = np.repeat(WIDTHS, 334)
    sims, sim = st.VectorSimulator(model, 1, load=load), st.Simulator(model, load)
    sims.reset(pulse_width=1500e-6)
    state = sim.initial(st.signals.constant(1500.0, unit="us"))
    for k, (before, until) in enumerate(zip((0.0, *cuts), cuts, strict=False)):
        sims.advance(until - before, pulse_width=every[k])
        if k % 334 == 333:  # here the width changes: one run for the other
            state = sim.advance(state, until, st.signals.constant(1e6 * every[k], unit="us"))
            np.testing.assert_allclose(sims["output_angle"], state["output_angle"], rtol=0.0, atol=1e-12)
            np.testing.assert_allclose(sims["output_speed"], state["output_speed"], rtol=1e-10, atol=1e-10)


@pytest.mark.long(but="BoundedServo")
@pytest.mark.parametrize("kind", [st.PulseServoInductive, st.BoundedServo])
def test_the_other_models(servo, kind):
    model = model_of(servo, {}, kind)
    cuts = np.arange(1, 101) * 2e-3
    sims = st.VectorSimulator(model, 2)
    sims.reset(pulse_width=1500e-6)
    for k in range(100):
        sims.advance(2e-3, pulse_width=WIDTHS[k // 40])
    _, states = one(model, None, 0, cuts, np.repeat(WIDTHS, 40))
    for place in model.states:
        np.testing.assert_allclose(sims[place.name], states[-1][place.name], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("load", [None, NO_TORQUE], ids=["side by side", "one by one"])
def test_twenty_ticks_are_a_frame(servo, load):
    """Twenty times 1 ms is more than 20 ms by a rounding: the pulse at that edge is still the one of the next call."""
    idle = st.PulseServo(servo.replace({"electronics.deadband": 5e-3}))  # it measures, and never drives
    sims = st.VectorSimulator(idle, 1, load=load)
    sims.reset(output_angle=1.0)
    errors = []
    for frame in range(600):
        for _ in range(20):
            sims.advance(1e-3, pulse_width=1e-3 + 1e-6 * frame)
        errors.append(sims["error_time"][0])
    np.testing.assert_allclose(np.diff(errors), 1e-6, rtol=0.0, atol=1e-15)


def test_a_state_goes_on_by_the_numbers_of_another_simulator(servo):
    """A motion that has begun does not go on under a load that is no longer the same."""
    model, command = st.BoundedServo(servo), st.signals.constant(1800.0, unit="us")
    light, heavy = st.Simulator(model), st.Simulator(model, st.loads.Inertia(5e-3))
    state = light.advance(light.initial(st.signals.constant(1500.0, unit="us")), 0.05, command)
    other = light.changed(state, parameters={"load.inertia": 5e-3})
    np.testing.assert_allclose(heavy.advance(state, 0.1, command).values, light.advance(other, 0.1, command).values,
                               rtol=1e-12)
    assert heavy.advance(state, 0.1, command).values != light.advance(state, 0.1, command).values


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plain", "pendulum"])
def test_a_million_ticks(servo, kind):
    """A servo rests before the next command, and so comes to the same three angles: alone a pendulum goes 90 s only."""
    changes, load = CASES[kind]
    model = model_of(servo, changes)
    sims = st.VectorSimulator(model, 2, load=load)
    sims.reset(pulse_width=1500e-6)
    sim = st.Simulator(model, load)
    state, alone = sim.initial(st.signals.constant(1500.0, unit="us")), []
    for k in range(100):
        for _ in range(10_000):
            sims.advance(1e-3, pulse_width=WIDTHS[k % 3])
        if kind == "plain" or k < 9:
            state = sim.advance(state, 10.0 * (k + 1), st.signals.constant(1e6 * WIDTHS[k % 3], unit="us"))
            alone.append(state["output_angle"])
        np.testing.assert_allclose(sims["output_angle"], alone[k if k < len(alone) else 6 + k % 3], rtol=0.0,
                                   atol=1e-12)
    np.testing.assert_allclose(sims.time, 1000.0, rtol=1e-13)


@pytest.mark.long(but="PulseServo-changes0")
@pytest.mark.parametrize(("kind", "changes"), [(st.PulseServo, {}), (st.PulseServo, EVERYTHING),
                                               (st.PulseServoInductive, {})])
def test_it_goes_on_from_what_was_saved(servo, kind, changes):
    model = model_of(servo, changes, kind)
    sims = st.VectorSimulator(model, 4)
    for k in range(30):
        sims.advance(0.003, pulse_width=WIDTHS[k // 10])
    memory = pickle.loads(pickle.dumps(sims.save()))
    ends = []
    for one_of in (sims, st.VectorSimulator(model, 4)):
        one_of.restore(memory)
        for _ in range(30):
            one_of.advance(0.003, external_torque=0.02)
        ends.append(one_of["output_angle"])
    np.testing.assert_allclose(ends[0], ends[1], rtol=0.0, atol=1e-12)
    sims.restore(memory, lanes=[False, True, False, True])
    np.testing.assert_array_equal(sims["output_angle"][::2], ends[0][::2])
    for _ in range(30):
        sims.advance(0.003, external_torque=0.02)
    np.testing.assert_allclose(sims["output_angle"][1::2], ends[0][1::2], rtol=0.0, atol=1e-12)
    assert np.ptp(WIDTHS) > 0.0
    assert pickle.dumps(memory) == pickle.dumps(memory)


def test_lanes_are_reset_on_their_own(servo):
    model = model_of(servo, {"potentiometer.noise": 1e-3})
    sims = st.VectorSimulator(model, 3, seed=2)
    sims.reset(pulse_width=1500e-6)
    for _ in range(37):
        sims.advance(1e-3, pulse_width=1800e-6)
    others = sims["output_angle"][[0, 2]]
    sims.reset(pulse_width=[1300e-6], lanes=[False, True, False])
    assert sims.time.tolist() == pytest.approx([0.037, 0.0, 0.037], abs=1e-12)
    np.testing.assert_array_equal(sims["output_angle"][[0, 2]], others)
    rest = st.Simulator(model).initial(st.signals.constant(1300.0, unit="us"))["output_angle"]
    assert sims["output_angle"][1] == pytest.approx(rest, abs=1e-12)
    sims.reset(output_angle=[1.0, 1.1], lanes=[0, 2])
    np.testing.assert_allclose(sims["output_angle"][[0, 2]], [1.0, 1.1])
    noise = []
    for _ in range(2):  # another stretch of the same noise
        sims.reset(pulse_width=1500e-6)
        sims.advance(0.015)
        noise.append(sims["error_time"])
    assert not np.array_equal(*noise)


@pytest.mark.long(but="PulseServo")
@pytest.mark.parametrize("kind", [st.PulseServo, st.PulseServoInductive])
def test_threads_and_neighbours_change_nothing(servo, kind):
    model = model_of(servo, {}, kind)
    rng = np.random.default_rng(1)
    widths = rng.uniform(1.1e-3, 1.9e-3, (5, 20_000))
    ends = []
    for threads in (1, 3):
        sims = st.VectorSimulator(model, 20_000, threads=threads)
        for row in widths:
            sims.advance(0.013, pulse_width=row)
        ends.append(sims["output_angle"])
    few = st.VectorSimulator(model, 3)
    for row in widths:
        few.advance(0.013, pulse_width=row[1000:1003])
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0][1000:1003], few["output_angle"])


@pytest.mark.long
def test_float32_follows(servo):
    model = st.PulseServo(servo)
    ends = []
    for dtype in ("float64", "float32"):
        sims = st.VectorSimulator(model, 200, dtype=dtype)
        sims.reset(pulse_width=1500e-6)
        for _ in range(100):
            sims.advance(0.004, pulse_width=np.linspace(1.2e-3, 1.8e-3, 200))
        ends.append(sims["output_angle"])
    assert np.abs(ends[0] - ends[1]).max() < 1e-4


# --- what is imposed --------------------------------------------------------------------------------------------------


@pytest.mark.long(but="rigid")
@pytest.mark.parametrize("changes", [{}, {"gear.backlash": 0.02, "gear.output_inertia": 1e-3}], ids=["rigid", "play"])
def test_a_speed_that_is_set_is_an_impulse(servo, changes):
    model = model_of(servo, changes)
    sims = st.VectorSimulator(model, 2, load=st.loads.Inertia(2e-3))
    sims.reset(pulse_width=1500e-6)
    before = sims["motor_speed"].copy()
    sims.set(output_speed=[3.0], lanes=[1])
    plant = model.pack(st.loads.as_load(st.loads.Inertia(2e-3)))
    J = plant.shaft.J_out if changes else plant.shaft.J
    np.testing.assert_allclose(sims.impulse_work, [0.0, 0.5 * J * 9.0])
    assert sims["output_speed"].tolist() == [0.0, 3.0]
    if changes:
        np.testing.assert_array_equal(sims["motor_speed"], before)
    sims.advance(0.005)
    assert sims["output_angle"][1] > sims["output_angle"][0]


@pytest.mark.parametrize("load", [None, st.loads.Spring(1e-3)], ids=["side by side", "one by one"])
def test_an_angle_that_is_set_carries_the_potentiometer_along(servo, load):
    model = st.PulseServo(servo.replace({"potentiometer.backlash": 0.02}))
    sims = st.VectorSimulator(model, 3, load=load)
    sims.reset(output_angle=1.5)
    sims.set(output_angle=[1.2, 1.505, 1.9])
    p, b_o = servo.potentiometer.feedback_gain, servo.potentiometer.feedback_offset or 0.0
    np.testing.assert_allclose(sims["feedback_voltage"], p * np.array([1.21, 1.5, 1.89]) + b_o, rtol=1e-12)


def test_an_inertia_that_is_set_is_that_of_the_load(servo):
    model = st.PulseServo(servo)
    imposed = st.VectorSimulator(model, 2)
    imposed.set(load_inertia=[1e-3, 5e-3])
    given = st.VectorSimulator(model, 2, parameters={"load.inertia": [1e-3, 5e-3]})
    for sims in (imposed, given):
        sims.reset(pulse_width=1500e-6)
        sims.advance(0.1, pulse_width=1800e-6)
    np.testing.assert_allclose(imposed["output_angle"], given["output_angle"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(imposed["load_torque"], given["load_torque"], rtol=1e-9, atol=1e-12)


def test_a_bus_voltage_that_is_set_is_the_supply(servo):
    weak = servo.replace({"supply.internal_resistance": 0.5})
    imposed = st.VectorSimulator(st.PulseServo(weak), 2)
    imposed.set(bus_voltage=[4.8, 6.0])
    stiff = st.VectorSimulator(st.PulseServo(servo), 2, parameters={"supply.open_circuit_voltage": [4.8, 6.0],
                                                                   "supply.internal_resistance": 0.0})
    for sims in (imposed, stiff):
        sims.reset(pulse_width=1500e-6)
        sims.advance(0.05, pulse_width=1800e-6)
    np.testing.assert_allclose(imposed["output_angle"], stiff["output_angle"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(imposed["armature_current"], stiff["armature_current"], rtol=1e-9, atol=1e-12)
    assert imposed["bus_voltage"].tolist() == [4.8, 6.0]


def test_a_bus_voltage_limits_a_servo_of_mean_voltage(servo):
    bounded = st.PulseServo(servo.replace({"supply.bridge_drop_voltage": 0.3})).averaged()
    imposed = st.VectorSimulator(bounded, 3)
    imposed.set(bus_voltage=[4.8, 0.2], lanes=[0, 2])  # the second is below the drop of the bridge
    given = st.VectorSimulator(bounded, 2, parameters={"supply.open_circuit_voltage": [4.8, 6.0]})
    for sims in (imposed, given):
        sims.reset(command_angle=0.3)
        sims.advance(0.1, command_angle=1.3)
    np.testing.assert_allclose(imposed["output_angle"][:2], given["output_angle"], rtol=0.0, atol=1e-12)
    assert imposed["output_angle"][2] == pytest.approx(0.3)
    assert not imposed.status.any()


@pytest.mark.long(but="limp after a while")
@pytest.mark.parametrize("name", CASES)
def test_a_memory_under_other_numbers_goes_on_from_where_it_stood(servo, name):
    """A motion that had begun with another inertia is not taken up again: the shaft would jump."""
    changes, load = CASES[name]
    sims = st.VectorSimulator(model_of(servo, changes), 2, load=load)
    sims.reset(pulse_width=1200e-6)
    sims.advance(0.0537, pulse_width=1900e-6)
    memory, angle, speed = sims.save(), sims["output_angle"], sims["output_speed"]
    other = st.VectorSimulator(model_of(servo, changes), 2, load=load)
    for one in (sims, other):
        one.set(load_inertia=0.5, lanes=[1])
        one.restore(memory)
        one.advance(1e-6)
        assert np.abs(one["output_angle"] - angle).max() < 1e-4
        assert np.abs(one["output_speed"] - speed)[1] < 0.02


@pytest.mark.long(but="frames as short as pulses")
@pytest.mark.parametrize("name", CASES)
def test_what_is_imposed_in_place_is_what_a_new_start_would_take(servo, name):
    """Inertias and voltages of some lanes at every tick, as another simulator would; a parameter builds all anew."""
    changes, load = CASES[name]
    model, rng = model_of(servo, changes), np.random.default_rng(5)
    in_place, anew = (st.VectorSimulator(model, 4, load=load, seed=3) for _ in range(2))
    for sims in (in_place, anew):
        sims.reset(pulse_width=1500e-6)
    for k in range(12):
        lanes = rng.permutation(4)[:3]
        inertia, bus = rng.uniform(5e-4, 4e-3, 3), rng.choice([0.1, 5.0, 5.7, 7.0], 3)
        for sims in (in_place, anew):
            sims.set(load_inertia=inertia, lanes=lanes)
            if k % 3 == 0:
                sims.set(bus_voltage=bus, lanes=lanes)
        anew.set(parameters={"motor.rotor_inertia": servo.motor.rotor_inertia}, lanes=lanes)
        for sims in (in_place, anew):
            sims.advance(0.017, pulse_width=1800e-6 if k % 2 else 1300e-6)
        for signal in ("output_angle", "output_speed", "armature_current", "bus_voltage"):
            np.testing.assert_allclose(in_place[signal], anew[signal], rtol=1e-12, atol=1e-12, err_msg=f"{signal} {k}")


def test_a_bus_voltage_that_is_set_is_that_of_its_lane_alone(servo):
    model = st.PulseServo(servo.replace({"supply.internal_resistance": 0.5, "electronics.off_state": "coast"}))
    partly, free, fed = (st.VectorSimulator(model, 2) for _ in range(3))
    partly.set(bus_voltage=4.8, lanes=[0])
    fed.set(bus_voltage=4.8)
    for sims in (partly, free, fed):
        sims.reset(pulse_width=1500e-6)
        sims.advance(0.05, pulse_width=1800e-6)
    for signal in model.available:
        np.testing.assert_array_equal(partly[signal], [fed[signal][0], free[signal][1]], err_msg=signal)
    assert partly["bus_voltage"][0] == 4.8


ACTS = {
    "time goes on": lambda s, memory: s.advance(1e-3),
    "another command, no time": lambda s, memory: s.advance(0.0, pulse_width=1.2e-3),
    "reset": lambda s, memory: s.reset(),
    "a speed that is set": lambda s, memory: s.set(output_speed=-3.0),
    "another number": lambda s, memory: s.set(parameters={"motor.armature_resistance": 9.0}),
    "restored": lambda s, memory: s.restore(memory),
}


@pytest.mark.parametrize("act", ACTS)
def test_what_is_seen_is_seen_anew_after(servo, act):
    sims = st.VectorSimulator(st.BoundedServo(servo), 1)
    memory = sims.save()
    sims.advance(0.02, pulse_width=1.8e-3)
    before = sims["armature_current"]
    assert sims["armature_current"] == before
    ACTS[act](sims, memory)
    assert sims["armature_current"] != before


@pytest.mark.parametrize("load", [None, NO_TORQUE], ids=["side by side", "one by one"])
@pytest.mark.parametrize("period", [0.012, 0.033])
def test_frames_change_their_length_while_memory_goes_on(servo, load, period):
    changes = {"electronics.frame_period": period}
    model, command = st.PulseServo(servo), st.signals.constant(1800.0, unit="us")
    sim, sims = st.Simulator(model, load), st.VectorSimulator(model, 2, load=load)
    state = sim.advance(sim.initial(st.signals.constant(1500.0, unit="us")), 0.113, command)
    sims.reset(pulse_width=1500e-6)
    sims.advance(0.113, pulse_width=1800e-6)
    sims.set(parameters=changes, lanes=[1])
    for state_of, lane in ((state, 0), (sim.changed(state, parameters=changes), 1)):
        end = sim.advance(state_of, 0.113 + 5 * 0.04, command)
        if lane == 0:
            for _ in range(5):
                sims.advance(0.04)
        assert sims["output_angle"][lane] == pytest.approx(end["output_angle"], abs=1e-12)
        assert sims["error_time"][lane] == pytest.approx(sim.observe(end, "error_time", command), abs=1e-12)
    assert sims.time.tolist() == pytest.approx([0.313, 0.313], abs=1e-12)
    assert sims["error_time"][0] != sims["error_time"][1]


@pytest.mark.long(but="plain")
@pytest.mark.parametrize("more", [{}, {"gear.backlash": 0.01, "gear.output_inertia": 1e-3}], ids=["plain", "play"])
def test_numbers_change_while_memory_goes_on(servo, more):
    changes = {"electronics.deadband": 20e-6, "load.torque": 0.2, "electronics.stretcher_gain": 90.0}
    model = model_of(servo, more)
    sim, command = st.Simulator(model), st.signals.constant(1800.0, unit="us")
    state = sim.advance(sim.initial(st.signals.constant(1500.0, unit="us")), 0.113, command)
    other = sim.changed(state, parameters=changes)
    sims = st.VectorSimulator(model, 2)
    sims.reset(pulse_width=1500e-6)
    sims.advance(0.113, pulse_width=1800e-6)
    sims.set(parameters=changes, lanes=[1])
    sims.advance(0.3)
    ends = [sim.advance(one_of, 0.413, command)["output_angle"] for one_of in (state, other)]
    np.testing.assert_allclose(sims["output_angle"], ends, rtol=0.0, atol=1e-12)
    assert ends[0] != ends[1]
    assert pickle.loads(pickle.dumps(other)) == other


def test_a_changed_state_has_the_signals_of_its_numbers(servo):
    sim, command = st.Simulator(st.PulseServo(servo)), st.signals.constant(1800.0, unit="us")
    state = sim.advance(sim.initial(command), 0.5, command)
    hung = sim.changed(state, parameters={"load.torque": 0.3})
    assert sim.observe(state, "load_torque", command) == pytest.approx(0.0, abs=1e-12)
    assert sim.observe(hung, "load_torque", command) == pytest.approx(0.3)
    assert sim.observe(state, "load_torque", command, external_torque=0.1) == pytest.approx(0.1)
    with pytest.raises(UnknownNameError):
        sim.observe(state, "oil_pressure", command)
    with pytest.raises(UnknownNameError):
        sim.changed(state, parameters={"electronics.colour": 1.0})


# --- bad input --------------------------------------------------------------------------------------------------------

BAD = {
    "negative step": (lambda s: s.advance(-1e-3), "advance"),
    "no number": (lambda s: s.advance(float("nan")), "advance"),
    "shape": (lambda s: s.advance(1e-3, pulse_width=[1.5e-3] * 4), "pulse_width"),
    "nan in a lane": (lambda s: s.advance(1e-3, pulse_width=[1.5e-3, np.nan, 1.5e-3]), "lane 1"),
    "a pulse of 0": (lambda s: s.advance(1e-3, pulse_width=[1.5e-3, 1.5e-3, 0.0]), "lane 2"),
    "longer than a frame": (lambda s: s.advance(1e-3, pulse_width=0.021), "pulse width"),
    "angle beyond": (lambda s: s.advance(1e-3, command_angle=[0.1, 0.2, 99.0]), "lane 2"),
    "two commands": (lambda s: s.advance(1e-3, pulse_width=1.5e-3, command_angle=0.1), "command"),
    "torque of nan": (lambda s: s.advance(1e-3, external_torque=[0.0, 0.0, np.nan]), "external_torque of lane 2"),
    "masked": (lambda s: s.advance(1e-3, pulse_width=np.ma.masked_array([1.5e-3] * 3, [0, 1, 0])), "masked"),
    "no time": (lambda s: s.advance(None), "advance"),
    "years": (lambda s: s.advance(1e9), "advance"),
    "a word": (lambda s: s.advance(1e-3, pulse_width="long"), "pulse_width"),
    "unknown signal": (lambda s: s["oil_pressure"], "oil_pressure"),
    "lane out of range": (lambda s: s.reset(lanes=[3]), "lanes"),
    "mask too short": (lambda s: s.reset(lanes=[True]), "lanes"),
    "angle beyond a stop": (lambda s: s.set(output_angle=[99.0], lanes=[1]), "lane 1"),
    "negative inertia": (lambda s: s.set(load_inertia=[0.0, -1.0, 0.0]), "load_inertia of lane 1"),
    "no voltage": (lambda s: s.set(bus_voltage=0.0), "bus_voltage of lane 0"),
    "unknown parameter": (lambda s: s.set(parameters={"motor.colour": 1.0}), "colour"),
    "impossible parameter": (lambda s: s.set(parameters={"motor.armature_resistance": [3.0, -3.0, 3.0]}), "lane 1"),
    "torque_enable": (lambda s: s.set(torque_enable=True), "torque_enable"),
    "memory of nothing": (lambda s: s.restore(None), "restore"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_said_before_any_lane_moves(servo, name):
    call, word = BAD[name]
    sims = st.VectorSimulator(st.PulseServo(servo), 3)
    sims.advance(0.01, pulse_width=1.6e-3)
    before = pickle.dumps(sims.save())
    with pytest.raises(ServotwinError) as caught:
        call(sims)
    assert word in str(caught.value)
    assert "\n" not in str(caught.value)
    assert pickle.dumps(sims.save()) == before


def test_a_memory_belongs_to_its_model(servo):
    memory = st.VectorSimulator(st.BoundedServo(servo), 3).save()
    with pytest.raises(InputError, match="3 lanes of BoundedServo"):
        st.VectorSimulator(st.PulseServo(servo), 3).restore(memory)
    with pytest.raises(InputError, match="2 lanes of BoundedServo"):
        st.VectorSimulator(st.BoundedServo(servo), 2).restore(memory)


@pytest.mark.parametrize(("lanes", "more"), [(0, {}), (2.5, {}), (10**12, {}), (2, {"bus": 6.0}), (2, {"threads": 0}),
                                             (2, {"parameters": {"load.inertia": [1e-3] * 3}}), (2, {"dtype": "int8"})])
def test_what_cannot_be_built(servo, lanes, more):
    with pytest.raises(InputError):
        st.VectorSimulator(st.PulseServo(servo), lanes, **more)


def test_a_recorded_load_that_ends_is_said_before_it_does(servo):
    sims = st.VectorSimulator(st.PulseServo(servo), 2, load=st.loads.Recorded([0.0, 0.05], [0.0, 0.1]))
    sims.advance(0.05)
    with pytest.raises(InputError, match="lane 0"):
        sims.advance(1e-3)
    assert sims.time.tolist() == pytest.approx([0.05, 0.05])


def test_motors_and_what_is_no_model_are_refused(servo):
    for model in (st.DCMotor(servo.replace({"motor.armature_inductance": 5e-4})), 3):
        with pytest.raises(InputError, match="AveragedServo or AveragedServoInductive or BoundedServo or PulseServo"):
            st.VectorSimulator(model, 2)


@pytest.mark.long
@pytest.mark.parametrize("kind", [st.AveragedServo, st.AveragedServoInductive])
def test_averaged_servos_are_many_simulators_too(servo, kind):
    model = kind(servo.replace({"motor.armature_inductance": 5e-4}))
    sims, sim, command = st.VectorSimulator(model, 2), st.Simulator(model), st.signals.constant(1.2, unit="rad")
    sims.reset(command_angle=0.4)
    state = sim.initial(st.signals.constant(0.4, unit="rad"))
    for k in range(1, 101):
        sims.advance(1e-3, command_angle=1.2)
        state = sim.advance(state, k * 1e-3, command)
    for name in ("output_angle", "output_speed", "armature_current"):
        np.testing.assert_allclose(sims[name], sim.observe(state, name, command), rtol=1e-9, atol=1e-9)
    assert sims["output_angle"][0] > 0.6


def test_bounded_servos_refuse_pulses_that_the_chip_does(servo):
    sims = st.VectorSimulator(st.BoundedServo(servo), 2)
    with pytest.raises(CommandError, match="lane 1"):
        sims.advance(1e-3, pulse_width=[1.5e-3, 4e-3])


def test_a_lane_that_fails_harms_no_other(servo):
    model = st.BoundedServo(servo)
    stiff = {"load.spring.stiffness": [0.1, 1e19, 0.1]}  # it oscillates too fast to be followed
    sims = st.VectorSimulator(model, 3, load=st.loads.Spring(0.1), parameters=stiff)
    sound = st.VectorSimulator(model, 3, load=st.loads.Spring(0.1))
    for s in (sims, sound):
        s.reset(pulse_width=1500e-6)
        s.advance(0.05, pulse_width=1.7e-3)
        s.advance(0.05)
    assert sims.status.tolist()[::2] == [0, 0]
    assert sims.status[1] == st.Status.TOO_FAST.code
    assert [failure.lane for failure in sims.failures] == [1]
    for signal in ("output_angle", "output_speed", "armature_current", "load_torque", "feedback_voltage"):
        assert np.isnan(sims[signal][1])
        assert np.isfinite(sims[signal][[0, 2]]).all()
    assert sims.time.tolist() == pytest.approx([0.1, 0.0, 0.1])
    np.testing.assert_array_equal(sims["output_angle"][[0, 2]], sound["output_angle"][[0, 2]])
    sims.set(parameters={"load.spring.stiffness": 0.1})
    sims.reset(lanes=[1])
    sims.advance(0.05)
    assert sims.status.tolist() == [0, 0, 0]
    assert np.isfinite(sims["output_angle"]).all()


@pytest.mark.parametrize("latency", [0.0, 7e-4, 3e-3])
@pytest.mark.parametrize("tick", [1e-3, 7.3e-3, 0.02])
def test_goals_after_a_silence_are_those_of_a_stepped_goal(latency, tick):
    """A bus servo is limp when no goal has come for a while, and follows the next: in every way a goal is given."""
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({
        "firmware.signal_timeout": 0.15, "firmware.signal_loss": "limp", "firmware.bus_latency": latency}))
    load, count = st.loads.Load(inertia=1e-3, torque=0.8), round(0.9 / tick)
    changes = {0: 0.1, count // 4: 0.4, count // 2: 0.3, count // 2 + 1: 0.35, count // 2 + 2: 0.2, 3 * count // 4: 0.5}
    stepped = st.signals.constant(0.1, unit="rad")
    stepped = replace(stepped, pieces=Pieces(tuple(Piece(tick * k, goal) for k, goal in changes.items())))
    many = st.VectorSimulator(model, 2, load=load)
    many.reset(command_angle=0.1)
    threaded = ThreadedLanes(many._numbers, "float64")
    threaded.put(np.arange(2), many._store.memories())
    sim, goal, limp = st.Simulator(model, load), 0.1, 0
    whole = one = sim.initial(stepped)
    for k in range(count):
        goal = changes.get(k, goal)
        whole = sim.advance(whole, tick * (k + 1), stepped)
        one = sim.advance(one, tick * (k + 1), st.signals.constant(goal, unit="rad"))
        many.advance(tick, command_angle=goal)
        threaded.advance(tick, many._store.command, many._store.torque)
        angle = sim.observe(whole, "output_angle", stepped)
        limp += sim.observe(whole, "duty", stepped) == 0.0
        assert sim.observe(one, "output_angle", st.signals.constant(goal, unit="rad")) == angle
        assert many["output_angle"] == pytest.approx(angle, abs=1e-12)
        assert threaded.column("stand.y.q") == pytest.approx(angle, abs=1e-9)
    assert 0.1 < limp / count < 0.7


def test_each_reset_gives_a_lane_another_servo(servo):
    """By its seed and the number of its resets: whatever the number of lanes, and what others do."""
    variants = {"motor.torque_constant": np.linspace(2e-3, 5e-3, 50), "load.inertia": np.linspace(1e-4, 2e-3, 50)}
    model, lanes = st.PulseServo(servo), 40
    sims = st.VectorSimulator(model, lanes, seed=4, variants=variants)
    few = st.VectorSimulator(model, 5, seed=4, variants=variants)
    first, resets = sims.variant, np.zeros(lanes, int)
    for k in range(3):
        for each in (sims, few):
            some = np.arange(k, len(each), 2)
            each.reset(command_angle=0.5, lanes=some)
            each.advance(0.05, command_angle=0.8, external_torque=0.02)
        resets[k::2] += 1
    assert np.array_equal(few["output_angle"], sims["output_angle"][:5])
    assert np.array_equal(few.variant, sims.variant[:5])
    assert (sims.variant == first).sum() < lanes // 4
    own = st.VectorSimulator(model, lanes, seed=4, parameters={
        name: values[sims.variant] for name, values in variants.items()})
    for k in range(3):
        own.reset(command_angle=0.5, lanes=np.arange(k, lanes, 2))
        own.advance(0.05, command_angle=0.8, external_torque=0.02)
    last = np.arange(0, lanes, 2)  # since their last reset they are what they are now
    assert sims["output_angle"][last] == pytest.approx(own["output_angle"][last], abs=1e-12)


@pytest.mark.parametrize(("variants", "more", "words"), [
    ({}, {}, "^variants: got {}"), ([1.0], {}, "^variants: got"),
    ({"motor.torque_constant": 3e-3}, {}, r"^variants: motor.torque_constant: got 'an array of shape \(\)'"),
    ({"motor.torque_constant": [3e-3], "load.inertia": [1e-3, 2e-3]}, {}, r"^variants: motor\.torque_constant: got"),
    ({"motor.torque_constant": []}, {}, r"^variants: motor\.torque_constant: got"),
    ({"load.inertia": [1e-3]}, {"parameters": {"load.inertia": 1e-3}}, r"^variants: load\.inertia: got 'a"),
    ({"load.inertia": [1e-3, 2e-3, np.nan]}, {}, r"^load\.inertia of variant 2: got nan"),
    ({"load.inertia": [1e-3, -1.0]}, {}, r"^load\.inertia of variant 1: got -1\.0"),
    ({"motor.color": [1.0]}, {}, r"motor\.color")])
def test_variants_that_are_none(servo, variants, more, words):
    with pytest.raises(ServotwinError, match=words):
        st.VectorSimulator(st.PulseServo(servo), 3, variants=variants, **more)
    with pytest.raises(InputError, match=r"^variant: got 'a simulator without'"):
        _ = st.VectorSimulator(st.PulseServo(servo), 3).variant
