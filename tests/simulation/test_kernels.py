"""Each compiled form on its own: who takes it, and that it moves a servo as `simulate` does."""

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.lanes import whole_runs

STEP = st.signals.step(10.0, 50.0, at=0.02, unit="deg")
LOOSE = {"gear.backlash": 0.005, "gear.output_inertia": 1e-3}
RECORDED = st.loads.Recorded([0.0, 9.0], [0.01, 0.02])
# Each compiled form, what leads to it and how far it may be off; the order halves the work between two processes
FORMS = {
    "runs": (LOOSE, st.loads.Spring(0.05, 0.5), "float64", 1e-9),
    "by_coils": ({"motor.armature_inductance": 5e-4}, None, "float64", 1e-12),
    "by_gaps": (LOOSE, None, "float64", 1e-9),
    "by_strides": ({"friction.load_friction": 0.05}, st.loads.Spring(0.05, 0.5), "float64", 1e-9),
    "by_bands": ({"friction.breakaway_ratio": 1.4, "friction.stribeck_speed": 5.0}, None, "float64", 1e-9),
    "side_by_side_float64": ({}, st.loads.Inertia(1e-3), "float64", 1e-9),
    "side_by_side_float32": ({}, st.loads.Inertia(1e-3), "float32", 1e-4),
}


@pytest.mark.long(but="side_by_side_float64")
@pytest.mark.parametrize("name", FORMS)
def test_each_compiled_form_moves_a_servo_as_it_should(servo, monkeypatch, name):
    changes, load, dtype, tolerance = FORMS[name]
    used, kernels = [], whole_runs.kernels
    monkeypatch.setattr(whole_runs, "kernels", lambda recipe: (used.append(recipe.name), kernels(recipe))[1])
    kind = st.PulseServoInductive if "motor.armature_inductance" in changes else st.PulseServo
    model = kind(servo.replace(changes))
    column = {"motor.armature_resistance": [2.8, 3.2, 3.6]}
    batch = st.simulate_many(model, STEP, duration=0.15, load=load, parameters=column, output_step=0.01, dtype=dtype)
    assert set(used) - {"ending"} == {name}  # how a lane ends is looked at by a form of its own
    for lane, R in enumerate(column["motor.armature_resistance"]):
        alone = st.simulate(kind(model.servo.replace({"motor.armature_resistance": R})), STEP, duration=0.15,
                            load=load, output_step=0.01)
        np.testing.assert_allclose(batch["output_angle"][lane], alone["output_angle"], rtol=0.0, atol=tolerance)
        assert np.ptp(alone["output_angle"]) > 0.2
