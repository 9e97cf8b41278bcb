"""A log over its twin, and a bench with the servo that was fitted."""

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.parameters.servo_file import servo_text
from servotwin.web.lessons import mystery
from servotwin.web.live import LiveBench, Scene, SceneServo, read_scene
from servotwin.web.live.overlay import compared, of_the_bench, shown
from servotwin.web.live.replay import exported
from servotwin.web.live.scene import MOST_SERVOS, taken_over

ID = "hitec-hs-755hb"
STEP = {"shape": "step", "unit": "us", "low": 1300.0, "high": 1700.0, "period": 1.0}


def of_a_bench(tmp_path, load: dict, rate: float = 50.0) -> tuple[st.Log, LiveBench]:
    """Return the table of a bench with a step, as a log, and the bench."""
    bench = LiveBench(Scene(servos=(SceneServo(id=ID, model="PulseServo"),), load=load, frame_rate=rate))
    bench.do("command", STEP)
    bench.advance(2.0, 50.0)
    file = tmp_path / "bench.csv"
    file.write_text(exported("csv", bench.scene(), bench.now_models).text)
    return st.read_logs(file)[0], bench


@pytest.mark.long
@pytest.mark.parametrize(("load", "rate"), [({}, 50.0), ({"inertia": 1e-3, "mass": 0.05}, 50.0), ({}, 80.0)])
def test_the_table_of_a_bench_lies_on_its_twin(tmp_path, load, rate):
    log, bench = of_a_bench(tmp_path, load, rate)
    servo = bench.now_models[0].servo
    with_load = of_the_bench(log, st.PulseServo, servo, load_now(bench), rate)
    assert compared(with_load, servo, st.PulseServo, fit_rig=False)["rms"] < 1e-6  # deg: twelve digits of the table
    other = servo.replace({"friction.coulomb_torque_forward": 2.0 * servo.friction.coulomb_torque_forward})
    assert compared(with_load, other, st.PulseServo, fit_rig=False)["rms"] > 0.1


def load_now(bench):
    from servotwin.web.live.live_bench import load_of

    return load_of(bench.scene())


@pytest.mark.long
def test_a_rig_is_fitted_and_never_makes_it_worse(tmp_path):
    log, bench = of_a_bench(tmp_path, {})
    servo = bench.now_models[0].servo
    turned = st.Log(name="turned", time=log.time, command=log.command, command_kind="pulse_width",
                    measured={"output_angle": log.measured["output_angle"] + 0.3})
    plain, fitted = (compared(turned, servo, st.PulseServo, fit_rig=rig) for rig in (False, True))
    assert plain["rms"] > 10.0  # 0.3 rad
    assert fitted["rms"] < 0.01
    assert fitted["rig_fitted"] is True
    assert any("angle offset 17.19" in line for line in fitted["rig"])
    assert compared(log, servo, st.PulseServo, fit_rig=True)["rms"] < 1e-6


def test_what_a_log_says_of_its_load_counts():
    log = st.Log(name="a", time=[0.0, 1.0, 2.0], command=[0.0, 1.0, 1.0], command_kind="angle",
                 measured={"output_angle": [0.0, 0.5, 1.0]}, load=st.loads.Inertia(2e-3),
                 parameters={"electronics.frame_period": 0.01})
    made = of_the_bench(log, st.PulseServo, st.load_servo(ID), st.loads.Inertia(1e-4), 50.0)
    assert made.load.inertia == 2e-3
    assert made.parameters["electronics.frame_period"] == 0.01


def test_a_picture_keeps_peaks_and_stays_small():
    spike = np.zeros(400_000)
    spike[[123_456, 300_001]] = 1.0, -1.0
    some = shown(spike, np.sin(np.arange(400_000.0)))
    assert {0, 123_456, 300_001, 399_999} <= set(some.tolist())
    assert len(some) < 5000


def test_a_table_holds_the_pulse_of_a_frame_from_its_edge_on(tmp_path):
    bench = LiveBench(Scene(servos=(SceneServo(id=ID, model="PulseServo"),)))
    bench.advance(0.5, 50.0)  # it stands at an edge
    bench.do("command", {"shape": "hold", "unit": "us", "value": 1700.0})
    bench.advance(1.0, 50.0)
    file = tmp_path / "bench.csv"
    file.write_text(exported("csv", bench.scene(), bench.now_models).text)
    log, = st.read_logs(file)
    assert log.time[log.changes].tolist() == [0.5]


@pytest.mark.long
def test_a_fitted_servo_stands_beside_or_instead_with_load_and_command_of_now():
    scene = Scene(servos=(SceneServo(id=ID, model="PulseServo"), SceneServo(id=ID, model="BoundedServo")), seed=4)
    bench = LiveBench(scene)
    bench.do("command", STEP)
    bench.do("set", {"load.pendulum.mass": 0.1, "load.inertia": 3e-4})
    bench.do("set", {"motor.armature_resistance": 4.0}, 1)
    bench.do("frames", {"rate": 80.0})
    bench.advance(0.5, 50.0)
    text = servo_text(bench.now_models[0].servo.replace({"motor.rotor_inertia": 2e-7}))
    for how, count in (("beside", 3), ("instead", 2)):
        made = taken_over(bench.scene(), bench.now_models, bench.load_numbers, bench.frame_rate, text, "PulseServo", 0,
                          how)
        again = LiveBench(read_scene(made.text()))
        assert len(again.models) == count
        assert again.models[-1 if how == "beside" else 0].servo.motor.rotor_inertia == 2e-7
        assert again.models[1].servo.motor.armature_resistance == 4.0
        assert load_now(again).inertia == 3e-4
        assert load_now(again).pendulum.mass == 0.1
        assert again.frame_rate == 80.0
        assert made.actions[0].value == bench.scene().actions[1].value
        again.advance(0.2, 50.0)


def test_a_shared_supply_stays_as_it_is_now():
    scene = Scene(servos=(SceneServo(id=ID, model="PulseServo"),) * 2,
                  supply={"open_circuit_voltage": 6.0, "internal_resistance": 0.5})
    bench = LiveBench(scene)
    bench.do("set", {"supply.open_circuit_voltage": 5.0})
    bench.advance(0.1, 50.0)
    text = servo_text(st.load_servo(ID))
    made = taken_over(bench.scene(), bench.now_models, bench.load_numbers, 50.0, text, "PulseServo", 1, "beside")
    assert dict(made.supply) == {"open_circuit_voltage": 5.0, "internal_resistance": 0.5}
    assert {model.servo.supply.open_circuit_voltage for model in LiveBench(made).now_models} == {5.0}


def test_there_is_no_room_for_a_seventh():
    scene = Scene(servos=(SceneServo(id=ID),) * MOST_SERVOS)
    models = LiveBench(scene).now_models
    with pytest.raises(InputError, match="at most 6"):
        taken_over(scene, models, {}, 50.0, servo_text(models[0].servo), "PulseServo", 0, "beside")


def test_a_fit_of_a_mystery_begins_with_what_the_page_tells():
    hidden = mystery.mystery_servo(7)
    known = mystery.known_of(hidden.replace({"supply.open_circuit_voltage": 5.0}))
    base = st.load_servo(mystery.BASE)
    assert known == base.replace({"supply.open_circuit_voltage": 5.0})
    secret = set(mystery.truth(7).values())
    assert not secret & {known.get(name) for name in known.names()}
    reduction = base.gear.gear_reduction
    shown = {one["name"]: (one["low"], one["high"]) for one in mystery.unknowns()}
    for name, (low, high) in mystery.sought().items():
        times = reduction if name == "output_coulomb_torque" else 1.0
        own = "friction.coulomb_torque" if name == "output_coulomb_torque" else name
        assert (low, high) == pytest.approx((times * shown[own][0], times * shown[own][1]))
