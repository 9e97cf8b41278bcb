"""Digital and bus servos on the command line: registers, the loop at rest, goals, trips, and what is refused."""

import math

import pytest

import servotwin as st

BUS, DIGITAL, ANALOG = "feetech-sts3215-12v", "towerpro-mg996r", "hitec-hs-755hb"
SOFTER = ["--register", "P_Coefficient=16"]
STIFFER = ["--register", "P_Coefficient=32"]


@pytest.mark.long
def test_registers_are_those_of_the_servos_own_family(cli):
    found = cli("curves", BUS, *SOFTER, "--register", "Torque_Limit=500, D_Coefficient=0x20", "--load", "torque=0.2",
                "--quick", "--json").data["servos"][0]
    servo = st.feetech_sts({"P_Coefficient": 16, "Torque_Limit": 500, "D_Coefficient": 32}, servo=BUS)
    model = st.DigitalServo(servo)
    loop = found["voltages"][0]["loop"]
    assert found["model"] == "digital"
    assert loop["stiffness"] == pytest.approx(float(model.loop_stiffness()), rel=1e-12)
    assert loop["most_duty"] == 0.5
    expected = st.datasheet.Loop(model)
    for name in ("dead_zone", "start_error", "cap_error", "cap_torque", "friction_torque"):
        assert loop[name] == getattr(expected, name)
    assert list(loop["droop"].values()) == list(expected.droop(0.2))
    assert [each["kind"] for each in loop["protections"]] == ["overload", "current", "heat"]
    dynamixel = cli("simulate", "dynamixel-xl330-m288", "--register", "Position_P_Gain=800", "--step", "0:10",
                    "--json", "--duration", "0.3").data
    stiff = st.simulate(st.DigitalServo(st.dynamixel_x({"Position_P_Gain": 800}, servo="dynamixel-xl330-m288")),
                        st.signals.step(0.0, 10.0, at=0.1, unit="deg"), duration=0.3)
    assert dynamixel["final_angle"] == float(stiff["output_angle"][-1])


@pytest.mark.long
def test_a_set_of_registers_has_a_name_and_single_values_go_on_top(cli):
    def gain(*words):
        return cli("curves", BUS, *words, "--quick", "--json").data["servos"][0]["voltages"][0]["loop"]["stiffness"]

    soft = gain(*SOFTER, "--register", "Maximum_Acceleration=254,Acceleration=254")
    assert gain("--register", "lerobot") == soft
    assert gain("--register", "P_Coefficient=32,lerobot") == gain("--register", "lerobot", *STIFFER) == 2 * soft


@pytest.mark.long
def test_set_comes_after_the_registers(cli):
    words = ["curves", BUS, *SOFTER, "--set", "firmware.proportional_gain=2", "--quick", "--json"]
    loop = cli(*words).data["servos"][0]["voltages"][0]["loop"]
    model = st.DigitalServo(st.load_servo(BUS).replace({"firmware.proportional_gain": 2.0}))
    assert loop["stiffness"] == pytest.approx(float(model.loop_stiffness()), rel=1e-12)


@pytest.mark.long
def test_the_loop_is_told_in_words_picture_and_page(cli, tmp_path):
    ended = cli("curves", BUS, *SOFTER, "--load", "torque=0.2", "--quick", "--loop", "loop.png", "--out", "page.html")
    assert ended.code == 0, ended.err
    lines = {line[:29].strip(): line[29:].strip() for line in ended.out.splitlines()}
    assert lines["stiffness"] == "16.2 N m/rad (0.282 N m/deg)"
    assert lines["dead zone"] == "0.09 deg either way"
    assert lines["startup force"].startswith("1.6 % of the duty")
    assert lines["reaches the cap at"].endswith(" deg")
    assert lines["droop for 0.2 N m"].endswith("deg after coming up")
    assert lines["trips by overload"].startswith("80 % of the duty asked for over 2 s")
    assert "guessed of its program: compute_delay" in ended.out
    assert (tmp_path / "loop.png").read_bytes().startswith(b"\x89PNG")
    assert "The loop at rest" in (tmp_path / "page.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_a_servo_on_a_bus_follows_goals_and_says_that_it_trips(cli, tmp_path):
    words = ["simulate", BUS, "--step", "0:30", "--load", "torque=13", "--set", "stops.lower_angle=-60deg",
             "--duration", "3", "--plot", "run.png", "--out", "run.csv"]
    text = cli(*words).out
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    header = (tmp_path / "run.csv").read_text().splitlines()[0].split(",")
    assert {"goal_angle_deg", "reference_angle_deg", "duty", "trip"} <= set(header)
    assert "tripped by current at 2.0" in text
    assert "a protection still acts at 3 s" in text
    assert "ended on a stop" in text


@pytest.mark.long(but="words8-this family has no named sets")
@pytest.mark.parametrize(("words", "said"), [
    ([BUS, "--register", "P_Coefficient=0"], "P_Coefficient (21) of STS3215-12V: got 0, allowed: a whole number"),
    ([BUS, "--register", "P_Coefficient=300"], "P_Coefficient (21) of STS3215-12V: got 300"),
    ([BUS, "--register", "P_Coeficient=16"], "did you mean 'P_Coefficient'"),
    ([BUS, "--register", "P_Coefficient=1.5"], "--register P_Coefficient: got '1.5', allowed: a whole number"),
    ([BUS, "--register", "P_Coefficient"], "got 'no value', allowed: a raw value, such as P_Coefficient=32"),
    ([BUS, "--register", "P_Coefficient="], "allowed: NAME=VALUE"),
    ([BUS, "--register", "lerobo"], "unknown set of registers of Feetech STS 'lerobo'; did you mean 'lerobot'?"),
    ([BUS, "--register", "lerobot,,"], "allowed: NAME=VALUE"),
    (["dynamixel-mx-64", "--register", "lerobot"], "this family has no named sets"),
    ([ANALOG, "--register", "lerobot"], "--register for hitec-hs-755hb: got 'lerobot'"),
    ([BUS, *SOFTER, *SOFTER], "--register P_Coefficient: got '16 and 16', allowed: one value"),
    ([BUS, "--register", "Operating_Mode=1"], "Operating_Mode"),
    (["dynamixel-xl330-m288", *SOFTER], "unknown register of Dynamixel X 'P_Coefficient'"),
    ([DIGITAL, *SOFTER], "--register for towerpro-mg996r: got 'P_Coefficient', allowed: a servo with registers"),
    ([ANALOG, *SOFTER], "--register for hitec-hs-755hb"),
    ([BUS, "--step", "0:200"], "angle command: got '200 deg', allowed: -180 to 179.912 deg, the goals of"),
    ([BUS, "--step", "1500:1600", "--unit", "us"], "allowed: angles: it takes goals on a bus"),
    ([BUS, "--model", "pulse"], "PulseServo needs electronics.stretcher_gain"),
    ([DIGITAL, "--set", "firmware.control_period=30ms"], "control_period: got '30 ms', allowed: at most"),
    ([BUS, "--set", "firmware.proportional_gain=0"], "firmware.proportional_gain: got 0.0, allowed: a positive number"),
    ([BUS, "--set", "firmware.torque_limit=1.5"], "firmware.torque_limit: got 1.5"),
    ([BUS, "--duration", "1001"], "--duration: got 1001.0, allowed: at most 1e+06 ticks of 1 ms"),
])
def test_bad_input_is_one_line(cli, tmp_path, words, said):
    step = [] if "--step" in words else ["--step", "0:10"]
    assert said in cli("simulate", *words, *step, "--out", "run.csv").error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("words", "said"), [
    ([ANALOG, "--loop", "loop.png"], "--loop: got 'hitec-hs-755hb', allowed: one digital or bus servo"),
    ([BUS, DIGITAL, "--loop", "loop.png"], "--loop: got 'feetech-sts3215-12v, towerpro-mg996r'"),
    ([BUS, "--loop", "loop.txt"], "--loop: got 'loop.txt', allowed: a name that ends in .png"),
    ([BUS, "--register", "P_Coefficient=999"], "P_Coefficient (21) of STS3215-12V: got 999"),
    ([BUS, "--register", "Torque_Limit=0"], "does not turn at 12 V"),
])
def test_curves_refuses_bad_input(cli, tmp_path, words, said):
    assert said in cli("curves", *words, "--quick").error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_the_stiffness_is_that_of_the_standing_servo(cli):
    # without friction, drops and dead zone a load pulls the shaft off by torque over stiffness
    change = [f"friction.{name}=0" for name in ("coulomb_torque_forward", "coulomb_torque_backward",
                                                "load_friction_motor", "load_friction_external")]
    change += ["supply.bridge_drop_voltage=0", "firmware.deadband_angle=0", "firmware.minimum_duty=0",
               "gear.backlash=0", "motor.motor_viscous_friction=1e-6"]
    words = [word for each in change for word in ("--set", each)]
    found = cli("simulate", BUS, *SOFTER, *words, "--constant", "0", "--load", "torque=0.5,inertia=1e-3", "--json",
                "--duration", "3").data
    loop = cli("curves", BUS, *SOFTER, *words, "--quick", "--json").data["servos"][0]["voltages"][0]["loop"]
    assert -found["final_angle"] == pytest.approx(0.5 / loop["stiffness"], abs=2.0 * math.pi / 4096.0)
