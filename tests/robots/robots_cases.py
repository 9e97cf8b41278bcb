"""Robots for tests: a hinge with a weight, two links, a slide, a chain; and servos for them."""

import math

import numpy as np

import servotwin as st

MASS, LENGTH, SPREAD = 0.1, 0.1, 1e-6  # kg, m, kg m²: a weight on a hinge
WEIGHT = st.loads.Pendulum(mass=MASS, length=LENGTH, inertia=MASS * LENGTH**2 + SPREAD, hanging_angle=math.pi / 2.0,
                           gravity=9.81)
"""The same as a load: the hinge turns downwards from the horizontal."""


def option(integrator, dt, flags=""):
    return f'<option timestep="{dt}" integrator="{integrator}">{flags}</option>'


def hinge(integrator="implicitfast", dt=1e-3, joint='type="hinge" axis="0 1 0"'):
    return f"""<mujoco>{option(integrator, dt)}<worldbody><body><joint name="elbow" {joint}/>
      <inertial pos="{LENGTH} 0 0" mass="{MASS}" diaginertia="{SPREAD} {SPREAD} {SPREAD}"/>
    </body></worldbody></mujoco>"""


def links(integrator="implicitfast", dt=1e-3, axis="0 1 0", actuators=""):
    """Return two links that hang in gravity (y axis) or lie flat as a SCARA arm's (z axis)."""
    return f"""<mujoco>{option(integrator, dt)}<worldbody><body><joint name="shoulder" axis="{axis}"/>
      <geom type="capsule" fromto="0 0 0 .12 0 0" size=".01" mass=".06"/>
      <body pos=".12 0 0"><joint name="elbow" axis="{axis}"/>
        <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".05"/><site name="tool" pos=".1 0 0"/>
      </body></body></worldbody>{actuators}</mujoco>"""


def servo(kind):
    """Return a model of an analog servo, or of a bus servo."""
    if kind is st.DigitalServo:
        return st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    return kind(st.load_servo("hitec-hs-755hb"))


def interpolated(result, name, time):
    return np.interp(time, result.time, result[name])
