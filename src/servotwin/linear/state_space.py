"""State-space systems of the models where they are linear, as named python-control systems."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.linear.loops import loop_of
from servotwin.linear.transfer_function import check_model
from servotwin.loads import as_load
from servotwin.models import PulseServo, PulseServoInductive

if TYPE_CHECKING:
    import control

    from servotwin.loads import Load, Part
    from servotwin.models import Model


def state_space(model: Model, load: Load | Part | None = None, *, input: str | None = None,
                angle: float | None = None, frame_period: float | None = None) -> control.StateSpace:
    """Return the linear system of `transfer_function` with its states, and with all of its outputs.

    Parameters
    ----------
    model : Model
        A motor, a mean-voltage servo or a pulse servo, whose loop has the gain of the mean of its pulses.
    load : Load, optional
        Inertia, viscous friction, springs and elastic arms count, and pendulums by their stiffness.
    input : str, optional
        `armature_voltage` [V] of a motor; `command_voltage` [V], `pulse_width` [s] or `command_angle` [rad] of a
        servo. Unless given: `armature_voltage`, `pulse_width`.
    angle : float, optional
        About which a pendulum moves; where it hangs unless given [rad].
    frame_period : float, optional
        T_f of a pulse servo [s]; the servo's own unless given.

    Returns
    -------
    control.StateSpace
        States are deviations, named by their signals: angles and speeds, of the motor at the output shaft, and the
        current of a model with inductance. Outputs are those that `transfer_function` has.

    Raises
    ------
    UnknownNameError, LoadError, InputError
        As `transfer_function` does.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> system = state_space(model, st.loads.Inertia(1e-3), input="command_angle")
    >>> system.state_labels, system.output_labels[-1]
    (['output_angle', 'output_speed'], 'feedback_voltage')
    """
    import control

    check_model(model, frame_period)
    if isinstance(model, PulseServo | PulseServoInductive):
        model.check_mean("the state space", ("motor.brush_drop_voltage",))
    loop = loop_of(model, as_load(load), input, angle, frame_period)
    rows = loop.rows
    system: Any = control.StateSpace(
        loop.A, loop.B[:, np.newaxis], np.array([row.of_state for row in rows.values()]),
        np.array([[row.of_input] for row in rows.values()]), states=list(loop.plant.states), inputs=[loop.input],
        outputs=list(rows), name=type(model).__name__)
    return system
