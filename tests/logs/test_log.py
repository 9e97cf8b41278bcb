"""The log: what it holds, what it refuses, and the command that it gives to a simulation."""

import math
import pickle

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, UnknownNameError
from servotwin.identification import Log

N = 51


def make(**more):
    time = 0.02 * np.arange(N)
    given = {"name": "run", "time": time, "command": np.full(N, 1.5e-3), "command_kind": "pulse_width",
             "measured": {"output_angle": np.sin(time)}}
    return Log(**{**given, **more})


def refused(*words, **more):
    with pytest.raises(InputError) as caught:
        make(**more)
    text = str(caught.value)
    assert text.isprintable()
    assert all(word in text for word in words), text
    return caught.value


# ---------------------------------------------------------------------------------------- what it holds

def test_arrays_are_copies_that_nobody_writes_to():
    time = 0.02 * np.arange(N)
    log = make(time=time, torque_on=np.ones(N, bool))
    time[0] = -1.0
    assert log.time[0] == 0.0
    for values in (log.time, log.command, log.measured["output_angle"], log.torque_on):
        assert not values.flags.writeable
    with pytest.raises(TypeError):
        log.measured["output_speed"] = values


def test_pickled_it_is_the_same():
    log = make(torque_on=np.arange(N) % 2, load=st.loads.Inertia(1e-3), conditions={"gain": 3, "servo": "mine"},
               parameters={"supply.open_circuit_voltage": 6}, left_out=[[0.0, 0.06]], motion="step")
    again = pickle.loads(pickle.dumps(log))
    assert repr(again) == repr(log)
    assert again.load == log.load == st.loads.Inertia(1e-3).as_load()
    assert dict(again.parameters) == {"supply.open_circuit_voltage": 6.0}
    np.testing.assert_array_equal(again.torque_on, np.arange(N) % 2 == 1)
    assert not again.measured["output_angle"].flags.writeable


def test_a_value_counts_where_it_is_finite_and_no_window_leaves_it_out():
    angle = np.sin(0.02 * np.arange(N))
    angle[10] = np.nan
    log = make(measured={"output_angle": angle}, left_out=[(0.1, 0.14), (0.9, 2.0)])
    # binary times: 0.14 and 0.9 stand exactly for samples 7 and 45
    wanted = [k for k in range(N) if k != 10 and not 0.1 <= log.time[k] < 0.14 and log.time[k] < 0.9]
    assert np.flatnonzero(log.used("output_angle")).tolist() == wanted
    with pytest.raises(UnknownNameError, match="output_angle"):
        log.used("output_angel")


@pytest.mark.parametrize(("measured", "name"), [
    ({"output_angle": np.zeros(N), "feedback_voltage": np.ones(N)}, "output_angle"),
    ({"feedback_voltage": np.ones(N)}, "feedback_voltage"),
    ({"output_angle": np.full(N, np.nan), "feedback_voltage": np.ones(N)}, "feedback_voltage"),
])
def test_the_signal_that_tells_the_angle(measured, name):
    assert make(measured=measured).angle_name == name


def test_a_constant_log_knows_it():
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, 1e-3, N)
    steps = np.where(np.arange(N) < 25, 1.5e-3, 1.6e-3)
    settling = 0.2 * np.exp(-np.arange(N) / 10.0)
    assert make(measured={"output_angle": np.full(N, 0.3)}).is_constant
    assert make(measured={"output_angle": np.full(N, 0.3)}, command=steps).is_constant  # a sensor that hangs
    assert make(measured={"output_angle": noise}).is_constant
    assert not make(measured={"output_angle": noise}, command=steps).is_constant
    assert not make(measured={"output_angle": noise + settling}).is_constant  # it settles from elsewhere
    assert not make(measured={"output_angle": noise}, torque_on=np.arange(N) < 25).is_constant


# ---------------------------------------------------------------------------------------- what it refuses

@pytest.mark.parametrize(("more", "words"), [
    ({"time": [0.0, 0.02]}, ("2 samples", "at least 3 samples")),
    ({"time": 0.02 * np.arange(N)[::-1]}, ("runs backwards at sample 1", "0.98 s after 1 s")),
    ({"time": np.r_[0.0, 0.0, np.arange(1, N - 1)]}, ("stands still at sample 1", "0 s after 0 s")),
    ({"time": np.r_[np.nan, np.arange(1, N)]}, ("time of sample 0", "nan")),
    ({"time": "soon"}, ("time", "no numbers")),
    ({"time": np.zeros((N, 1))}, ("time", "shape (51, 1)")),
    ({"command": np.zeros(N - 1)}, ("command", "50 values", "51, as many as times")),
    ({"command": np.r_[np.inf, np.full(N - 1, 1.5e-3)]}, ("command of sample 0", "inf")),
    ({"command": np.full(N, -1.5e-3)}, ("pulse width of sample 0", "positive", "nan where no pulse")),
    ({"command": np.full(N, np.nan)}, ("command", "no value in any sample")),
    ({"command": np.r_[1.0, np.nan, np.ones(N - 2)], "command_kind": "voltage"}, ("sample 1", "nan", "only pulses")),
    ({"command": np.r_[1e-3, np.nan, np.full(N - 2, 1e-3)], "command_hold": "linear"}, ("sample 1", '"previous"')),
    ({"command": np.zeros(N)}, ("pulse width of sample 0", "positive")),
    ({"command": np.full(N, 1500.0)}, ("command (pulse_width)", "1500 s", "microseconds?")),
    ({"command": np.full(N, 180.0), "command_kind": "angle"}, ("180 rad", "degrees or counts?")),
    ({"measured": {"output_angle": np.linspace(0.0, 4000.0, N)}}, ("output_angle", "4000 rad", "degrees or counts?")),
    ({"measured": {"output_angle": np.linspace(0.0, -4000.0, N)}}, ("-4000 rad",)),
    ({"measured": {"feedback_voltage": np.linspace(0.0, 2000.0, N)}}, ("2000 V", "counts?")),
    ({"measured": {"output_angle": np.full(N, np.nan)}}, ("output_angle", "no value")),
    ({"measured": {"output_angle": np.r_[np.inf, np.zeros(N - 1)]}}, ("output_angle of sample 0", "inf", "nan where")),
    ({"measured": {"output_angle": np.zeros(N)}, "left_out": [(0.0, 9.0)]}, ("outside the windows",)),
    ({"measured": {"output_speed": np.zeros(N)}}, ("measured signals", "output_angle or feedback_voltage")),
    ({"measured": {}}, ("measured signals", "none")),
    ({"measured": [1.0]}, ("measured", "list")),
    ({"measured": {"output_angle": np.zeros(N), "pulse_width": np.full(N, 1e-3)}}, ("pulse_width", "no command")),
    ({"measured": {"output_angle": np.ma.masked_array(np.zeros(N), np.ones(N))}}, ("masked",)),
    ({"torque_on": np.full(N, 0.5)}, ("torque_on of sample 0", "true or false")),
    ({"torque_on": np.ones(3)}, ("torque_on", "3 values")),
    ({"command_kind": "degrees"}, ("command_kind", "angle, pulse_width, voltage")),
    ({"command_hold": "next"}, ("command_hold", "previous, linear")),
    ({"name": ""}, ("name of a log",)),
    ({"motion": 3}, ("motion", "a text")),
    ({"parameters": {"supply.open_circuit_voltage": -6.0}}, ("supply.open_circuit_voltage", "-6.0", "positive", "[V]")),
    ({"parameters": {"supply.open_circuit_voltage": "6 V"}}, ("'6 V'",)),
    ({"parameters": {"electronics.off_state": "coast"}}, ("off_state", "a number")),
    ({"parameters": 6.0}, ("parameters", "a mapping")),
    ({"conditions": {"gain": None}}, ("conditions, gain",)),
    ({"left_out": [[0.1, 0.0]]}, ("left_out", "start < stop")),
    ({"left_out": [0.0, 0.1]}, ("left_out",)),
    ({"load": 1e-3}, ("load", "float")),
])
def test_what_is_wrong_is_said_in_one_line(more, words):
    refused(*words, **more)


@pytest.mark.parametrize("more", [
    {"measured": {"output_angel": np.zeros(N)}}, {"parameters": {"supply.voltage": 6.0}},
])
def test_unknown_names_are_answered_with_the_nearest(more):
    error = refused("did you mean", **more)
    assert isinstance(error, UnknownNameError)


def test_a_motor_turns_further_than_a_servo():
    log = make(measured={"output_angle": np.zeros(N), "motor_angle": np.full(N, 880.0)})
    assert log.measured["motor_angle"][0] == 880.0


# ---------------------------------------------------------------------------------------- the command

@pytest.mark.parametrize(("kind", "value"), [("angle", 0.5), ("pulse_width", 1.6e-3), ("voltage", 1.2)])
@pytest.mark.parametrize("hold", ["previous", "linear"])
def test_the_command_starts_with_the_first_sample(kind, value, hold):
    command = value * (1.0 + 0.1 * (np.arange(N) >= 20))
    log = make(time=1.5e9 + 0.25 * np.arange(N), command=command, command_kind=kind, command_hold=hold)
    signal = log.signal()
    assert signal.kind == kind
    assert signal.edges is None
    assert signal.initial == command[0]
    np.testing.assert_array_equal(signal(0.25 * np.arange(N)), command)
    between = 1.05 * value if hold == "linear" else value
    assert float(signal(19.5 * 0.25)) == pytest.approx(between, rel=1e-12)


def test_pulses_are_missing_while_torque_is_off():
    on = (np.arange(N) < 10) | (np.arange(N) >= 30)
    assert make(torque_on=np.ones(N)).signal().edges is None
    edges = np.array(make(torque_on=on).signal().edges)
    np.testing.assert_allclose(edges, 0.02 * np.flatnonzero(on), rtol=1e-12)
    half = np.array(make(torque_on=on, parameters={"electronics.frame_period": 0.01}).signal().edges)
    np.testing.assert_allclose(half, 0.01 * np.r_[0:20, 60:101], rtol=1e-12)
    np.testing.assert_array_equal(make(torque_on=on).signal(frame_period=0.01).edges, half)
    assert make(torque_on=np.zeros(N)).signal().edges == ()
    for wrong in (0.0, -0.02, math.nan, 1e-12):
        with pytest.raises(InputError, match="frame_period"):
            make(torque_on=on).signal(frame_period=wrong)


@pytest.mark.parametrize("kind", ["angle", "pulse_width"])
@pytest.mark.parametrize("on", [None, np.arange(N) % 7 > 0])
def test_a_command_that_is_missing_means_no_pulses(kind, on):
    silent = (np.arange(N) < 4) | ((np.arange(N) >= 20) & (np.arange(N) < 30)) | (np.arange(N) == N - 1)
    plain = 1e-3 * (1.0 + np.arange(N) // 15)
    off = make(command=np.r_[np.full(4, plain[4]), plain[4:20], np.full(10, plain[19]), plain[30:-1], plain[-2]],
               command_kind=kind, torque_on=~silent if on is None else ~silent & on)
    log = make(command=np.where(silent, np.nan, plain), command_kind=kind, torque_on=on)
    np.testing.assert_array_equal(np.isnan(log.command), silent)
    np.testing.assert_array_equal(log.held, off.command)
    np.testing.assert_array_equal(log.sent, off.torque_on)
    np.testing.assert_array_equal(log.changes, off.changes)
    assert {4, 20, 30} <= set(log.changes.tolist())
    for array in (log.held, log.sent, log.changes):
        assert not array.flags.writeable
    for period in (None, 0.013):
        assert log.signal(period) == off.signal(period)
    assert [(p.name, p.start, len(p)) for p in log.without_torque_off()] == [
        (p.name, p.start, len(p)) for p in off.without_torque_off()]
    for part in (log.part(0.46, 0.7), log.part(0.46, 0.56)):  # what came last was before it
        assert (part.held[0], part.sent[0], part.signal().initial) == (plain[19], False, plain[19])
    assert not make(command=np.where(silent, np.nan, 1e-3), measured={
        "output_angle": np.random.default_rng(0).normal(size=N)}).is_constant


@pytest.mark.parametrize(("kind", "value"), [("angle", 1.0), ("pulse_width", 1.5e-3)])
@pytest.mark.parametrize("off_state", ["brake", "coast"])
def test_a_servo_without_pulses_goes_limp(servo, kind, value, off_state):
    servo = servo.replace({"electronics.pulse_timeout": 0.05, "electronics.off_state": off_state,
                           "stops.lower_angle": -3.0})
    on = np.arange(N) < 25
    log = make(command=np.full(N, value), command_kind=kind, torque_on=on, load=st.loads.Constant(0.6))
    result = st.simulate(st.PulseServo(servo), log.signal(), duration=log.duration, load=log.load, output_step=0.01)
    assert result.at("drive", np.linspace(0.2, 0.48, 2001)).any()
    assert not result.at("drive", np.linspace(0.48 + 0.05 + 1e-6, 1.0, 2001)).any()
    held, fell = result.at("output_angle", [0.4, 0.48])
    assert abs(held - fell) < 0.05
    speed = np.diff(result.at("output_angle", [0.6, 0.8]))[0] / 0.2
    if off_state == "coast":
        assert speed < -5.0
        return
    reduction, motor = servo.gear.gear_reduction, servo.motor
    damping = reduction**2 * (motor.torque_constant * motor.back_emf_constant / motor.armature_resistance
                              + motor.motor_viscous_friction)
    # the bridge brakes: it falls as fast as the shorted motor lets it
    assert speed == pytest.approx(-(0.6 - reduction * servo.friction.coulomb_torque_backward) / damping, rel=1e-3)


# ---------------------------------------------------------------------------------------- parts

def test_a_part_is_a_log_whose_recorded_torque_goes_along():
    load = st.loads.Recorded([0.0, 2.0], [0.0, 0.2]) + st.loads.Inertia(1e-3)
    log = make(load=load, torque_on=np.arange(N) < 30, left_out=[(0.0, 0.06)])
    part = log.part(0.5, 0.7)
    assert (part.name, len(part), part.start) == ("run", 10, 0.5)
    assert part.load.external_torque(0.1, 0.0) == pytest.approx(log.load.external_torque(0.6, 0.0), rel=1e-12)
    np.testing.assert_array_equal(part.measured["output_angle"], log.measured["output_angle"][25:35])
    assert part.torque_on.sum() == 5
    assert part.signal().initial == 1.5e-3
    with pytest.raises(InputError, match="2 samples"):
        log.part(0.5, 0.54)
    with pytest.raises(InputError, match="0 samples"):
        log.part(5.0, 6.0)


def test_stretches_with_torque():
    k = np.arange(N)
    on = (k < 10) | ((k >= 20) & (k < 22)) | (k >= 30)  # the middle one is too short
    parts = make(torque_on=on).without_torque_off()
    assert [(p.name, len(p), p.start) for p in parts] == [("run (1)", 10, 0.0), ("run (2)", 21, 0.6)]
    assert all(p.signal().edges is None for p in parts)
    whole = make()
    assert whole.without_torque_off() == (whole,)
    assert make(torque_on=np.zeros(N)).without_torque_off() == ()
    angle = np.where(k < 15, np.nan, 0.1)  # nothing seen in the first stretch
    assert [p.name for p in make(torque_on=on, measured={"output_angle": angle}).without_torque_off()] == ["run"]
