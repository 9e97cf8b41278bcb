"""`servotwin robot run`: a robot that follows a motion, its files, and what is refused."""

import csv
import json
import math

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
ARM = """<mujoco><option timestep="0.002"/><worldbody>
  <body><joint name="shoulder" axis="0 -1 0" range="-90 90" {friction}/>
    <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".05"/>
    <body pos=".1 0 0"><joint name="elbow" axis="0 -1 0"/>
      <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".05"/>
      <body pos=".1 0 0"><joint name="slider" type="slide" axis="1 0 0"/><geom size=".01" mass=".01"/></body>
    </body></body></worldbody>{actuators}</mujoco>"""
MOTOR = '<actuator><position joint="elbow" kp="5"/></actuator>'
SERVOS = ("--servo", "*=hitec-hs-755hb", "--mount", "*=-90deg")
FILES = {"run.csv", "joints.csv", "summary.json", "tracking.png", "electrical.png", "sizing.png", "index.html"}


@pytest.fixture
def robot(cli, tmp_path, monkeypatch):
    """The command in a folder with an arm and a motion; nothing can be drawn unless a test lets it."""
    monkeypatch.setenv("MUJOCO_GL", "off")
    for name, friction, actuators in (("arm", "", ""), ("damped", 'damping="0.1"', ""), ("driven", "", MOTOR)):
        (tmp_path / f"{name}.xml").write_text(ARM.format(friction=friction, actuators=actuators))
    time = np.linspace(0.0, 0.3, 16)
    rows = [f"{t:.4f},{20.0 * math.sin(3.0 * t):.4f},{10.0 * t:.4f}" for t in time]
    (tmp_path / "wave.csv").write_text("\n".join(["time_s,shoulder_deg,elbow_deg", *rows]) + "\n")
    still = "\n".join(f"{t:.4f},0.1,0.2" for t in time)
    (tmp_path / "so.csv").write_text(f"time_s,shoulder_lift_rad,elbow_flex_rad\n{still}\n")
    return lambda *words: cli("robot", "run", *words)


URDF = """<robot name="arm"><link name="base"/>
  <link name="finger"><inertial><origin xyz="0 0 .02"/><mass value=".02"/><inertia ixx="5e-6" iyy="5e-6" izz="1e-6"
    ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="finger2"><inertial><origin xyz="0 0 .02"/><mass value=".02"/><inertia ixx="5e-6" iyy="5e-6" izz="1e-6"
    ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="grip" type="revolute"><parent link="base"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper=".6" effort="1" velocity="6"/></joint>
  <joint name="grip2" type="revolute"><parent link="base"/><child link="finger2"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper=".6" effort="1" velocity="6"/><mimic joint="grip"/></joint></robot>"""


def quick(*words, motion="wave.csv", out="out"):
    return (*words, "--motion", motion, "--out", out, "--no-video", "--settle", "0.05")


@pytest.mark.long
def test_files_and_table(robot, tmp_path):
    ended = robot(*quick("arm.xml", *SERVOS))
    assert ended.code == 0, ended.err
    assert ended.err.startswith("servotwin: warning: robot.png is left out: no picture of the robot can be drawn here")
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES
    assert "hitec-hs-755hb, model pulse  shoulder, elbow" in ended.out
    row, verdict = (line.split() for line in ended.out.splitlines() if line.split()[:1] == ["elbow"])
    assert row[2::2][:4] == ["deg", "deg", "ms", "A"]
    assert verdict[1:3] == ["big", "enough:"]
    assert max(map(len, ended.out.splitlines()[:7])) <= 80
    assert "thermal numbers by mass: shoulder, elbow" in ended.out
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert page.count("<img") == 3
    assert "All servos are big enough" in page
    with (tmp_path / "out" / "joints.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["shoulder.goal_deg"]) == pytest.approx(20.0 * math.sin(0.9), abs=1e-3)
    assert {"elbow.angle_deg", "elbow.ideal_deg", "elbow.needed_torque_Nm"} <= set(rows[0])
    assert float(rows[1]["time_s"]) - float(rows[0]["time_s"]) == pytest.approx(0.01)


@pytest.mark.long
def test_pictures_of_many_joints_have_pages(robot, tmp_path):
    """Thirteen hinges in a row, all that is computed before it is drawn; no page is known too late."""
    joints = [f"hinge_{k}" for k in range(13)]
    links = "".join(f'<body pos=".02 0 0"><joint name="{joint}" axis="0 0 1"/><geom size=".003" mass=".001"/>'
                    for joint in joints)
    (tmp_path / "chain.xml").write_text(f"<mujoco><worldbody>{links}{'</body>' * 13}</worldbody></mujoco>")
    time = np.linspace(0.0, 0.2, 11)
    np.savetxt(tmp_path / "row.csv", np.column_stack([time, *[3.0 * np.sin(9.0 * time)] * 13]), delimiter=",",
               comments="", header=",".join(["time_s", *(f"{joint}_deg" for joint in joints)]))
    words = quick("chain.xml", "--servo", "*=hitec-hs-755hb", "--model", "bounded", motion="row.csv")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "sizing-2.png").write_text("mine")
    refused = robot(*words)
    assert refused.code == 2
    assert refused.err.endswith("out/sizing-2.png exists already; use --force (overwrite=True) to replace it\n")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["sizing-2.png"]
    found = robot(*words, "--force", "--json").data
    pages = {"tracking-2.png", "electrical-2.png", "sizing-2.png"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES | pages
    assert {name.removeprefix("out/") for name in found["files"]} == FILES | pages
    assert len(found["joints"]) == 13
    html = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert all(html.count(f'<img src="{name}"') == 1 for name in FILES | pages if name.endswith(".png"))


@pytest.mark.long
def test_json_is_the_summary(robot, tmp_path):
    found = robot(*quick("arm.xml", *SERVOS), "--json").data
    files = found.pop("files")
    assert found == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert len(files) == len(FILES)
    shoulder = found["joints"]["shoulder"]
    assert 0.0 < shoulder["tracking"]["rms"] < 0.2
    assert shoulder["mount"] == {"zero": -math.pi / 2.0, "direction": 1, "ratio": 1.0}
    assert shoulder["sizing"]["margin"] > 1.0
    assert shoulder["sizing"]["heating"]["thermal_masses_assumed"]
    assert found["supply"] is None


@pytest.mark.long
def test_nothing_is_replaced_without_force(robot, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "sizing.png").write_text("mine")
    assert "sizing.png exists already" in robot(*quick("arm.xml", *SERVOS)).err
    assert (tmp_path / "out" / "sizing.png").read_text() == "mine"
    assert robot(*quick("arm.xml", *SERVOS), "--force").code == 0
    assert (tmp_path / "out" / "sizing.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_slides_actuators_and_shared_supplies(robot):
    words = ("driven.xml", "--servo", "elbow=hitec-hs-755hb", "--servo", "shoulder=hitec-hs-755hb", "--servo",
             "slider=hitec-hs-755hb", "--mount", "*=-90deg", "--mount", "slider=-10mm:1:9mm", "--supply", "5V:0.2ohm")
    found = robot(*quick(*words), "--json").data
    assert found["joints"]["slider"]["mount"] == {"zero": -0.01, "direction": 1, "ratio": 0.009}
    assert found["joints"]["slider"]["slides"]
    assert found["supply"] == {"open_circuit_voltage": 5.0, "internal_resistance": 0.2}
    assert found["joints"]["elbow"]["tracking"]["lowest_voltage"] < 5.0


@pytest.mark.long
@pytest.mark.parametrize("how", ["clear", "keep"])
def test_friction_of_the_model_is_cleared_or_kept(robot, how):
    assert robot(*quick("damped.xml", *SERVOS), "--friction", how, "--json").data["big_enough"]


@pytest.mark.long
def test_the_arm_of_the_package_has_servos_as_lerobot_sets_them(robot):
    found = robot(*quick("so101", motion="so.csv"), "--register", "P_Coefficient=32", "--json").data["joints"]
    assert len(found) == 6
    assert {each["servo"] for each in found.values()} == {"feetech-sts3215-12v"}
    assert {each["model"] for each in found.values()} == {"digital"}
    # Max_Torque_Limit 500 of 1000 halves what the gripper has
    share = found["gripper"]["sizing"]["stall_torque"] / found["elbow_flex"]["sizing"]["stall_torque"]
    assert share == pytest.approx(0.5, abs=0.05)


@pytest.mark.long
def test_an_episode_of_lerobot(robot, tmp_path):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    names = ["shoulder_pan.pos", "gripper.pos"]
    feature = {"dtype": "float32", "shape": [2], "names": names}
    for folder in ("meta", "data"):
        (tmp_path / "set" / folder).mkdir(parents=True)
    (tmp_path / "set" / "meta" / "info.json").write_text(json.dumps(
        {"robot_type": "so101_follower", "fps": 30, "features": {"action": feature, "observation.state": feature}}))
    goals = np.linspace([0.0, 10.0], [10.0, 20.0], 8, dtype=np.float32)
    values = arrow.array(goals.tolist(), arrow.list_(arrow.float32()))
    parquet.write_table(arrow.table({
        "action": values, "observation.state": values, "timestamp": arrow.array(np.arange(8, dtype=np.float32) / 30),
        "episode_index": arrow.array([5] * 8)}), tmp_path / "set" / "data" / "episodes.parquet")
    (tmp_path / "follower.json").write_text(json.dumps({name.removesuffix(".pos"): {
        "id": 1, "drive_mode": 0, "homing_offset": 0, "range_min": 1000, "range_max": 3000} for name in names}))
    words = quick("so101", motion="set")
    assert "--unit deg or --unit range" in robot(*words).error.replace("robot.png", "")
    found = robot(*words, "--unit", "range", "--calibration", "follower.json", "--episode", "5", "--json").data
    assert found["motion"] == "set, episode 5"
    assert found["duration"] == pytest.approx(7 / 30, rel=1e-3)
    assert not any("registers assumed" in note for note in found["notes"])
    factory = (*words, "--unit", "range", "--calibration", "follower.json", "--servo", "*=feetech-sts3215-7v4",
               "--json")
    assert robot(*factory, "--force").data["notes"][0] == (
        "registers assumed as LeRobot writes them for so101_follower (set lerobot and lerobot-gripper), not the "
        "factory's")
    own = robot(*factory, "--force", "--register", "P_Coefficient=32").data
    assert not any("registers assumed" in note for note in own["notes"])


@pytest.mark.long
def test_a_video(robot, tmp_path, monkeypatch):
    pytest.importorskip("cv2", reason="the extra `video` is not installed")
    from servotwin.robots.camera import NoDrawingError, check_drawing

    monkeypatch.delenv("MUJOCO_GL")
    try:
        check_drawing()
    except NoDrawingError as error:
        pytest.skip(str(error))
    ended = robot("arm.xml", *SERVOS, "--motion", "wave.csv", "--out", "out", "--settle", "0.05", "--fps", "10")
    assert (ended.code, ended.err) == (0, "")
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES | {"robot.png", "robot.webm"}
    assert (tmp_path / "out" / "robot.webm").read_bytes()[:4] == b"\x1aE\xdf\xa3"
    assert 'src="robot.webm"' in (tmp_path / "out" / "index.html").read_text()


@pytest.mark.long(but="words8-joint shoulder of wave.csv: got 'no servo at it'")
@pytest.mark.parametrize(("words", "said"), [
    (("none.xml", *SERVOS), "none.xml is no file"),
    (("wave.csv", *SERVOS), "wave.csv is no model that MuJoCo reads"),
    (("so102",), "did you mean 'so101'"),
    (("arm.xml",), "servos of the robot: got 'none'"),
    (("arm.xml", "--servo", "elbwo=hitec-hs-755hb"), "unknown joint of --servo 'elbwo'; did you mean 'elbow'"),
    (("arm.xml", "--servo", "elbow"), "--servo: got 'elbow', allowed: JOINT=ID"),
    (("arm.xml", "--servo", "elbow=a", "--servo", "elbow=b"), "--servo elbow: got 'a and b'"),
    (("arm.xml", "--servo", "*=hs-755"), "unknown servo 'hs-755'"),
    (("arm.xml", "--servo", "elbow=hitec-hs-755hb"), "joint shoulder of wave.csv: got 'no servo at it'"),
    (("arm.xml", "--servo", "*=hitec-hs-755hb", "--mount", "*=30deg"), "--mount gives it another zero"),
    (("arm.xml", *SERVOS, "--mount", "elbow=1:2"), "--mount elbow: direction: got '2'"),
    (("arm.xml", *SERVOS, "--mount", "elbow=1mm"), "--mount elbow: got '1mm'"),
    (("arm.xml", *SERVOS, "--mount", "elbow=1:1:0"), "--mount elbow: ratio: got '0'"),
    (("arm.xml", *SERVOS, "--mount", "elbow=1:1:1:1"), "allowed: JOINT=ZERO[:DIRECTION[:RATIO]]"),
    (("arm.xml", *SERVOS, "--mount", "slider=0mm"), "--mount slider: got 'a joint without a servo'"),
    (("arm.xml", *SERVOS, "--supply", "6V:"), "VOLTS[:OHMS]"),
    (("arm.xml", *SERVOS, "--supply", "-6"), "--supply: got '-6'"),
    (("arm.xml", *SERVOS, "--supply", "60"), "supply voltage of hitec-hs-755hb"),
    (("arm.xml", *SERVOS, "--supply", "6", "--servo", "elbow=towerpro-mg996r"), "servos on shared supplies are of one"),
    (("arm.xml", *SERVOS, "--package", "arm"), "--package: got 'arm', allowed: NAME=FOLDER"),
    (("arm.xml", *SERVOS, "--package", "arm=none"), "--package arm: got 'none', allowed: a folder that is there"),
    (("arm.xml", *SERVOS, "--package", "a=.", "--package", "a=."), "--package a: got '. and .', allowed: one"),
    (("arm.xml", *SERVOS, "--friction", "off"), "--friction: got 'off'"),
    (("damped.xml", *SERVOS), "--friction clear sets it so, --friction keep"),
    (("arm.xml", *SERVOS, "--hold", "spline"), "--hold: got 'spline'"),
    (("arm.xml", *SERVOS, "--timestep", "0.1"), "timestep of the model: got 0.1"),
    (("arm.xml", *SERVOS, "--settle", "-1"), "--settle: got -1.0"),
    (("arm.xml", *SERVOS, "--blend", "0"), "--blend: got 0.0"),
    (("arm.xml", *SERVOS, "--output-step", "nan"), "--output-step: got nan"),
    (("arm.xml", *SERVOS, "--fps", "0"), "--fps: got 0.0"),
    (("arm.xml", *SERVOS, "--unit", "deg"), "--unit for wave.csv"),
    (("arm.xml", *SERVOS, "--unit", "deg", "--unit", "rad"), "--unit: got 'deg, rad'"),
    (("arm.xml", *SERVOS, "--model", "quick"), "unknown model 'quick'"),
    (("arm.xml", *SERVOS, "--set", "motor.armature=1"), "motor.armature"),
    (("arm.xml", *SERVOS, "--register", "P_Coefficient=1"), "a servo with registers"),
    (("arm.xml", *SERVOS, "--motion", "none.csv"), "none.csv: no such file"),
    (("arm.xml", *SERVOS, "--motion", "so.csv"), "unknown column of so.csv 'shoulder_lift_rad'"),
    (("arm.xml", *SERVOS, "--motion", "nan.csv"), "nan.csv: line 3, elbow_deg: got 'nan'"),
    (("arm.xml", *SERVOS, "--out", "no/where"), "--out no/where: the folder no does not exist"),
    (("arm.xml", *SERVOS, "--out", "wave.csv"), "--out wave.csv is no folder"),
    (("arm.xml", *SERVOS, "--video"), "--no-video does without"),
])
def test_bad_input_is_one_line(robot, tmp_path, words, said):
    (tmp_path / "nan.csv").write_text("time_s,elbow_deg\n0,1\n1,nan\n")
    own = {option for option in words if option.startswith("--")}
    rest = [word for pair in (("--motion", "wave.csv"), ("--out", "out")) if pair[0] not in own for word in pair]
    if "--video" not in own:
        rest.append("--no-video")
    before = set(tmp_path.iterdir())
    ended = robot(*words, *rest)
    kept = [line for line in ended.err.splitlines() if not line.startswith("servotwin: warning: robot.png")]
    assert ended.code == 2
    assert len(kept) == 1, ended.err
    assert said in kept[0]
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize("words", [["robot"], ["robot", "run", "--help"]])
def test_help_has_an_example(cli, words):
    ended = cli(*words)
    assert (ended.code, ended.err) == (0, "")
    assert "Example: servotwin robot run" in ended.out


@pytest.mark.long
def test_a_joint_that_mimics_another_gets_no_servo(robot, tmp_path):
    """Two fingers of 20 g on one servo needed 20 N m when each had its own."""
    (tmp_path / "grip.urdf").write_text(URDF)
    rows = "\n".join(f"{0.02 * k:.2f},{10.0 - 10.0 * math.cos(0.05 * k):.4f}" for k in range(20))
    (tmp_path / "grip.csv").write_text(f"time_s,grip_deg\n{rows}\n")
    words = quick("grip.urdf", "--servo", "*=towerpro-mg996r", motion="grip.csv")
    ended = robot(*words, "--json")
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert list(found["joints"]) == ["grip"]
    assert found["notes"] == ["grip2 follows grip and gets no servo"]
    assert found["joints"]["grip"]["sizing"]["worst"]["torque"] < 0.05
    ended = robot(*words, "--servo", "grip2=towerpro-mg996r", "--force")
    assert ended.code == 2
    assert "servo of joint grip2: got 'one of its own', allowed: none: grip2 follows grip" in ended.err


LYING = """<robot name="arm"><link name="base"><collision><geometry><box size=".06 .06 .09"/></geometry>
  </collision></link>
  <link name="column">{0}</link><link name="arm">{0}<collision><origin xyz="0 0 .05"/><geometry><box size=".03 .03 .1"/>
  </geometry></collision></link><joint name="pan" type="revolute"><parent link="base"/><child link="column"/>
  <origin xyz="0 0 .025"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="2" velocity="5"/></joint>
  <joint name="lift" type="revolute"><parent link="column"/><child link="arm"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" effort="2" velocity="5"/></joint></robot>""".format(
    '<inertial><mass value=".05"/><inertia ixx="3e-5" iyy="3e-5" izz="3e-5" ixy="0" ixz="0" iyz="0"/></inertial>')


def test_what_lies_in_what_is_said_and_nothing_judged(robot, cli, tmp_path):
    """An arm's box reaches 20 mm into a base to which no joint joins it."""
    (tmp_path / "lying.urdf").write_text(LYING)
    (tmp_path / "m.csv").write_text("time_s,pan_deg\n0,0\n0.2,10\n0.4,0\n")
    words = ("lying.urdf", "--servo", "*=feetech-sts3215-7v4", "--json")
    kept = json.loads(robot(*quick(*words, motion="m.csv")).out)
    assert (kept["judged"], kept["big_enough"]) == (False, None)
    assert kept["notes"][0] == "arm lies 20 mm in what is fixed where the motion begins"
    assert kept["reason"] == f"{kept['notes'][0]} (overlap=ignore leaves such contacts out)"
    sizing = kept["joints"]["pan"]["sizing"]
    assert (sizing["verdict"], sizing["judged"]) == (f"not judged: {kept['reason']}", False)
    assert "The servos are not judged" in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    free = json.loads(robot(*quick(*words, "--contact", "overlap=ignore", motion="m.csv", out="free")).out)
    assert (free["judged"], free["reason"], free["big_enough"]) == (True, None, True)
    refused = robot(*quick(*words, "--contact", "all", motion="m.csv", out="none"))
    assert (refused.code, refused.err) == (2, "servotwin: error: --contact: got 'all', allowed: overlap=ignore\n")
    assert not (tmp_path / "none").exists()
    which = ("catalog", "which", "--robot", "lying.urdf", "--motion", "m.csv", "--among", "feetech-sts3215-7v4",
             "--voltage", "7.4")
    assert "not judged" in cli(*which, "--why").out
    assert "not judged" not in cli(*which, "--contact", "overlap=ignore", "--why").out


def test_a_star_stands_for_the_joints_that_the_robot_drives(robot, tmp_path):
    """Of two hinges and a slide an actuator drives one; another has a servo because it is named."""
    (tmp_path / "elbow.csv").write_text("time_s,elbow_deg\n0,0\n0.2,10\n0.4,0\n")
    words = ("driven.xml", "--servo", "*=hitec-hs-755hb", "--mount", "elbow=0deg", "--json")
    found = json.loads(robot(*quick(*words, motion="elbow.csv")).out)
    assert list(found["joints"]) == ["elbow"]
    assert "no servo at shoulder: no actuator of the file drives it" in found["notes"]
    both = json.loads(robot(*quick(*words, "--servo", "shoulder=hitec-hs-755hb", motion="elbow.csv", out="both")).out)
    assert list(both["joints"]) == ["shoulder", "elbow"]
    assert not any("no servo at" in note for note in both["notes"])
