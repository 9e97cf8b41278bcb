"""What all controllers have in common, and what each is by its closed form."""

import math
import pickle

import numpy as np
import pytest

import servotwin as st
from servotwin import control
from servotwin.control import Reference
from servotwin.control.controllers import held, resting, second_rate, smoothed
from servotwin.errors import InputError

T = 1e-3
SERVO = control.inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")), st.loads.Inertia(2e-3))
PID = control.Pid(period=T, proportional_gain=20.0, integral_gain=50.0, derivative_gain=0.3, filter_rate=300.0,
                  lower=-5.0, upper=5.0)
TORQUE = control.ComputedTorque(period=T, inverse=SERVO.frictionless, bandwidth=20.0, filter_rate=300.0,
                                load_torque=control.LoadModel(st.loads.Spring(0.5)))
FORWARD = control.Feedforward(period=T, inverse=SERVO, feedback=PID)
PLAIN = control.PlainCommand(period=T)
CONTROLLERS = {
    "plain": PLAIN, "pid": PID, "feedforward": FORWARD, "computed torque": TORQUE,
    "observer": control.DisturbanceObserver(controller=TORQUE, inverse=SERVO, filter_rate=50.0),
    "ahead of the servo": control.AheadOfServo(controller=FORWARD, inverse=SERVO),
    "through the servo": control.ThroughServo(controller=TORQUE, inverse=SERVO),
    "deadband": control.DeadbandCompensation(controller=PLAIN, half_width=0.01),
    "play": control.PlayCompensation(controller=TORQUE, play=0.02),
}
SEEN = [{"time": T * k, "output_angle": 0.02 * math.sin(9.0 * k)} for k in range(30)]
ASKED = [Reference(0.01 * k, 10.0, 1.0 * k, 0.0) for k in range(30)]


@pytest.fixture(params=CONTROLLERS)
def controller(request):
    return CONTROLLERS[request.param]


def decided(controller, seen=SEEN, asked=ASKED):
    """Return the commands of some ticks, and the last state."""
    state, commands = controller.initial(seen[0], asked[0]), []
    for measured, reference in zip(seen, asked, strict=True):
        command, state = controller.step(state, reference, measured)
        commands.append(command)
    return commands, state


def test_it_is_a_controller_whose_state_is_a_value(controller):
    assert isinstance(controller, control.Controller)
    commands, state = decided(controller)
    assert all(map(math.isfinite, commands))
    copy, same = pickle.loads(pickle.dumps((controller, state)))
    assert (copy, same) == (controller, state)
    assert copy.step(same, ASKED[3], SEEN[7]) == controller.step(state, ASKED[3], SEEN[7])


def test_joints_are_controlled_as_each_alone(controller):
    shift = np.array([0.0, 0.3, -0.2])
    seen = [{**row, "output_angle": row["output_angle"] + shift} for row in SEEN]
    asked = [Reference(row.angle + shift, row.speed + 0.0 * shift, row.acceleration + 0.0 * shift, 0.0 * shift)
             for row in ASKED]
    many = np.array(decided(controller, seen, asked)[0])
    for joint, by in enumerate(shift.tolist()):
        one = decided(controller, [{**row, "output_angle": row["output_angle"] + by} for row in SEEN],
                      [row._replace(angle=row.angle + by) for row in ASKED])[0]
        assert many[:, joint] == pytest.approx(np.array(one), rel=1e-12, abs=1e-12)


def test_a_pid_is_its_equation():
    commands, state = decided(PID, SEEN[:2], [Reference(0.05, 0.4)] * 2)
    y = [row["output_angle"] for row in SEEN[:2]]
    seen = smoothed(smoothed(resting(y[0]), y[0], 300.0, T), y[1], 300.0, T)
    integral = 50.0 * T * (0.05 - y[0])
    assert commands[1] == pytest.approx(20.0 * (0.05 - y[1]) + integral + 0.3 * (0.4 - seen.rate), rel=1e-12)
    assert state.integral == pytest.approx(integral + 50.0 * T * (0.05 - y[1]), rel=1e-12)


def test_weights_take_the_reference_out_of_proportional_and_derivative():
    quiet = control.Pid(period=T, proportional_gain=20.0, derivative_gain=0.3, filter_rate=300.0, reference_weight=0.0,
                        speed_weight=0.0)
    assert decided(quiet, SEEN, ASKED)[0] == decided(quiet, SEEN, [Reference(3.0, -7.0)] * 30)[0]


def test_a_saturated_integral_stays_where_it_can_come_back_at_once():
    wound = decided(PID, [SEEN[0]] * 30000, [Reference(2.0)] * 30000)[1].integral
    # at rest k_i e + (clip(u) − u)/T_t = 0, with u = k_p e + I
    T_t = math.sqrt(0.3 / 50.0)
    assert wound == pytest.approx(5.0 + T_t * 50.0 * 2.0 - 20.0 * 2.0, rel=1e-6)


def test_the_filter_is_its_transfer_function_whatever_the_period():
    g, w, h = 80.0, 25.0, 1e-4
    state = resting(0.0)
    for k in range(1, 10001):
        state = smoothed(state, math.sin(w * h * k), g, h)
    response, phase = (g / (g + 1j * w))**2, w * h * 10000
    assert state.value == pytest.approx((response * np.exp(1j * phase)).imag, abs=1e-4)
    assert state.rate == pytest.approx((1j * w * response * np.exp(1j * phase)).imag, abs=1e-4 * w)
    assert second_rate(state, g) == pytest.approx((-w**2 * response * np.exp(1j * phase)).imag, abs=1e-4 * w**2)


def test_a_held_value_goes_through_the_filter_exactly():
    state = resting(0.0)
    for _ in range(7):
        state = held(state, 2.0, 30.0, 0.01)
    x = 30.0 * 0.07
    assert state.value == pytest.approx(2.0 * (1.0 - (1.0 + x) * math.exp(-x)), rel=1e-12)


def test_computed_torque_makes_the_acceleration_that_it_asks_for():
    measured, reference = {"output_angle": 0.2}, Reference(0.3, 0.0, 4.0)
    v = TORQUE.step(TORQUE.initial(measured, reference), reference, measured).command
    qdd = 4.0 + 20.0**2 * 0.1
    assert v == pytest.approx(SERVO.volts_per_torque * (SERVO.total_inertia * qdd + 0.5 * 0.2), rel=1e-12)


def test_an_observer_sees_the_disturbance_of_a_shaft_that_moves_steadily():
    still = control.Pid(period=T, filter_rate=100.0)  # commands nothing
    watching = control.DisturbanceObserver(controller=still, inverse=SERVO, filter_rate=80.0)
    state = watching.initial({"output_angle": 0.0}, Reference(0.0))
    c, d, w = SERVO.volts_per_torque * SERVO.damping, 0.7, 2.0
    for k in range(1, 1001):  # the shaft turns at w, which takes c w + d
        state = state._replace(last=c * w + d)
        command, state = watching.step(state, Reference(0.0), {"output_angle": w * T * k})
    assert command == pytest.approx(d, abs=1e-9)


def test_compensations_change_sides_where_the_reference_turns_and_stay_where_it_rests():
    sends = control.DeadbandCompensation(controller=PLAIN, half_width=0.01, least_speed=0.05)
    asked = [Reference(0.0, w) for w in (0.0, 0.2, 0.01, -0.04, -0.2, 0.0)]
    assert decided(sends, SEEN[:6], asked)[0] == [0.0, 0.01, 0.01, 0.01, -0.01, -0.01]


@pytest.mark.parametrize("damping_ratio", [0.0, 0.1])
@pytest.mark.parametrize(("make", "forgives"), [(control.zero_vibration, 1), (control.zero_vibration_derivative, 2)])
def test_a_shaper_leaves_nothing_to_ring(make, forgives, damping_ratio):
    def left(w, shaper):
        """The vibration that impulses leave, as a share of that of one (Singer and Seering 1990)."""
        pole = w * (-damping_ratio + 1j * math.sqrt(1.0 - damping_ratio**2))
        return abs(sum(A * np.exp(-pole * t) for t, A in zip(shaper.times, shaper.amplitudes, strict=True)))
    shaper = make(frequency=20.0, damping_ratio=damping_ratio)
    assert left(20.0, shaper) < 1e-12
    by = 0.02
    ratio = left(20.0 * (1.0 + 2.0 * by), shaper) / left(20.0 * (1.0 + by), shaper)
    assert math.log2(ratio) == pytest.approx(forgives, abs=0.1)  # how fast it grows with a wrong frequency


def test_a_shaped_path_goes_where_the_path_goes_and_rests():
    path = control.quintic([[0.0, 1.0], [1.0, 0.5]], times=[0.0, 0.4])
    shaped = control.zero_vibration_derivative(frequency=15.0).of(path)
    assert shaped.at(shaped.duration).angle == pytest.approx([1.0, 0.5], abs=1e-12)
    assert shaped.at(0.3 * np.ones(4)).speed.shape == (4, 2)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: control.PlainCommand(period=0.0), "period of PlainCommand: got 0.0"),
    (lambda: control.Pid(period=T, filter_rate=-1.0), "filter_rate of Pid"),
    (lambda: control.Pid(period=T, filter_rate=1.0, proportional_gain=math.nan), "proportional_gain of Pid"),
    (lambda: control.Pid(period=T, filter_rate=1.0, commands="torque"), "commands of Pid: got 'torque'"),
    (lambda: control.Pid(period=T, filter_rate=1.0, lower=1.0, upper=0.0), "bounds of Pid"),
    (lambda: control.AheadOfServo(controller=PLAIN, inverse=SERVO), "controller of AheadOfServo: got 'command_angle'"),
    (lambda: control.DeadbandCompensation(controller=PID, half_width=0.1), "controller of DeadbandCompensation"),
    (lambda: control.DisturbanceObserver(controller=PID, inverse=SERVO, filter_rate=0.0), "filter_rate"),
    (lambda: control.Feedforward(period=2e-3, inverse=SERVO, feedback=PID), "period of feedback: got 0.001"),
    (lambda: control.zero_vibration(frequency=1.0, damping_ratio=1.0), "damping_ratio of a shaper"),
    (lambda: control.InputShaper(times=(0.0, 1.0), amplitudes=(0.5, 0.4)), "InputShaper"),
    (lambda: control.joined([]), "joined")])
def test_bad_input_is_one_line(make, words):
    with pytest.raises(InputError, match=words) as told:
        make()
    assert "\n" not in str(told.value)
