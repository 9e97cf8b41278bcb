"""Robots for the benchmarks: a hinge with a weight, two links, chains of three, a gripper, a joint at its limit."""

import servotwin as st

MASS, LENGTH, SPREAD = 0.1, 0.1, 1e-6  # kg, m, kg m²


def servos() -> dict[str, st.BoundedServo | st.PulseServo | st.DigitalServo]:
    """Return a servo of each fidelity, by its name in tables."""
    analog = st.load_servo("hitec-hs-755hb")
    return {"bounded": st.BoundedServo(analog), "pulse": st.PulseServo(analog),
            "digital": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))}


def option(integrator: str, dt: float) -> str:
    return f'<option timestep="{dt}" integrator="{integrator}"/>'


def hinge(integrator: str, dt: float, actuator: str = "") -> str:
    return f"""<mujoco>{option(integrator, dt)}<worldbody><body><joint name="elbow" axis="0 1 0"/>
      <inertial pos="{LENGTH} 0 0" mass="{MASS}" diaginertia="{SPREAD} {SPREAD} {SPREAD}"/></body></worldbody>
      <actuator>{actuator}</actuator></mujoco>"""


def links(integrator: str, dt: float, axis: str) -> str:
    """Return two links that hang (axis y) or lie flat (axis z)."""
    return f"""<mujoco>{option(integrator, dt)}<worldbody><body><joint name="shoulder" axis="{axis}"/>
      <geom type="capsule" fromto="0 0 0 .12 0 0" size=".01" mass=".06"/>
      <body pos=".12 0 0"><joint name="elbow" axis="{axis}"/>
        <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".05"/><site name="tool" pos=".1 0 0"/>
      </body></body></worldbody></mujoco>"""


def chains(joints: int, dt: float = 1e-3) -> str:
    """Return legs of up to three links each, with so many joints in all."""
    bodies = ""
    for first in range(0, joints, 3):
        names = [f"j{k}" for k in range(first, min(first + 3, joints))]
        leg = "".join(f'<body pos="{0.1 if n else 0} 0 0"><joint name="{name}" axis="0 1 0"/>'
                      '<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".03"/>'
                      for n, name in enumerate(names))
        bodies += f'<body pos="0 {0.1 * first} 0">{leg}{"</body>" * len(names)}</body>'
    return (f'<mujoco><option timestep="{dt}" integrator="implicitfast"><flag contact="disable"/></option>'
            f"<worldbody>{bodies}</worldbody></mujoco>")


def gripper(integrator: str, dt: float, free: bool = False) -> str:
    """Return two fingers beside a box, which may move or not."""
    finger = '<body pos="0 {} 0"><joint name="{}" axis="0 0 1"/><geom type="capsule" fromto="0 0 0 .12 0 0" ' \
             'size=".006" mass=".03"/></body>'
    return f"""<mujoco>{option(integrator, dt)}<worldbody><geom type="plane" size="1 1 .1" pos="0 0 -.0125"/>
      <body name="box" pos=".09 0 0">{'<freejoint/>' if free else ''}<geom type="box" size=".012 .012 .012" mass=".05"/>
      </body>{finger.format('.03', 'left')}{finger.format('-.03', 'right')}</worldbody></mujoco>"""


def limited(integrator: str, dt: float, solref: str = "0.02 1") -> str:
    """Return a weight on a hinge that its limit stops."""
    return f"""<mujoco>{option(integrator, dt)}<worldbody><body>
      <joint name="elbow" axis="0 1 0" limited="true" range="-60 30" solreflimit="{solref}"/>
      <inertial pos="{LENGTH} 0 0" mass="{MASS}" diaginertia="{SPREAD} {SPREAD} {SPREAD}"/>
    </body></worldbody></mujoco>"""
