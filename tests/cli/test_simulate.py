"""`servotwin simulate` does what the functions do, and says it."""

import csv
import math

import numpy as np
import pytest

import servotwin as st

SERVO = "hitec-hs-755hb"


def columns(path):
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    return {name: np.array([float(row[k]) for row in rows[1:]]) for k, name in enumerate(rows[0])}


def test_the_example_works_as_documented(cli, tmp_path):
    ended = cli("simulate", SERVO, "--step", "0:180", "--load", "inertia=1e-3", "--model", "averaged",
                "--out", "run.csv", "--plot", "run.png")
    assert ended.code == 0
    assert ended.err == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.csv", "run.png"]
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    expected = st.simulate(st.AveragedServo(st.load_servo(SERVO)), st.signals.step(0.0, 180.0, at=0.1, unit="deg"),
                           duration=1.5, load=st.loads.Inertia(1e-3))
    written = columns(tmp_path / "run.csv")
    np.testing.assert_allclose(written["time_s"], expected.time, rtol=1e-11)
    np.testing.assert_allclose(written["output_angle_deg"], np.degrees(expected["output_angle"]), rtol=1e-11,
                               atol=1e-12)


def test_the_summary_says_what_matters(simulate):
    ended = simulate("--step", "0:180", "--load", "inertia=1e-3")
    labels = [line.split("  ")[1] for line in ended.out.splitlines()[1:] if not line.startswith("    ")]
    assert labels == ["command", "load", "final angle", "steady error", "rise time", "settling time", "overshoot",
                      "peak speed", "peak current", "energy", "status", "solved", "assumed", "ignored"]
    assert "model bounded" in ended.out
    assert "step 0 to 180 deg at 0.1 s" in ended.out
    assert "closed form" in ended.out
    assert "rotor_inertia" in ended.out
    assert "armature_inductance" in ended.out


def test_json_holds_the_numbers_of_the_result(simulate):
    found = simulate("--step", "0:90", "--at", "0.2", "--json", "--duration", "1").data
    result = st.simulate(st.BoundedServo(st.load_servo(SERVO)), st.signals.step(0.0, 90.0, at=0.2, unit="deg"),
                         duration=1.0)
    metrics = result.step_metrics()
    assert found["final_angle"] == pytest.approx(metrics.final, rel=1e-12)
    assert found["step_metrics"]["rise_time"] == pytest.approx(metrics.rise_time, rel=1e-9)
    assert found["peak_current"] == pytest.approx(metrics.peak_current, rel=1e-12)
    assert found["energy"]["supply"] == pytest.approx(result.energy.supply, rel=1e-12)
    assert found["status"] == "COMPLETED"
    assert found["ignored"] == list(result.model.ignored)
    assert all(result.model.servo.source(name).origin == "assumed" for name in found["assumed"])


def test_what_is_not_finite_is_null_in_json(cli):
    found = cli("simulate", SERVO, "--model", "geared-motor", "--step", "0:3", "--unit", "V", "--json").data
    assert found["step_metrics"]["target"] is None


@pytest.mark.parametrize(("words", "signal"), [
    (["--step", "1200:1700", "--unit", "us"], st.signals.step(1200.0, 1700.0, at=0.1, unit="us")),
    (["--step", "-5:20"], st.signals.step(-5.0, 20.0, at=0.1, unit="deg")),
    (["--ramp", "0.2:1.2", "--over", "0.5", "--unit", "rad"],
     st.signals.ramp(0.2, 1.2, at=0.1, over=0.5, unit="rad")),
    (["--sine", "1.2:0.3:2", "--unit", "V"], st.signals.sine(mean=1.2, amplitude=0.3, frequency=2.0, unit="V")),
    (["--chirp", "90:10:0.5:5"], st.signals.chirp(mean=90.0, amplitude=10.0, start_frequency=0.5, end_frequency=5.0,
                                                  duration=0.8, unit="deg")),
    (["--prbs", "1.4:1.6:0.05", "--unit", "ms"], st.signals.prbs(1.4, 1.6, bit_time=0.05, duration=0.8, unit="ms")),
    (["--constant", "0.0015", "--unit", "s"], st.signals.constant(0.0015, unit="s")),
])
def test_every_shape_is_the_signal_of_its_name(simulate, tmp_path, words, signal):
    ended = simulate(*words, "--duration", "0.8", "--out", "run.csv", "--output-step", "0.01")
    assert ended.code == 0, ended.err
    expected = st.simulate(st.BoundedServo(st.load_servo(SERVO)), signal, duration=0.8, output_step=0.01)
    written = columns(tmp_path / "run.csv")
    for name in ("command_voltage", "armature_voltage"):
        np.testing.assert_allclose(written[f"{name}_V"], expected[name], rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(written["output_angle_deg"], np.degrees(expected["output_angle"]), rtol=1e-10,
                               atol=1e-10)


def test_files_of_samples_and_pulses(simulate, tmp_path):
    (tmp_path / "pulses.csv").write_text("time_s,pulse_width_us\n0,1500\n0.02,1600\n0.04,1600\n")
    sampled = simulate("--command", "pulses.csv", "--json").data
    pulses = simulate("--pulses", "pulses.csv", "--json").data
    assert sampled["final_angle"] == pytest.approx(pulses["final_angle"], rel=1e-12)
    held = simulate("--command", "pulses.csv", "--hold", "linear", "--json", "--duration", "0.04").data
    assert held["final_angle"] != sampled["final_angle"]


def test_the_output_of_a_run_is_the_command_of_the_next(simulate, tmp_path):
    first = simulate("--step", "0:90", "--out", "run.csv", "--json").data
    assert "chosen by column" in simulate("--command", "run.csv").error
    second = simulate("--command", "run.csv", "--column", "pulse_width_us", "--json").data
    assert second["final_angle"] == pytest.approx(first["final_angle"], abs=1e-6)


def test_loads_add_up(simulate, tmp_path):
    (tmp_path / "torque.csv").write_text("time_s,torque_Nm\n0,0.1\n2,0.1\n")
    together = simulate("--step", "0:90", "--json", "--load", "inertia=1e-3,viscous=1e-4,coulomb=0.01",
                        "--load", "pendulum=0.1:0.12:90", "--load", "spring=0.05:10",
                        "--load", "recorded=torque.csv,torque=0.05").data
    load = (st.loads.Inertia(1e-3) + st.loads.Viscous(1e-4) + st.loads.Coulomb(0.01)
            + st.loads.Pendulum(mass=0.1, length=0.12, hanging_angle=math.radians(90.0))
            + st.loads.Spring(0.05, math.radians(10.0)) + st.loads.Constant(0.15))
    result = st.simulate(st.BoundedServo(st.load_servo(SERVO)), st.signals.step(0.0, 90.0, at=0.1, unit="deg"),
                         duration=1.5, load=load)
    assert together["final_angle"] == pytest.approx(float(result["output_angle"][-1]), rel=1e-8)


def test_set_replaces_a_parameter(simulate):
    words = ["--step", "0:90", "--json"]
    plain, changed = (simulate(*words, *more).data for more in ([], ["--set", "supply.open_circuit_voltage=4.8"]))
    assert changed["peak_current"] < plain["peak_current"]
    assert "supply.open_circuit_voltage" in changed["assumed"]
    assert simulate(*words, "--set", "electronics.off_state=coast").code == 0


@pytest.mark.parametrize("model", ["averaged", "averaged-inductive", "bounded", "geared-motor", "dc-motor"])
def test_every_model_runs_and_is_drawn(cli, tmp_path, model):
    ended = cli("simulate", SERVO, "--model", model, "--step", "0.5:1", "--unit", "V", "--duration", "0.3",
                "--plot", "run.svg", "--json")
    assert ended.code == 0, ended.err
    assert ended.data["model"] == model
    assert "<svg" in (tmp_path / "run.svg").read_text()


def test_a_servo_file_is_a_servo(cli, tmp_path):
    st.load_servo(SERVO).save(tmp_path / "mine.toml")
    same = [cli("simulate", servo, "--step", "0:90", "--json").data["final_angle"] for servo in (SERVO, "mine.toml")]
    assert same[0] == same[1]
