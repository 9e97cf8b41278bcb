"""The peers: the P and D law with a friction that stops within a step, in NumPy, and a position joint of MuJoCo."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

HINGE = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast"><flag contact="disable"/></option>
  <worldbody>
    <body>
      <joint name="horn" type="hinge" axis="0 0 1" armature="0.003" damping="0.35" frictionloss="0.07"/>
      <geom type="box" size="0.05 0.01 0.01" mass="0.1"/>
    </body>
  </worldbody>
  <actuator><position joint="horn" kp="33" forcerange="-4 4"/></actuator>
</mujoco>
"""


def prepare(numbers: Mapping[str, Any], plant: Mapping[str, Any], told: Sequence[Any], duration: float, step: float,
            lanes: int) -> Callable[[], Any]:
    """Return a function that steps the first lanes, all at once, and returns their last angles [rad].

    Voltage and current follow the duty at once; semi-implicit Euler, as BAM's simulator takes it.
    """
    def of(name: str) -> Any:
        group, key = name.split(".")
        return numbers[name][:lanes] if name in numbers else plant[group][key]

    N, R = plant["gear"]["gear_reduction"], of("motor.armature_resistance")
    K, V = N * of("motor.torque_constant"), of("supply.open_circuit_voltage")
    J = N**2 * of("motor.rotor_inertia") + numbers["load.inertia"][:lanes]
    b, F = N**2 * of("motor.motor_viscous_friction"), N * of("friction.coulomb_torque_forward")
    F_back = N * of("friction.coulomb_torque_backward")
    firmware = plant["firmware"]
    k_p, k_d, count = of("firmware.proportional_gain"), firmware["derivative_gain"], firmware["angle_quantum"]
    time = np.arange(round(duration / step)) * step
    goals = np.stack([one.pieces(time) for one in told[:lanes]])
    start = np.array([one.initial for one in told[:lanes]])

    def run() -> Any:
        q, w, last, duty = start.copy(), np.zeros(lanes), np.zeros(lanes), np.zeros(lanes)
        for k in range(len(time)):
            error = goals[:, k] - count * np.floor(q / count + 0.5)
            volts, duty = V * duty, np.clip(k_p * error + k_d * (error - last) / step, -0.97, 0.97)
            last = error
            free = w + step / J * (K * (volts - K * w) / R - b * w - numbers["load.torque"][:lanes])
            w = np.where(free > 0.0, np.maximum(free - step / J * F, 0.0), np.minimum(free + step / J * F_back, 0.0))
            q = q + step * w
        return q

    return run


def rollout(told: Sequence[Any], duration: float, step: float) -> Callable[[], Any]:
    """Return a function that rolls out a hinge with a position actuator, on two threads."""
    import mujoco
    from mujoco import rollout as of_mujoco

    model = mujoco.MjModel.from_xml_string(HINGE.format(step=step))
    data = [mujoco.MjData(model) for _ in range(2)]
    time = np.arange(round(duration / step)) * step
    control = np.stack([one.pieces(time) for one in told])[:, :, None]
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data[0], state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    pool = of_mujoco.Rollout(nthread=2)
    return lambda: pool.rollout(model, data, np.tile(state, (len(told), 1)), control)
