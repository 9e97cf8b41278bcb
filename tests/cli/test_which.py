"""`servotwin catalog which` over lifts, motions, limits and prices, and `--supply` wherever a supply is said."""

import math
import re

import numpy as np
import pytest

import servotwin as st
from servotwin.datasheet.holding import on_supply
from servotwin.models import mid_travel

FOUR = ("gobilda-2000-135", "hitec-hs-422", "towerpro-sg90", "futaba-s3003")
ARM = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody><body pos="0 0 .3">
  <joint name="shoulder" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .12 0 0" size=".01" mass=".06"/>
  <body pos=".12 0 0"><joint name="elbow" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".05"/></body></body></worldbody></mujoco>"""


@pytest.fixture
def which(cli):
    return lambda *words: cli("catalog", "which", *words)


@pytest.fixture
def wave(tmp_path):
    """A robot, a motion of its two joints and one of a single joint, in the folder of the command."""
    time = np.linspace(0.0, 1.0, 26)
    shoulder, elbow = 30.0 - 30.0 * np.cos(np.pi * time), 20.0 - 20.0 * np.cos(2.0 * np.pi * time)
    (tmp_path / "arm.xml").write_text(ARM)
    for name, columns in (("wave", {"shoulder_deg": shoulder, "elbow_deg": elbow}), ("lift", {"arm_deg": shoulder}),
                          ("far", {"arm_deg": 6.0 * shoulder})):
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack([time, *columns.values()]), delimiter=",",
                   header=",".join(["time_s", *columns]), comments="")


def facts(found):
    return {each["id"]: each for each in (*found["found"], *found["refused"])}


@pytest.mark.long
def test_those_that_are_named_stand_side_by_side_with_what_their_sheets_say(which):
    words = ["--lift", "0.3kg", "--arm", "10cm", "--voltage", "6", "--among", ",".join(FOUR[:3])]
    found = facts(which(*words, "--json").data)
    for name in FOUR[:3]:
        part = st.curves(st.models.default_model(st.load_servo(name)), voltage=6.0, lift=(0.3, 0.1),
                         bandwidth=False).voltages[0]
        told = found[name]
        assert told["margin"] == pytest.approx(part.lift.margin)
        assert told["smallest_move"] == part.smallest_move
        assert told["smallest_move_span"] == pytest.approx(list(part.move_span))
        assert told["lift"]["holding"]["error"] == pytest.approx(part.lift.held.error, nan_ok=True)
        assert told["lift"]["warming"]["winding_temperature"] == part.lift.warming.now.winding
    text = which(*words).out
    table = text.split("\n\n")[1].splitlines()
    assert [line.split()[0] for line in table] == ["id", "towerpro-sg90", "hitec-hs-422", "gobilda-2000-135"]
    assert float(table[3].split()[2]) == pytest.approx(found["gobilda-2000-135"]["margin"], abs=6e-3)
    assert re.search(r"^towerpro-sg90 +lifts 0\.21 N m of 0\.294$", text, re.MULTILINE)
    assert "above 130 deg C" in text or "gives way" in text or "sinks" in text


@pytest.mark.long
def test_each_limit_says_its_reason(which):
    limits = {"current=1A": "draws", "mass=10g": "weighs", "voltage=7.4V": "its sheet ends at",
              "travel=350deg": "travels", "time=0.1s": "takes", "kind=digital": "is analog"}
    found = facts(which("--limit", ",".join(limits), "--among", ",".join(FOUR), "--json").data)
    said = {name: " ".join(reason["text"] for reason in found[name]["reasons"]) for name in FOUR}
    assert all(word in said["hitec-hs-422"] for word in limits.values() if word != "draws")
    assert "draws" in said["gobilda-2000-135"]
    assert {reason["kind"] for reason in found["hitec-hs-422"]["reasons"]} == {
        "mass", "voltage", "travel", "time", "kind"}
    alone = which("--limit", "kind=bus", "--limit", "mass=20g", "--json").data
    assert {each["id"] for each in alone["found"]} == {
        name for name in st.catalog_names() if "xl330" in name or "xl-320" in name}


@pytest.mark.long
def test_what_is_not_known_keeps_no_limit(which):
    found = facts(which("--limit", "mass=1kg", "--among", "hitec-hs-425bb", "--json").data)["hitec-hs-425bb"]
    assert [reason["text"] for reason in found["reasons"]] == ["its mass is not known"]


@pytest.mark.long
def test_prices_are_a_shop_and_the_cheapest_comes_first(which, tmp_path):
    (tmp_path / "shop.csv").write_text("servo,price_EUR\nhitec-hs-422,14\ntowerpro-sg90,2.50\nfutaba-s3003,9\n")
    found = which("--lift", "100g", "--arm", "10cm", "--prices", "shop.csv", "--limit", "price=10", "--json").data
    assert [each["id"] for each in found["found"]] == ["towerpro-sg90", "futaba-s3003"]
    assert [(each["id"], each["reason"]) for each in found["refused"]] == [("hitec-hs-422", "costs 14")]
    assert "price, EUR" in which("--limit", "price=10", "--prices", "shop.csv").out


def test_limits_and_prices_that_cannot_be(which, tmp_path):
    assert "NAME=VALUE" in which("--limit", "price<=3", "--lift", "100g", "--arm", "10cm").error
    (tmp_path / "shop.csv").write_text("servo;price_EUR\nhitec-hs-422;999\ntowerpro-sg90;1.200\n")
    assert "1200, if the point" in which("--lift", "100g", "--arm", "10cm", "--prices", "shop.csv").error


@pytest.mark.long
def test_usb_is_a_supply_wherever_one_is_said(cli, which):
    usb = st.Supply.of("usb")
    assert (usb.open_circuit_voltage, usb.current_limit) == (5.0, 0.5)
    servo = on_supply(st.load_servo("towerpro-sg90"), usb)
    run = cli("simulate", "towerpro-sg90", "--step", "0:60", "--duration", "0.5", "--supply", "usb", "--json").data
    expected = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=0.5)
    assert run["final_angle"] == float(expected["output_angle"][-1])
    assert run["peak_current"] == pytest.approx(0.5, abs=1e-6)
    stall = st.datasheet.FullDrive(st.PulseServo(servo)).stall_torque
    sheet = cli("curves", "towerpro-sg90", "--quick", "--supply", "5V:0.5A", "--json").data["servos"][0]["voltages"][0]
    assert sheet["cold"]["stall_torque"] == pytest.approx(stall, rel=1e-9)
    told = facts(which("--lift", "10g", "--arm", "5cm", "--supply", "usb", "--among", "towerpro-sg90", "--json").data)
    assert told["towerpro-sg90"]["most_torque"] == pytest.approx(stall, rel=1e-9)
    for command in ("linear", "sweep", "fit", "validate"):
        assert "--supply" in cli(command, "--help-all").out


@pytest.mark.long
def test_a_motion_of_a_robot_is_that_of_robot_run(which, wave, tmp_path):
    pytest.importorskip("mujoco")
    found = facts(which("--robot", "arm.xml", "--motion", "wave.csv", "--voltage", "6", "--among",
                        "hitec-hs-422,towerpro-sg90", "--json").data)
    motion = st.robots.read_motion(tmp_path / "wave.csv", ["shoulder", "elbow"])
    model = st.models.default_model(st.load_servo("hitec-hs-422"))
    mounts = {joint: st.robots.Mount(model, zero=0.5 * float(way.min() + way.max()) - mid_travel(model))
              for joint, way in motion.angles.items()}
    run = st.robots.run_motion(tmp_path / "arm.xml", mounts, motion)
    sized = st.robots.sizing_of(run)
    for joint, told in found["hitec-hs-422"]["joints"].items():
        assert told["margin"] == pytest.approx(sized[joint].margin, rel=1e-6)
        assert told["rms_error"] == pytest.approx(run.tracking[joint].rms, rel=1e-6)
    hottest = max(each.heating.soon.winding for each in sized.values())
    assert found["hitec-hs-422"]["after_ten_minutes"]["winding"] == pytest.approx(hottest, rel=1e-9)
    assert 298.15 < hottest < max(each.heating.winding for each in sized.values())


@pytest.mark.long
def test_one_joint_counts_where_it_is_named(which, wave):
    pytest.importorskip("mujoco")
    words = ["--robot", "arm.xml", "--motion", "wave.csv", "--among", "hitec-hs-422", "--json"]
    both, one = (facts(which(*words, *more).data)["hitec-hs-422"] for more in ((), ("--joint", "elbow")))
    assert set(both["joints"]) == {"shoulder", "elbow"}
    assert set(one["joints"]) == {"elbow"}
    assert one["margin"] == both["joints"]["elbow"]["margin"] > both["margin"]


@pytest.mark.long
def test_a_motion_of_one_arm_takes_the_torque_of_its_mass(which, wave):
    pytest.importorskip("mujoco")
    light, heavy = (facts(which("--motion", "lift.csv", "--lift", mass, "--arm", "10cm", "--among",
                                "hitec-hs-422,towerpro-sg90", "--json").data) for mass in ("50g", "500g"))
    assert heavy["hitec-hs-422"]["margin"] < 1.0 < light["hitec-hs-422"]["margin"]
    assert heavy["towerpro-sg90"]["reasons"][0]["text"].startswith("too weak at ")
    lifts = light["hitec-hs-422"]["most_torque"] / (0.05 * 9.80665 * 0.1)
    assert light["hitec-hs-422"]["margin"] < lifts  # it moves as well


@pytest.mark.long
def test_a_motion_beyond_the_travel_is_a_reason(which, wave):
    pytest.importorskip("mujoco")
    found = facts(which("--motion", "far.csv", "--among", "hitec-hs-422", "--json").data)["hitec-hs-422"]
    assert [reason["text"] for reason in found["reasons"]] == ["arm moves 360 deg, the servo travels 180 deg"]


@pytest.mark.long(but="words19-unknown joint of --joint 'wrist'")
@pytest.mark.parametrize(("words", "said"), [
    ([], "nothing is asked: allowed: --lift MASS"),
    (["--among", "towerpro-sg9"], "unknown servo 'towerpro-sg9'; did you mean 'towerpro-sg90'"),
    (["--among", "towerpro-sg90,towerpro-sg90"], "'towerpro-sg90' twice"),
    (["--limit", "mass=10V"], "--limit mass: got '10V', allowed: a positive number with one of the units kg"),
    (["--limit", "travel=3"], "--limit travel: got '3'"),
    (["--limit", "mas=10g"], "unknown limit of --limit 'mas'; did you mean 'mass'"),
    (["--limit", "mass"], "--limit: got 'mass', allowed: NAME=VALUE"),
    (["--limit", "mass=1g,mass=2g"], "--limit mass: got 'two values'"),
    (["--limit", "time=1s", "--time", "2"], "--limit time: got 'two values'"),
    (["--limit", "kind=servo"], "--limit kind: got 'servo', allowed: analog, digital, bus"),
    (["--limit", "price=5"], "--limit price: allowed: --prices FILE.csv beside it"),
    (["--prices", "bad.csv"], "bad.csv: unknown servo 'no-such'"),
    (["--prices", "words.csv"], "words.csv: line 2"),
    (["--prices", "shop.csv", "--among", "hitec-hs-55"], "shop.csv: price of hitec-hs-55: got 'none'"),
    (["--prices", "lift.csv"], "lift.csv: columns: got 'time_s, arm_deg', allowed: servo, and price"),
    (["--prices", "none.csv"], "none.csv: no such file"),
    (["--motion", "lift.csv", "--joint", "elbow"], "--joint elbow: got 'no column of it in lift.csv', allowed: arm"),
    (["--motion", "wave.csv"], "wave.csv: columns: got 'shoulder_deg, elbow_deg', allowed: time_s and one"),
    (["--robot", "arm.xml", "--motion", "lift.csv"], "unknown column of lift.csv 'arm_deg': allowed: shoulder, elbow"),
    (["--robot", "arm.xml", "--motion", "wave.csv", "--joint", "wrist"], "unknown joint of --joint 'wrist'"),
    (["--robot", "arm.xml"], "--robot: allowed: --motion FILE beside it"),
    (["--robot", "arm.xml", "--motion", "wave.csv", "--lift", "1kg", "--arm", "1m"], "--robot: got 'also --lift'"),
    (["--among", "towerpro-sg90", "--supply", "usc"], "--supply: got 'usc', allowed: usb, or VOLTS"),
    (["--among", "towerpro-sg90", "--supply", "5V:2kg"], "--supply: resistance: got '2kg'"),
    (["--among", "towerpro-sg90", "--supply", "usb", "--voltage", "5"], "--supply: got 'also --voltage 5'"),
])
def test_bad_input_is_one_line(which, wave, tmp_path, words, said):
    (tmp_path / "shop.csv").write_text("servo,price\ntowerpro-sg90,2\n")
    (tmp_path / "bad.csv").write_text("servo,price\ntowerpro-sg90,2\nno-such,2\n")
    (tmp_path / "words.csv").write_text("servo,price\ntowerpro-sg90,cheap\n")
    if "arm.xml" in words or "lift.csv" in words:
        pytest.importorskip("mujoco")
    assert said in which(*words).error


@pytest.mark.long
def test_curves_of_several_servos_end_with_one_table(cli):
    words = ["curves", "hitec-hs-422", "towerpro-sg90", "--voltage", "5", "--quick"]
    text = cli(*words).out
    sheets = cli(*words, "--json").data
    table = text.split("side by side, cold, at 5 V\n")[1].splitlines()
    for line, sheet in zip(table[1:3], sheets["servos"], strict=True):
        part = sheet["voltages"][0]
        cells = line.split()
        assert cells[0] == sheet["servo"]
        assert float(cells[2]) == pytest.approx(part["cold"]["stall_torque"], rel=6e-3)
        assert f"{math.degrees(part['smallest_move']):.2f}" in line
    assert "side by side" not in cli(*words[:2], "--voltage", "5", "--quick").out


@pytest.mark.long(but="words0-True")
@pytest.mark.parametrize(("words", "warned"), [
    (["--supply", "9V"], True), (["--set", "supply.open_circuit_voltage=9V"], True), (["--supply", "7.4V"], True),
    (["--supply", "6V:0.1ohm"], False), ([], False)])
def test_a_supply_far_above_the_sheet_is_warned_of(cli, words, warned):
    told = cli("simulate", "hitec-hs-422", "--step", "0:60", "--duration", "0.5", *words).err
    assert ("its sheet ends at 6 V" in told) == warned
