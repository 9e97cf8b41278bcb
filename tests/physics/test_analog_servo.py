import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

LOOP = {
    "bridge_gain", "comparator_gain", "voltage_to_pulse_gain", "pulse_to_voltage_gain", "feedback_gain",
    "command_offset", "feedback_offset",
}


def _split(values):
    loop = {name: value for name, value in values.items() if name in LOOP}
    return loop, {name: value for name, value in values.items() if name not in LOOP}


def _motion(rng, size):
    q, qd, qdd, v_i = rng.uniform([[-1], [-8], [-300], [0.3]], [[4], [8], [300], [2.5]], size=(4, size))
    return q, qd, qdd, v_i


def test_equation_40_term_by_term(p, values):
    q, qd, qdd, v_i = _motion(np.random.default_rng(1), 200)
    n, k_p, F1, F2, k = 1 / p.gear_reduction, p.voltage_to_pulse_gain * p.pulse_to_voltage_gain, \
        p.coulomb_torque_forward, p.coulomb_torque_backward, p.zero_crossing_slope
    ka_R, Aks, w = p.torque_constant / p.armature_resistance, p.bridge_gain * p.comparator_gain, qd / n
    f_ec = F1 * np.tanh(k * w) * (1 + np.sign(w)) / 2 + F2 * np.tanh(k * w) * (1 - np.sign(w)) / 2
    command = ka_R * Aks * (k_p * v_i + p.command_offset) - p.rotor_inertia * qdd / n
    feedback = (ka_R * p.back_emf_constant + p.motor_viscous_friction) * qd / n
    feedback = feedback + ka_R * Aks * (p.feedback_gain * q + p.feedback_offset) + f_ec
    got = physics.spindle_torque(q, qd, qdd, v_i, **values)
    np.testing.assert_allclose(got, command / n - feedback / n, rtol=1e-11, atol=1e-10)


def test_inverse_of_forward_is_the_load_that_closed_it(values):
    q, qd, _, v_i = _motion(np.random.default_rng(2), 200)
    J_L, B_L, tau_ext = 1e-3, 2e-3, 0.3
    qdd = physics.forward_acceleration(
        q, qd, v_i, load_inertia=J_L, load_viscous_friction=B_L, external_torque=tau_ext, **values
    )
    tau_L = physics.spindle_torque(q, qd, qdd, v_i, **values)
    np.testing.assert_allclose(tau_L, J_L * qdd + B_L * qd + tau_ext, rtol=1e-10, atol=1e-10)


@given(
    q=st.floats(-1, 4), qd=st.floats(-8, 8), v_i=st.floats(0.3, 2.5), J_L=st.floats(0, 1e-2), B_L=st.floats(0, 1e-2),
    tau_ext=st.floats(-1, 1), N=st.floats(1, 400),
)
def test_forward_form_is_newtons_law_at_the_output(q, qd, v_i, J_L, B_L, tau_ext, N):
    R_a, k_a, k_b, J_m, B_m, F1, F2, k = 3.1, 4e-3, 4.3e-3, 1e-7, 2e-7, 8e-4, 1.1e-3, 0.3
    loop = {"bridge_gain": 8.0, "comparator_gain": 3.0, "voltage_to_pulse_gain": 1.09e-3,
            "pulse_to_voltage_gain": 736.0, "feedback_gain": 0.42, "command_offset": 0.1, "feedback_offset": 0.59}
    qdd = physics.forward_acceleration(
        q, qd, v_i, load_inertia=J_L, load_viscous_friction=B_L, external_torque=tau_ext, armature_resistance=R_a,
        torque_constant=k_a, back_emf_constant=k_b, rotor_inertia=J_m, motor_viscous_friction=B_m, gear_reduction=N,
        coulomb_torque_forward=F1, coulomb_torque_backward=F2, zero_crossing_slope=k, **loop,
    )
    i_a = (physics.loop_voltage(q, v_i, **loop) - k_b * N * qd) / R_a
    torque = N * k_a * i_a - (N**2 * B_m + B_L) * qd - tau_ext
    torque = torque - N * physics.smoothed_coulomb_torque(N * qd, F1, F2, k)
    assert (N**2 * J_m + J_L) * qdd == pytest.approx(torque, rel=1e-9, abs=1e-9)


@given(q=st.floats(-1, 4), qd=st.floats(-8, 8), qdd=st.floats(-300, 300), v_i=st.floats(0.3, 2.5),
       R_a=st.floats(1, 8), k=st.floats(1e-3, 1e-2), J_m=st.floats(1e-8, 1e-6), B_m=st.floats(0, 1e-6),
       N=st.floats(1, 400), F1=st.floats(0, 1e-2), F2=st.floats(0, 1e-2))
def test_power_in_is_heat_friction_kinetic_and_shaft(q, qd, qdd, v_i, R_a, k, J_m, B_m, N, F1, F2):
    loop = {"bridge_gain": 8.0, "comparator_gain": 3.0, "voltage_to_pulse_gain": 1.09e-3,
            "pulse_to_voltage_gain": 736.0, "feedback_gain": 0.42, "command_offset": 0.1, "feedback_offset": 0.59}
    tau_L = physics.spindle_torque(
        q, qd, qdd, v_i, armature_resistance=R_a, torque_constant=k, back_emf_constant=k, rotor_inertia=J_m,
        motor_viscous_friction=B_m, gear_reduction=N, coulomb_torque_forward=F1, coulomb_torque_backward=F2,
        zero_crossing_slope=0.3, **loop,
    )
    v_a = physics.loop_voltage(q, v_i, **loop)
    w = physics.motor_from_output(qd, N)
    i_a = physics.steady_armature_current(v_a, w, R_a, k)
    copper = R_a * i_a**2
    friction = B_m * w**2 + physics.smoothed_coulomb_torque(w, F1, F2, 0.3) * w
    kinetic = J_m * N * qdd * w
    shaft = tau_L * qd
    scale = abs(copper) + abs(friction) + abs(kinetic) + abs(shaft) + abs(v_a * i_a)
    assert v_a * i_a == pytest.approx(copper + friction + kinetic + shaft, abs=1e-11 * scale + 1e-12)


def test_zero_offsets_give_the_equation_as_printed(values):
    printed = {**values, "command_offset": 0.0, "feedback_offset": 0.0}
    bare = {name: value for name, value in values.items() if not name.endswith("_offset")}
    assert physics.spindle_torque(0.3, 1.0, 5.0, 0.6, **printed) == physics.spindle_torque(0.3, 1.0, 5.0, 0.6, **bare)


def test_equation_36_is_equation_37_without_coulomb_friction(values):
    _, plant = _split({**values, "coulomb_torque_forward": 0.0, "coulomb_torque_backward": 0.0})
    n, ka_R = 1 / plant["gear_reduction"], plant["torque_constant"] / plant["armature_resistance"]
    v_a, qd, qdd = 5.0, 3.0, -40.0
    damping = ka_R * plant["back_emf_constant"] + plant["motor_viscous_friction"]
    printed = (ka_R * v_a - plant["rotor_inertia"] * qdd / n) / n - damping * qd / n / n
    assert physics.driven_spindle_torque(qd, qdd, v_a, **plant) == pytest.approx(printed, rel=1e-12)


def test_equation_35_gives_the_voltage_back(values):
    _, plant = _split(values)
    free = {**plant, "coulomb_torque_forward": 0.0, "coulomb_torque_backward": 0.0}
    n, ka_R = 1 / plant["gear_reduction"], plant["torque_constant"] / plant["armature_resistance"]
    v_a, qd, qdd = 4.2, -3.0, 70.0
    tau_L = physics.driven_spindle_torque(qd, qdd, v_a, **free)
    damping = ka_R * plant["back_emf_constant"] + plant["motor_viscous_friction"]
    assert (plant["rotor_inertia"] * qdd / n + damping * qd / n + n * tau_L) / ka_R == pytest.approx(v_a, rel=1e-12)


def test_equation_34_holds_on_a_trajectory_of_the_inductive_servo(p):
    # A motion is prescribed, the laws give current and voltage, and eq. 34 must return the rate of the load torque.
    L_a, R_a, k_a, k_b, J_m, B_m = 4e-4, p.armature_resistance, p.torque_constant, 4.3e-3, p.rotor_inertia, 2e-7
    N, n = p.gear_reduction, 1 / p.gear_reduction
    t = np.linspace(0.0, 0.5, 101)
    Om, Pi = 31.0, 17.0
    qd, qdd, qddd = Om * np.cos(Om * t), -(Om**2) * np.sin(Om * t), -(Om**3) * np.cos(Om * t)
    tau_L, tau_L_rate = 0.2 * np.sin(Pi * t), 0.2 * Pi * np.cos(Pi * t)
    tau_o = physics.required_motor_torque(N * qdd, N * qd, J_m, B_m) + n * tau_L
    tau_o_rate = physics.required_motor_torque(N * qddd, N * qdd, J_m, B_m) + n * tau_L_rate
    i_a, i_a_rate = tau_o / k_a, tau_o_rate / k_a
    v_a = L_a * i_a_rate + R_a * i_a + physics.back_emf(N * qd, k_b)
    np.testing.assert_allclose(
        physics.armature_current_rate(v_a, i_a, N * qd, R_a, L_a, k_b), i_a_rate, rtol=1e-8, atol=1e-6
    )
    inner = k_a / R_a * v_a - L_a / R_a * J_m * N * qddd - (L_a / R_a * B_m + J_m) * N * qdd
    inner = inner - (k_a * k_b / R_a + B_m) * N * qd - n * tau_L
    np.testing.assert_allclose(inner * R_a / (n * L_a), tau_L_rate, rtol=1e-6, atol=1e-6)


def test_the_servo_turns_towards_its_command_and_gives_way_to_its_load(values):
    at_rest = physics.forward_acceleration(0.0, 0.0, np.array([0.55, 0.65]), **values)
    assert at_rest[0] < 0 < at_rest[1]
    pushed = physics.forward_acceleration(0.0, 0.0, 0.55, external_torque=np.array([-1.0, 0.0, 1.0]), **values)
    assert np.all(np.diff(pushed) < 0)


def test_a_reduction_of_one_is_a_motor_with_the_load_on_its_shaft(values):
    _, plant = _split({**values, "gear_reduction": 1.0})
    i_a = physics.steady_armature_current(2.0, 50.0, plant["armature_resistance"], plant["back_emf_constant"])
    tau_L = physics.driven_spindle_torque(50.0, 100.0, 2.0, **plant)
    motor = physics.required_motor_torque(100.0, 50.0, plant["rotor_inertia"], plant["motor_viscous_friction"])
    friction = physics.smoothed_coulomb_torque(
        50.0, plant["coulomb_torque_forward"], plant["coulomb_torque_backward"], plant["zero_crossing_slope"]
    )
    assert tau_L == pytest.approx(i_a * plant["torque_constant"] - motor - friction, rel=1e-12)


def test_standing_still_unpowered_the_smooth_law_lets_a_load_creep(p, values):
    _, plant = _split(values)
    damping = p.motor_viscous_friction + p.torque_constant * p.back_emf_constant / p.armature_resistance
    w = physics.creep_speed(-0.15, p.gear_reduction, p.coulomb_torque_forward, p.coulomb_torque_backward,
                            p.zero_crossing_slope, damping)
    assert w < 0
    assert physics.driven_spindle_torque(w / p.gear_reduction, 0.0, 0.0, **plant) == pytest.approx(0.15, rel=1e-9)
