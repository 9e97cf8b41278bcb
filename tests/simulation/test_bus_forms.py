"""`simulate_bus` in plain Python and compiled, on short tapes and through long times: it is always the same."""

import numpy as np
import pytest

import servotwin as st
from servotwin.models.engine.bus import bus_records
from servotwin.models.engine.bus.bus_records import Tape
from servotwin.simulation import bus_run
from servotwin.simulation.compile import Recipe, is_compiled

BATTERY = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.4)
REGULATOR = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.2, current_limit=1.4)
CASES = {
    "plain": ({}, st.loads.Constant(0.1), BATTERY, st.PulseServo),
    "coasting, coupled": ({"electronics.off_state": "coast", "electronics.supply_coupling": 0.02,
                           "potentiometer.noise": 1e-3,
                           "electronics.pulse_timeout": 0.015, "electronics.silence_state": "brake"},
                          st.loads.Recorded([0.0, 0.05, 1.0], [0.0, 0.1, 0.1]), BATTERY, st.PulseServo),
    "regulated, inductive": ({"motor.armature_inductance": 1e-3}, st.loads.Inertia(1e-3), REGULATOR,
                             st.PulseServoInductive),
    "pendulum, play": ({"gear.backlash": 0.01, "gear.output_inertia": 5e-4},
                       st.loads.Pendulum(mass=0.1, length=0.1), BATTERY, st.PulseServo),
}
SIGNALS = ("output_angle", "output_speed", "armature_current", "supply_current", "error_time")


def fleet_of(servo, name):
    changes, load, supply, model = CASES[name]
    model = model(servo.replace(changes))
    trains = st.signals.pulse_train([0.003 + 0.018 * k for k in range(9)], [1900.0, 1250.0, 1500.0] * 3)
    steps = [st.signals.step(a, b, at=0.03, unit="deg") for a, b in ((10.0, 60.0), (90.0, 40.0))]
    return st.simulate_bus({str(k): (model, signal, load) for k, signal in enumerate((*steps, trains))}, supply=supply,
                           duration=0.15, output_step=0.01, seed=2**65 + 7)


def same(one, other, tolerance):
    np.testing.assert_allclose(one.bus_voltage, other.bus_voltage, rtol=0.0, atol=tolerance)
    for a, b in zip(one.values(), other.values(), strict=True):
        for name in SIGNALS:
            np.testing.assert_allclose(a[name], b[name], rtol=tolerance, atol=tolerance, err_msg=name)
        assert [event.kind for event in a.events] == [event.kind for event in b.events]
        np.testing.assert_allclose([event.time for event in a.events], [event.time for event in b.events], rtol=0.0,
                                   atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_compiled_a_fleet_is_what_it_is_in_plain_python(servo, monkeypatch, name):
    monkeypatch.setattr(bus_run, "COMPILES_FROM", 1e99)
    monkeypatch.setattr(bus_run, "LOADS_FROM", 1e99)
    monkeypatch.setattr(bus_run, "_frames_run", {})  # earlier fleets of this process count no more
    plain = fleet_of(servo, name)
    assert np.isfinite(plain.bus_voltage).all()  # found now, and kept
    monkeypatch.setattr(bus_run, "COMPILES_FROM", 0.0)
    compiled = fleet_of(servo, name)
    same(compiled, plain, 1e-12 if name == "plain" else 1e-10)
    assert compiled.energy.residual == pytest.approx(plain.energy.residual, abs=1e-10)
    assert compiled.bus_voltage.min() < 5.0


@pytest.mark.parametrize("name", CASES)
def test_a_run_that_fills_many_tapes_is_the_same(servo, monkeypatch, name):
    usual = fleet_of(servo, name)
    rows = 60
    monkeypatch.setattr(bus_run, "tape_of", lambda _, plain: Tape(
        [None] * rows if plain else np.empty(rows, bus_run.ROW),
        np.empty((rows, bus_records.EVENT)), np.empty(60 * rows), np.zeros(3, np.int64)))
    same(fleet_of(servo, name), usual, 1e-10)


def test_clocks_that_count_anew_show_in_nothing(servo):
    """After sixteen seconds times count from later on; on a source that nobody pulls down each is as if alone."""
    model, END = st.PulseServo(servo), 18.0
    servos = {name: (model, st.signals.step(20.0, angle, at=at, unit="deg"))
              for name, angle, at in (("a", 50.0, 15.99), ("b", 80.0, 16.001))}
    stiff = st.Supply(open_circuit_voltage=servo.supply.open_circuit_voltage)
    times = [15.0, 16.05, 16.1, END]
    fleet = st.simulate_bus(servos, supply=stiff, duration=END, output_times=times)
    own = st.PulseServo(servo.replace({"supply.internal_resistance": 0.0}))
    for name, (_, command) in servos.items():
        alone = st.simulate(own, command, duration=END, output_times=times)
        np.testing.assert_allclose(fleet[name]["output_angle"], alone["output_angle"], rtol=0.0, atol=1e-11)
        assert np.ptp(alone["output_angle"]) > 0.3


def test_what_was_never_compiled_is_not(tmp_path, monkeypatch):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path))
    assert not is_compiled(Recipe("nothing", ()))
