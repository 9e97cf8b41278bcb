"""The JAX peer: the bounded servo by RK4 with a fixed step as `lax.scan`, and `jacfwd` through all of it, compiled.

Friction is a tanh of the speed, for a fixed step finds no instant of sticking; it is as steep as the step allows.
"""

import os
from collections.abc import Callable
from typing import Any

import numpy as np

import servotwin as st
from servotwin.loads import Load

STEEP = 2.0  # friction's rate times the step; RK4 is stable up to 2.78
SEARCHED = (("R",), ("K", "K_b"), ("J",), ("F_forward",), ("F_backward",), ("gain",), ("half_deadband",), ("p",))


def prepare(model: st.BoundedServo, load: Load, command: np.ndarray, sample: float,
            step: float) -> Callable[[], np.ndarray]:
    """Compile; return a function that returns d angle / d logarithm of the searched numbers, shape (n, p) [rad].

    `command` are control voltages [V], each held for a sample [s].
    """
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    import jax

    jax.config.update("jax_enable_x64", True)
    jnp = jax.numpy
    plant = model.pack(load)._asdict()
    steps = round(sample / step)
    slow = plant["F_forward"] * step / (plant["J"] * STEEP)  # rad/s

    def angles(x: Any) -> Any:
        n = dict(plant)
        for k, names in enumerate(SEARCHED):
            n |= {name: plant[name] * jnp.exp(x[k]) for name in names}
        n["J"] = (plant["J"] - load.inertia) * jnp.exp(x[2]) + load.inertia

        def f(q: Any, w: Any, v_c: Any) -> tuple[Any, Any]:
            v_e = v_c - n["p"] * q - n["b_o"]
            v_d = v_e - jnp.clip(v_e, -n["half_deadband"], n["half_deadband"])
            v_a = jnp.clip(n["gain"] * v_d, -n["V_max"], n["V_max"])
            f_ec = jnp.where(w > 0.0, n["F_forward"], n["F_backward"]) * jnp.tanh(w / slow)
            return w, (n["K"] * (v_a - n["K_b"] * w) / n["R"] - n["b"] * w - f_ec) / n["J"]

        def rk4(y: tuple[Any, Any], v_c: Any) -> tuple[Any, Any]:
            q, w = y
            q1, w1 = f(q, w, v_c)
            q2, w2 = f(q + 0.5 * step * q1, w + 0.5 * step * w1, v_c)
            q3, w3 = f(q + 0.5 * step * q2, w + 0.5 * step * w2, v_c)
            q4, w4 = f(q + step * q3, w + step * w3, v_c)
            return q + step / 6.0 * (q1 + 2.0 * (q2 + q3) + q4), w + step / 6.0 * (w1 + 2.0 * (w2 + w3) + w4)

        def one_sample(y: tuple[Any, Any], v_c: Any) -> tuple[tuple[Any, Any], Any]:
            return jax.lax.fori_loop(0, steps, lambda _, y: rk4(y, v_c), y), y[0]

        start = (command[0] - n["b_o"]) / n["p"]
        return jax.lax.scan(one_sample, (start, jnp.zeros_like(start)), command)[1]

    at = np.zeros(len(SEARCHED))
    compiled = jax.jit(jax.jacfwd(angles)).lower(at).compile()
    return lambda: np.asarray(compiled(at).block_until_ready())
