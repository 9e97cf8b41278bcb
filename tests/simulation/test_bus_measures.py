"""What each chip on a bus measures and what each motor gives back, frame by frame, against the formulas."""

import math

import numpy as np
import pytest

import servotwin as st

V_OC, R_B = 6.0, 0.5
BATTERY = st.Supply(open_circuit_voltage=V_OC, internal_resistance=R_B)
PERIOD = 0.02
BETA, C_S = 0.02, 0.05


@pytest.fixture(scope="module")
def servo(servo):
    return servo.replace({"electronics.frame_period": PERIOD, "electronics.back_emf_injection": BETA,
                          "electronics.supply_coupling": C_S, "motor.brush_drop_voltage": 0.2,
                          "supply.bridge_drop_voltage": 0.3, "supply.bridge_drop_resistance": 0.4})


def late_train(widths, phase):
    """Pulses that begin a part of a frame after those of the others."""
    return st.signals.pulse_train([phase + PERIOD * k for k in range(len(widths))], widths)


def test_the_noise_of_each_servo_is_its_own(servo):
    """On a source that nobody can pull down, the k-th servo is the one that `simulate` has with the seed + k."""
    model = st.PulseServo(servo.replace({"potentiometer.noise": 2e-3, "supply.open_circuit_voltage": V_OC,
                                         "supply.internal_resistance": 0.0}))
    step = st.signals.step(20.0, 30.0, at=0.05, unit="deg")
    fleet = st.simulate_bus(dict.fromkeys("abc", (model, step)), supply=st.Supply(open_circuit_voltage=V_OC),
                            duration=0.3, output_step=0.01, seed=40)
    for k, result in enumerate(fleet.values()):
        alone = st.simulate(model, step, duration=0.3, output_step=0.01, seed=40 + k)
        np.testing.assert_allclose(result["output_angle"], alone["output_angle"], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(result["error_time"], alone["error_time"], rtol=0.0, atol=1e-15)
    a, b, c = (result["error_time"] for result in fleet.values())
    assert np.ptp(a - b) > 1e-6
    assert np.ptp(b - c) > 1e-6


@pytest.mark.parametrize("off_state", ["brake", "coast"])
def test_each_frame_measures_angle_motor_and_bus(servo, off_state):
    """T_os = T_0 + (p q + b_o + β v_m + c_s (V_bus − V_oc)) / s_r, whoever drives at the edge: no one, another, all."""
    model = st.PulseServo(servo.replace({"electronics.off_state": off_state}))
    servos = {"first": (model, late_train([1700.0, 1900.0] * 8, 0.0)),
              "while it drives": (model, late_train([1300.0, 1600.0, 2000.0, 1000.0] * 4, 0.006)),
              "and once more": (model, late_train([1500.0, 1200.0] * 8, 0.013), st.loads.Constant(0.1))}
    duration = 15 * PERIOD
    fleet = st.simulate_bus(servos, supply=BATTERY, duration=duration,
                            initial={"while it drives": {"output_speed": 2.0}})
    el, pot, driving, sagged = servo.electronics, servo.potentiometer, set(), 0
    for name, phase in (("first", 0.0), ("while it drives", 0.006), ("and once more", 0.013)):
        result, (_, command, *_) = fleet[name], servos[name]
        edges = phase + PERIOD * np.arange(1, 14)
        q, v_m, drive = (result.at(signal, edges) for signal in ("output_angle", "armature_voltage", "drive"))
        V_bus, width = fleet.bus(edges), command(edges)
        T_os = el.one_shot_offset + el.one_shot_slope * (
            pot.feedback_gain * q + pot.feedback_offset + BETA * v_m + C_S * (V_bus - V_OC))
        decided = result.at("error_time", edges + 0.95 * PERIOD)
        np.testing.assert_allclose(decided, width - T_os, rtol=0.0, atol=1e-12)
        driving |= set(drive.tolist())
        sagged += np.count_nonzero((V_bus < V_OC - 0.3) & (drive == 0.0))
    assert driving == {-1.0, 0.0, 1.0}
    assert sagged >= 5  # the neighbours pull the bus down while a chip measures whose own bridge is off


def test_a_coasting_motor_gives_back_to_a_bus_that_others_pull_down(servo):
    """A motor that turns faster than the bus has volts charges it through its diodes; the lower the bus, the more."""
    turning = st.PulseServo(servo.replace({"electronics.off_state": "coast"}))
    quiet = st.signals.pulse_train([1.0], [1500.0])  # its bridge stays off
    step = st.signals.step(0.0, 120.0, unit="deg")
    start = {"turns": {"output_speed": 9.0}}
    parts = {"turns": (turning, quiet, st.loads.Inertia(2e-2)), "pulls": (st.PulseServo(servo), step)}
    fleet = st.simulate_bus(parts, supply=BATTERY, duration=0.2, initial=start, output_step=2e-3)
    alone = st.simulate_bus({"turns": parts["turns"]}, supply=BATTERY, duration=0.2, initial=start, output_step=2e-3)
    m = servo.motor
    K_b, drop = servo.gear.gear_reduction * m.back_emf_constant, 0.3 + 0.2
    for run in (fleet, alone):
        result = run["turns"]
        over = K_b * result["output_speed"] - run.bus_voltage - drop
        current = np.maximum(over, 0.0) / m.armature_resistance  # that of the bridge is not in the diodes' way
        np.testing.assert_allclose(result["armature_current"], -current, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(result["supply_current"], result["armature_current"], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(run.bus_voltage, V_OC - R_B * run.supply_current, rtol=0.0, atol=1e-9)
        assert abs(run.energy.residual) <= 1e-9 * run.energy.winding
    given = [-np.trapezoid(run["turns"]["armature_current"], run.time) for run in (fleet, alone)]
    assert given[0] > 1.05 * given[1] > 0.01
    assert fleet.bus_voltage.max() > V_OC  # before the other drives
    assert math.isclose(float(alone.bus_voltage[-1]), V_OC, rel_tol=1e-12)


def test_the_bus_gives_no_more_than_all_take_and_nothing_at_rest(servo):
    model = st.PulseServo(servo.replace({"electronics.supply_coupling": 0.0}))  # who rests sees nothing of the other
    hold = st.signals.constant(30.0, unit="deg")
    fleet = st.simulate_bus({"a": (model, hold), "b": (model, hold)}, supply=BATTERY, duration=0.1)
    np.testing.assert_array_equal(fleet.bus_voltage, V_OC)
    np.testing.assert_array_equal(fleet.supply_current, 0.0)
    moving = st.simulate_bus({"a": (model, hold), "b": (model, st.signals.step(30.0, 60.0, unit="deg"))},
                             supply=BATTERY, duration=0.3)
    total = sum(result["supply_current"] for result in moving.values())
    np.testing.assert_allclose(moving.supply_current, total, rtol=0.0, atol=1e-15)
    for field in ("supply", "winding", "friction", "bridge"):
        parts = [getattr(result.energy, field) for result in moving.values()]
        assert getattr(moving.energy, field) == pytest.approx(sum(parts), rel=1e-12)
        assert parts[0] == 0.0


def test_a_regulator_takes_nothing_back_in_the_middle_of_a_drive(servo):
    """Where one motor returns more than another takes, a regulator keeps its voltage, and no energy is lost."""
    turning = st.PulseServo(servo.replace({"electronics.off_state": "coast"}))
    quiet = st.signals.pulse_train([1.0], [1500.0])
    fleet = st.simulate_bus(
        {"turns": (turning, quiet, st.loads.Inertia(8e-2)),
         "pulls": (st.PulseServo(servo), st.signals.step(0.0, 120.0, unit="deg"))},
        supply=st.Supply(open_circuit_voltage=V_OC, internal_resistance=R_B, current_limit=1.3), duration=0.15,
        initial={"turns": {"output_speed": 8.5}}, output_step=2e-4)
    total, V = fleet.supply_current, fleet.bus_voltage
    driven = fleet["pulls"]["drive"] == 1.0
    returned = driven & (total < -1e-3)
    assert np.any(np.diff(returned[driven].astype(int)) == 1)  # while it drives, not when it begins
    np.testing.assert_allclose(V[total < -1e-9], V_OC, rtol=1e-14)
    follows = (total > 1e-9) & (total < 1.3 - 1e-6)
    np.testing.assert_allclose(V[follows], V_OC - R_B * total[follows], rtol=0.0, atol=1e-9)
    assert total.max() <= 1.3 + 1e-9
    assert abs(fleet.energy.residual) <= 1e-9 * fleet.energy.winding
