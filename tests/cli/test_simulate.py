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


@pytest.mark.long
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


@pytest.mark.long
def test_the_summary_says_what_matters(simulate):
    ended = simulate("--step", "0:180", "--load", "inertia=1e-3")
    labels = [line.split("  ")[1] for line in ended.out.splitlines()[1:] if not line.startswith("    ")]
    assert labels == ["command", "load", "final angle", "time to get there", "holding error", "rise time",
                      "settling time", "overshoot", "peak speed", "current",
                      "energy", "status", "solved", "ranges", "assumed", "ignored"]
    assert "model pulse" in ended.out
    assert "step 0 to 180 deg at 0.1 s" in ended.out
    assert "closed form" in ended.out
    assert "rotor_inertia" in ended.out
    assert "armature_inductance" in ended.out


@pytest.mark.long
def test_json_holds_the_numbers_of_the_result(simulate):
    found = simulate("--step", "0:90", "--at", "0.2", "--json", "--duration", "1").data
    result = st.simulate(st.PulseServo(st.load_servo(SERVO)), st.signals.step(0.0, 90.0, at=0.2, unit="deg"),
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


@pytest.mark.long(but="words5-signal5")
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
    expected = st.simulate(st.PulseServo(st.load_servo(SERVO)), signal, duration=0.8, output_step=0.01)
    written = columns(tmp_path / "run.csv")
    for name in ("command_voltage", "armature_voltage"):
        np.testing.assert_allclose(written[f"{name}_V"], expected[name], rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(written["output_angle_deg"], np.degrees(expected["output_angle"]), rtol=1e-10,
                               atol=1e-10)


@pytest.mark.long
def test_files_of_samples_and_pulses(simulate, tmp_path):
    (tmp_path / "pulses.csv").write_text("time_s,pulse_width_us\n0,1500\n0.02,1600\n0.04,1600\n")
    sampled = simulate("--command", "pulses.csv", "--json", "--model", "bounded").data
    pulses = simulate("--pulses", "pulses.csv", "--json", "--model", "bounded").data
    assert sampled["final_angle"] == pytest.approx(pulses["final_angle"], rel=1e-12)
    held = simulate("--command", "pulses.csv", "--hold", "linear", "--json", "--duration", "0.04", "--model",
                    "bounded").data
    assert held["final_angle"] != sampled["final_angle"]


@pytest.mark.long
def test_the_output_of_a_run_is_the_command_of_the_next(simulate, tmp_path):
    first = simulate("--step", "0:90", "--out", "run.csv", "--json").data
    assert "chosen by column" in simulate("--command", "run.csv").error
    second = simulate("--command", "run.csv", "--column", "pulse_width_us", "--json").data
    assert second["final_angle"] == pytest.approx(first["final_angle"], abs=1e-6)


@pytest.mark.long
def test_loads_add_up(simulate, tmp_path):
    (tmp_path / "torque.csv").write_text("time_s,torque_Nm\n0,0.1\n2,0.1\n")
    together = simulate("--step", "0:90", "--json", "--load", "inertia=1e-3,viscous=1e-4,coulomb=0.01",
                        "--load", "pendulum=0.1:0.12:90", "--load", "spring=0.05:10",
                        "--load", "recorded=torque.csv,torque=0.05").data
    load = (st.loads.Inertia(1e-3) + st.loads.Viscous(1e-4) + st.loads.Coulomb(0.01)
            + st.loads.Pendulum(mass=0.1, length=0.12, hanging_angle=math.radians(90.0))
            + st.loads.Spring(0.05, math.radians(10.0)) + st.loads.Constant(0.15))
    result = st.simulate(st.PulseServo(st.load_servo(SERVO)), st.signals.step(0.0, 90.0, at=0.1, unit="deg"),
                         duration=1.5, load=load)
    assert together["final_angle"] == pytest.approx(float(result["output_angle"][-1]), rel=1e-8)


@pytest.mark.long
def test_set_replaces_a_parameter(simulate):
    words = ["--step", "0:90", "--json"]
    plain, changed, again = (simulate(*words, *more).data for more in (
        [], ["--set", "supply.open_circuit_voltage=4.8"], ["--set", "supply.open_circuit_voltage=4800mV"]))
    assert changed["peak_current"] < plain["peak_current"]
    assert again == changed
    assert (plain["set"], changed["set"]) == ([], ["supply.open_circuit_voltage"])
    assert "supply.open_circuit_voltage" not in changed["assumed"]
    assert simulate(*words, "--set", "electronics.off_state=coast").code == 0


@pytest.mark.long(but="pulse")
@pytest.mark.parametrize("model", ["averaged", "averaged-inductive", "bounded", "pulse", "geared-motor", "dc-motor"])
def test_every_model_runs_and_is_drawn(cli, tmp_path, model):
    ended = cli("simulate", SERVO, "--model", model, "--step", "0.5:1", "--unit", "V", "--duration", "0.3",
                "--plot", "run.svg", "--json")
    assert ended.code == 0, ended.err
    assert ended.data["model"] == model
    assert "<svg" in (tmp_path / "run.svg").read_text()


@pytest.mark.long
def test_a_servo_file_is_a_servo(cli, tmp_path):
    st.load_servo(SERVO).save(tmp_path / "mine.toml")
    same = [cli("simulate", servo, "--step", "0:90", "--json").data["final_angle"] for servo in (SERVO, "mine.toml")]
    assert same[0] == same[1]


@pytest.mark.long
def test_a_pulse_servo_gives_the_numbers_of_the_result(simulate):
    found = simulate("--model", "pulse", "--step", "0:60", "--duration", "0.5", "--json").data
    result = st.simulate(st.PulseServo(st.load_servo(SERVO)), st.signals.step(0.0, 60.0, at=0.1, unit="deg"),
                         duration=0.5)
    assert found["model"] == "pulse"
    assert found["final_angle"] == pytest.approx(float(result["output_angle"][-1]), rel=1e-12)
    assert found["energy"]["supply"] == pytest.approx(result.energy.supply, rel=1e-12)
    assert "electronics.stretcher_gain" in found["assumed"]
    assert "electronics.bridge_gain" in found["ignored"]


@pytest.mark.long
def test_a_pulse_servo_writes_what_its_chip_does(simulate, tmp_path):
    ended = simulate("--model", "pulse", "--step", "1500:1600", "--unit", "us", "--duration", "0.3",
                     "--out", "run.csv", "--plot", "run.png")
    assert ended.code == 0, ended.err
    assert "model pulse" in ended.out
    written = columns(tmp_path / "run.csv")
    assert set(np.unique(written["drive"])) == {0.0, 1.0}
    assert written["error_time_us"].max() == pytest.approx(100.0, abs=0.01)
    assert {"bus_voltage_V", "supply_current_A"} < set(written)


def test_pulses_one_by_one_are_the_frames_of_a_pulse_servo(simulate, tmp_path):
    (tmp_path / "pulses.csv").write_text("time_s,pulse_width_us\n0,1500\n0.011,1600\n0.029,1600\n")
    words = ["--model", "pulse", "--duration", "0.1", "--json"]
    few = simulate(*words, "--pulses", "pulses.csv").data
    regular = simulate(*words, "--command", "pulses.csv").data
    train = st.signals.pulse_train([0.0, 0.011, 0.029], [1500.0, 1600.0, 1600.0])
    result = st.simulate(st.PulseServo(st.load_servo(SERVO)), train, duration=0.1)
    assert few["final_angle"] == pytest.approx(float(result["output_angle"][-1]), rel=1e-12)
    assert few["final_angle"] != regular["final_angle"]


@pytest.mark.parametrize(("words", "parts"), [
    (["--constant", "0", "--unit", "us"], ["pulse width", "got 0", "a positive width"]),
    (["--constant", "0", "--unit", "V"], ["pulse width", "-21.5262 us", "more than 0 us"]),
    (["--constant", "1500", "--unit", "us", "--set", "electronics.frame_period=0.001"],
     ["pulse width", "1500 us", "less than a frame of 1000 us"]),
    (["--step", "0:400"], ["angle command", "400 deg", "-15 to 195 deg"]),
    (["--step", "0:60", "--duration", "1e300", "--output-step", "1e300"],
     ["--duration", "1e+300", "at most 1e+06 frames of 20 ms"]),
    (["--prbs", "1400:1600:1e-300", "--unit", "us", "--duration", "1e9"], ["inf bits", "at most 10 000 000 bits"]),
    (["--pulses", "unsorted.csv"], ["unsorted.csv", "sample 2", "0.02", "more than 0.04 s"]),
    (["--pulses", "long.csv"], ["long.csv", "width 0.0015 s", "ends before the next"]),
])
def test_a_pulse_servo_refuses_in_one_line(simulate, tmp_path, words, parts):
    (tmp_path / "unsorted.csv").write_text("time_s,pulse_width_us\n0,1500\n0.04,1600\n0.02,1600\n")
    (tmp_path / "long.csv").write_text("time_s,pulse_width_us\n0,1500\n0.001,1600\n")
    error = simulate("--model", "pulse", *words).error
    for part in parts:
        assert part in error


@pytest.mark.long
def test_noise_follows_the_seed(simulate):
    noisy = ("--model", "pulse", "--step", "0:20", "--duration", "0.5", "--json", "--set", "potentiometer.noise=0.02")
    first, again, other = (simulate(*noisy, "--seed", seed).out for seed in ("1", "1", "2"))
    assert first == again != other


@pytest.mark.long
@pytest.mark.parametrize(("words", "said", "remarks"), [
    (("--load", "torque=3"), ["ended on a stop that it was not sent to at 1.5 s", "cannot hold its load at 1.5 s"],
     [{"kind": "ended on a stop", "time": 1.5}, {"kind": "cannot hold", "time": 1.5}]),
    (("--set", "electronics.pulse_width_max=1.2e-3"), ["all pulses refused from 0.1 s on"],
     [{"kind": "pulses refused", "time": 0.1}]),
    ((), [], []),
])
def test_remarks_are_shown(simulate, words, said, remarks):
    run = ("--step", "0:60", "--model", "pulse", *words)
    printed = simulate(*run).out
    assert [line.strip().removeprefix("remark").strip() for line in printed.splitlines() if "remark " in line] == said
    found = simulate(*run, "--json").data
    assert found["status"] == "COMPLETED"
    assert found["remarks"] == [{"kind": one["kind"], "time": pytest.approx(one["time"])} for one in remarks]


def test_warnings_are_one_line_each(cli):
    ended = cli("simulate", "feetech-ft-7235", "--step", "0:30", "--at", "2", "--set", "supply.open_circuit_voltage=19",
                "--model", "bounded")
    assert ended.code == 0
    warned = ended.err.splitlines()
    assert [line.partition("warning: ")[2].split(": ")[0].split(" comes")[0] for line in warned] == [
        "feetech-ft-7235", "feetech-ft-7235", "the first change of the command"]


@pytest.mark.long
def test_nothing_is_minus_zero(simulate, tmp_path):
    words = ("--constant", "0", "--out", "run.csv", "--force")
    ended = simulate(*words)
    assert "-0 " not in ended.out.replace("deg", " ")
    assert "-0.0" not in ended.out
    assert "-0.0" not in simulate(*words, "--json").out
    assert not any(cell == "-0" for line in (tmp_path / "run.csv").read_text().splitlines() for cell in line.split(","))
