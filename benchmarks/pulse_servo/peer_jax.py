"""The JAX peer: `lax.scan` over the frames of formulas.py for all lanes at once, compiled; one device for each core."""

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from fleet import Fleet, columns
from formulas import State, frame


def load(threads: int) -> Any:
    """Import JAX with one device for each thread; left alone it keeps much of this on one core."""
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    os.environ.setdefault(
        "XLA_FLAGS", f"--xla_force_host_platform_device_count={threads} --xla_cpu_prefer_vector_width=512")
    import jax

    jax.config.update("jax_enable_x64", True)
    return jax


def prepare(fleet: Fleet, frames: int, dtype: str, threads: int) -> Callable[[], np.ndarray]:
    """Compile; return a function that runs all frames and returns the angles at the end [rad]."""
    jax = load(threads)
    jnp, P = jax.numpy, jax.sharding.PartitionSpec
    mesh = jax.make_mesh((threads,), ("lanes",))
    lanes, each = jax.sharding.NamedSharding(mesh, P("lanes")), jax.sharding.NamedSharding(mesh, P(None, "lanes"))

    def run(lane: dict[str, Any], q: Any, pulses: Any) -> Any:
        rest = jnp.zeros_like(q)

        def step(state: State, t_in: Any) -> tuple[State, None]:
            return frame(jnp, lane, state, t_in)[0], None

        return jax.lax.scan(step, State(q, rest, rest, rest), pulses)[0].angle

    lane = {name: jax.device_put(x.astype(dtype), lanes) for name, x in columns(fleet).items()}
    q = jax.device_put(fleet.angle.astype(dtype), lanes)
    pulses = jax.device_put(fleet.pulses(frames).astype(dtype), each)
    compiled = jax.jit(run).lower(lane, q, pulses).compile()
    return lambda: np.asarray(compiled(lane, q, pulses).block_until_ready())
