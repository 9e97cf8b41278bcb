"""Robot files as strangers have them, rebuilt small by published numbers: which servos they get, and what is said.

The numbers: an SO-101 whose URDF has the shoulder's hull 26 mm in the base and whose MJCF has not; a walker whose file
is beside the scene that has its floor; a biped whose feet begin 17 mm in the floor; a humanoid of 47 hinges and 30
motors.
"""

import mujoco
import numpy as np

import servotwin as st
from servotwin.robots.model_file import driven_joints, plant_of

MASS = ('<inertial><origin xyz="{0}"/><mass value="{1}"/>'
        '<inertia ixx="{2}" iyy="{2}" izz="{2}" ixy="0" ixz="0" iyz="0"/></inertial>')
LIMIT = '<axis xyz="{0}"/><limit lower="-2" upper="2" effort="2" velocity="5"/>'
BOX = '<collision><origin xyz="0 0 0.02"/><geometry><box size="{0}"/></geometry></collision>'
LINKS = (("base", "0 0 0", 0.3, 2e-4), ("shoulder", "0 0 0.02", 0.1, 5e-5), ("upper", "0 0 0.06", 0.3, 4e-5))
model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
time = np.linspace(0.0, 1.0, 51)
way = 0.25 * (1.0 - np.cos(2.0 * np.pi * time))


def arm_urdf() -> str:
    """Return an arm of two joints whose shoulder stands 26 mm in its base, as a CAD exporter writes it."""
    boxes = {"base": BOX.format("0.06 0.06 0.05"), "shoulder": BOX.format("0.05 0.05 0.05"), "upper": ""}
    links = "".join(f'<link name="{name}">{MASS.format(*rest)}{boxes[name]}</link>' for name, *rest in LINKS)
    joints = "".join(f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
                     f'<origin xyz="0 0 {z}"/>{LIMIT.format(axis)}</joint>' for name, parent, child, z, axis in (
                         ("pan", "base", "shoulder", 0.024, "0 0 1"), ("lift", "shoulder", "upper", 0.05, "0 1 0")))
    return f'<robot name="arm">{links}{joints}</robot>'


def arm_mjcf() -> str:
    """Return the same arm as MJCF, whose author left the shapes of its own links out."""
    base, shoulder, upper = (f'<inertial pos="{at}" mass="{mass}" diaginertia="{spread} {spread} {spread}"/>'
                             for _, at, mass, spread in LINKS)
    moving = (f'<body name="shoulder" pos="0 0 .024"><joint name="pan"/>{shoulder}<body name="upper" pos="0 0 .05">'
              f'<joint name="lift" axis="0 1 0"/>{upper}</body></body>')
    return f'<mujoco><worldbody><body name="base">{base}{moving}</body></worldbody></mujoco>'


def biped(height: float, floor: bool) -> str:
    """Return a trunk of 0.8 kg on two legs, its soles 120 mm below it."""
    legs = "".join(
        f'<body name="leg{k}" pos="0 {y} 0"><joint name="hip{k}" axis="0 1 0"/><geom type="capsule" size=".01" '
        'mass=".1" fromto="0 0 -.02 0 0 -.1" contype="0" conaffinity="0"/><geom type="box" size=".06 .03 .01" '
        'pos="0 0 -.11" mass=".05"/></body>' for k, y in enumerate((0.05, -0.05)))
    ground = '<geom name="floor" type="plane" size="1 1 .1"/>' if floor else ""
    return (f'<mujoco><option timestep="0.002"/><worldbody>{ground}<body name="trunk" pos="0 0 {height}"><freejoint/>'
            f'<geom type="box" size=".05 .05 .03" mass=".8" contype="0" conaffinity="0"/>{legs}</body></worldbody>'
            "</mujoco>")


def humanoid() -> str:
    """Return a tree of 47 hinges, of which 30 have motors: the others are wheels of gears and springs."""
    bodies = "".join(f'<body><joint name="j{k}" axis="0 1 0"/><geom size=".01" contype="0" conaffinity="0"/></body>'
                     for k in range(47))
    motors = "".join(f'<position joint="j{k}"/>' for k in range(30))
    return f'<mujoco><worldbody><body name="torso">{bodies}</body></worldbody><actuator>{motors}</actuator></mujoco>'


def judged(name: str, text: str, joints: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    """Let a robot follow a motion, print what is said of it, and return peak torque and rms error of its joints."""
    motion = st.robots.Motion(time=time, angles=dict.fromkeys(joints, way), source="wave")
    run = st.robots.run_motion(mujoco.MjSpec.from_string(text), dict.fromkeys(joints, model), motion, settle=0.1)
    verdict = next(iter(st.robots.sizing_of(run).values())).verdict
    print(f"{name:32} {len(joints):2} servos  {verdict}")
    for note in run.notes:
        print(f"{'':34}note: {note}")
    return {joint: (run.record[joint].peak("joint_torque"), run.tracking[joint].rms) for joint in joints}


urdf = judged("arm, URDF", arm_urdf(), ("pan", "lift"))
mjcf = judged("arm, MJCF", arm_mjcf(), ("pan", "lift"))
for joint, (torque, error) in urdf.items():
    print(f"{'':34}{joint}: peak torque {100.0 * (torque / mjcf[joint][0] - 1.0):z.1f} %, rms error "
          f"{100.0 * (error / mjcf[joint][1] - 1.0):z.1f} % off the MJCF's")
judged("biped on a floor", biped(0.12, True), ("hip0", "hip1"))
judged("biped without its scene", biped(0.12, False), ("hip0", "hip1"))
judged("biped, feet 17 mm in the floor", biped(0.103, True), ("hip0", "hip1"))
plant = plant_of(st.robots.robot_model(mujoco.MjSpec.from_string(humanoid())))
found = driven_joints(plant)
print(f"{'humanoid of 47 hinges':32} {len(found.joints):2} servos  {found.said[0][:64]} ...")
