"""The MuJoCo peer: `mujoco.rollout` of one hinge with a position actuator and dry friction at 1 ms."""

from collections.abc import Callable

import numpy as np
from fleet import Fleet

HINGE = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast"><flag contact="disable"/></option>
  <worldbody>
    <body>
      <joint name="horn" type="hinge" axis="0 0 1" armature="0.006" damping="0.3" frictionloss="0.2"/>
      <geom type="box" size="0.05 0.01 0.01" mass="0.1"/>
    </body>
  </worldbody>
  <actuator><position joint="horn" kp="10" forcerange="-1.8 1.8"/></actuator>
</mujoco>
"""


def prepare(fleet: Fleet, lanes: int, duration: float, threads: int) -> Callable[[], np.ndarray]:
    """Return a function that runs the first lanes' commands and returns the angles at the end [rad]."""
    import mujoco
    from mujoco import rollout

    model = mujoco.MjModel.from_xml_string(HINGE)
    data = [mujoco.MjData(model) for _ in range(threads)]
    time = np.arange(round(duration / model.opt.timestep)) * model.opt.timestep
    angles = (fleet.widths - 0.64e-3) / 0.57e-3
    control = np.array([angles[i][np.searchsorted(fleet.times[i], time, side="right") - 1]
                        for i in fleet.command[:lanes]])[:, :, None]
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data[0], state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.tile(state, (lanes, 1))
    pool = rollout.Rollout(nthread=threads)

    def run() -> np.ndarray:
        states, _ = pool.rollout(model, data, start, control)
        return states[:, -1, 1]

    return run
