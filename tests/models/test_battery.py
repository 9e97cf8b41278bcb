"""One battery that every model passes, under every kind of load."""

import pickle

import numpy as np
import pytest

import servotwin as st
from conftest import FIRMWARE
from servotwin import loads
from servotwin.errors import CommandError, UnknownNameError
from servotwin.models import MODELS
from servotwin.models.outputs import SIGNALS

LOADS = {
    "free": None,
    "inertia": loads.Inertia(2e-3),
    "viscous": loads.Viscous(5e-3) + loads.Inertia(1e-3),
    "constant": loads.Constant(0.15),
    "coulomb": loads.Coulomb(0.05) + loads.Inertia(1e-3),
    "pendulum": loads.Pendulum(mass=0.2, length=0.1, hanging_angle=1.0),
    "spring": loads.Spring(0.1, 0.5),
    "recorded": loads.Recorded([0.0, 0.2, 0.5, 10.0], [0.0, 0.1, -0.1, 0.05]),
    "mixture": loads.Inertia(1e-3) + loads.Viscous(1e-3) + loads.Constant(0.05) + loads.Coulomb(0.02)
    + loads.Pendulum(mass=0.1, length=0.1) + loads.Spring(0.05),
}
COMMANDS = {
    "step": st.signals.step(0.7, 1.1, at=0.05, unit="V"),
    "ramp": st.signals.ramp(0.7, 1.6, at=0.05, over=0.3, unit="V"),
    "sine": st.signals.sine(mean=1.2, amplitude=0.3, frequency=3.0, unit="V"),
    "chirp": st.signals.chirp(mean=1.2, amplitude=0.2, start_frequency=0.5, end_frequency=6.0, duration=0.5, unit="V"),
    "prbs": st.signals.prbs(1.0, 1.3, bit_time=0.07, duration=0.6, unit="V"),
    "samples": st.signals.samples([0.0, 0.1, 0.2, 0.4], [0.8, 1.5, 1.4, 1.9], unit="V", hold="linear"),
}


# Every load and every command: loads and commands meet in nothing but the torque balance, so that each is in one case
CASES = [("free", "step"), ("inertia", "chirp"), ("viscous", "sine"), ("constant", "step"), ("coulomb", "ramp"),
         ("pendulum", "samples"), ("spring", "prbs"), ("recorded", "step"), ("mixture", "sine")]
END = 0.32  # s: a step starts, arrives and stands

each_case = pytest.mark.parametrize(("load", "command"), [(LOADS[load], COMMANDS[command]) for load, command in CASES],
                                    ids=map("-".join, CASES))


@pytest.mark.long(but="averaged-coulomb-ramp")
@each_case
def test_energy_balances_and_nothing_depends_on_the_output_step(model, load, command):
    fine = st.simulate(model, command, duration=END, load=load, output_step=0.01).raise_if_failed()
    energy = fine.energy
    turnover = abs(energy.supply) + energy.winding + abs(energy.load) + energy.friction
    assert abs(energy.residual) <= 1e-9 * max(turnover, 1e-6)
    assert energy.winding >= 0.0
    assert energy.friction >= -1e-15
    coarse = st.simulate(model, command, duration=END, load=load, output_times=[0.05, 0.3, END])
    for name in (place.name for place in model.states):
        np.testing.assert_allclose(coarse[name], fine[name][[5, 30, 32]], rtol=1e-13, atol=1e-12)


@pytest.mark.long(but="pulse-mixture-sine")
@each_case
def test_splitting_a_run_changes_nothing(model, load, command):
    sim = st.Simulator(model, load=load)
    start = sim.initial(command)
    whole = sim.advance(start, END, command)
    state = start
    for instant in np.sort(np.random.default_rng(7).uniform(0.0, END, 25)):
        state = pickle.loads(pickle.dumps(sim.advance(state, float(instant), command)))
    state = sim.advance(state, END, command)
    np.testing.assert_allclose(state.values, whole.values, rtol=1e-12, atol=1e-12)
    end = st.simulate(model, command, duration=END, load=load, output_times=[END])
    assert end[model.layout[0]][-1] == pytest.approx(whole[model.layout[0]], abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["free", "mixture"])
def test_a_thousand_splits(model, kind):
    command = COMMANDS["step"]
    sim = st.Simulator(model, load=LOADS[kind])
    whole = sim.advance(sim.initial(command), 1.0, command)
    state = sim.initial(command)
    for instant in np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 1000)):
        state = sim.advance(state, float(instant), command)
    state = sim.advance(state, 1.0, command)
    np.testing.assert_allclose(state.values, whole.values, rtol=1e-12, atol=1e-12)


@pytest.mark.long(but="averaged")
def test_the_state_is_comparable_and_survives_pickling(model):
    command = COMMANDS["step"]
    sim = st.Simulator(model, load=loads.Inertia(1e-3))
    state = sim.advance(sim.initial(command), 0.2, command)
    again = pickle.loads(pickle.dumps(state))
    assert again == state
    assert hash(again) == hash(state)
    assert sim.advance(again, 0.5, command) == sim.advance(state, 0.5, command)


def test_a_servo_starts_at_rest_at_the_zero_error_angle(servo):
    for name in ("averaged", "averaged-inductive", "bounded"):
        result = st.simulate(MODELS[name](servo), st.signals.constant(0.7, unit="V"), duration=0.05, output_step=0.01)
        assert result["output_angle"][0] == pytest.approx(result["command_angle"][0], abs=1e-12)
        assert np.ptp(result["output_angle"]) < 1e-12


def test_motors_start_at_zero_and_take_volts_alone(servo):
    for name in ("dc-motor", "geared-motor"):
        model = MODELS[name](servo)
        assert st.Simulator(model).initial(COMMANDS["step"]).values == (0.0, 0.0, 0.0)
        for unit in ("deg", "us"):
            with pytest.raises(CommandError, match="armature voltage"):
                st.simulate(model, st.signals.constant(1500.0, unit=unit), duration=0.1)


def test_initial_values_override_what_they_name(model):
    angle, speed = model.layout[:2]
    start = st.Simulator(model).initial(COMMANDS["step"], {speed: 0.5})
    assert start[speed] == 0.5
    assert start[angle] == st.Simulator(model).initial(COMMANDS["step"])[angle]
    with pytest.raises(UnknownNameError, match="drive"):
        st.Simulator(model).initial(COMMANDS["step"], {"drive": 1.0})


def test_every_signal_has_unit_and_shape(model):
    result = st.simulate(model, COMMANDS["step"], duration=0.1, output_step=0.01)
    assert set(result.units) == {"time", *model.available}
    for name in result:
        assert result[name].shape == (11,)
        assert np.isfinite(result[name]).all()
    assert set(model.signals) <= set(SIGNALS)
    with pytest.raises(KeyError, match="armature_current"):
        result["propeller_pitch"]


@pytest.mark.long(but="averaged")
def test_a_command_that_changes_mid_way_takes_effect_at_once(model):
    first, second = st.signals.constant(1.0, unit="V"), st.signals.constant(1.6, unit="V")
    sim = st.Simulator(model)
    state = sim.advance(sim.initial(first), 0.3, first)
    changed = sim.advance(state, 0.6, second)
    stepped = st.signals.step(1.0, 1.6, at=0.3, unit="V")
    whole = sim.advance(sim.initial(stepped), 0.6, stepped)
    np.testing.assert_allclose(changed.values, whole.values, rtol=1e-9, atol=1e-9)


@pytest.mark.long(but="pulse-inductive")
def test_an_external_torque_of_a_call_equals_a_constant_load(model):
    command = COMMANDS["step"]
    sim = st.Simulator(model)
    pushed = sim.advance(sim.initial(command), 0.4, command, external_torque=0.1)
    loaded = st.Simulator(model, load=loads.Constant(0.1))
    np.testing.assert_allclose(pushed.values, loaded.advance(loaded.initial(command), 0.4, command).values, atol=1e-13)


@pytest.mark.parametrize("name", [name for name, kind in MODELS.items() if "load_torque" in kind.signals])
def test_power_at_the_spindle_is_what_the_load_gets(servo, name):
    """Work of load_torque = kinetic energy of the load + its losses."""
    model = MODELS[name](servo.replace(FIRMWARE) if name == "digital" else servo)
    load = loads.Inertia(3e-3) + loads.Viscous(1e-2)
    result = st.simulate(model, st.signals.step(0.7, 1.6, at=0.05, unit="V"), duration=0.5, load=load, output_step=2e-5)
    work = np.trapezoid(result["load_torque"] * result["output_speed"], result.time)
    kinetic = 0.5 * 3e-3 * result["output_speed"][-1] ** 2
    assert work == pytest.approx(kinetic + result.energy.load, rel=2e-3, abs=1e-7)


def test_a_servo_without_a_voltage_input_has_no_command_voltage(servo, tmp_path):
    values = {}
    for name in servo.names():
        group, key = name.split(".")
        if key not in ("voltage_to_pulse_gain", "command_pulse_offset", "pulse_to_voltage_gain", "command_offset"):
            values.setdefault(group, {})[key] = servo.get(name)
    model = st.BoundedServo(st.servo_from_values("pulses-only", values))
    result = st.simulate(model, st.signals.step(1500.0, 1800.0, unit="us"), duration=0.2)
    assert "command_voltage" not in result.names
    assert result["pulse_width"][-1] == pytest.approx(1.8e-3, rel=1e-12)
    result.save(tmp_path / "run.csv")
    with pytest.raises(KeyError, match="pulse_width"):
        result["command_voltage"]
