"""The Miuzei 25 kg servo with an arm: folds by run, each fitted on the others and held against its own."""

import time
from pathlib import Path

import numpy as np
from report import folds, row

import servotwin as st

REDUCTION = 300.0  # assumed: only products with it act
START = {
    "motor": {"armature_resistance": 1.5, "torque_constant": 1.0 / REDUCTION, "back_emf_constant": 1.0 / REDUCTION,
              "rotor_inertia": 0.012 / REDUCTION**2, "motor_viscous_friction": 0.0},
    "gear": {"gear_reduction": REDUCTION},
    "friction": {"coulomb_torque_forward": 0.3 / REDUCTION, "coulomb_torque_backward": 0.3 / REDUCTION},
    "electronics": {"stretcher_gain": 75.0, "one_shot_slope": 1.0 / 850.0, "one_shot_offset": 0.0, "deadband": 5e-6,
                    "frame_period": 0.01, "off_state": "brake", "pulse_timeout": 0.03, "pulse_width_min": 3e-4,
                    "pulse_width_max": 2.7e-3},
    "potentiometer": {"feedback_gain": 0.85 * 4.0 / 3.0 / np.pi, "feedback_offset": 0.85 * 1.5},
    "supply": {"open_circuit_voltage": 6.0, "bridge_drop_voltage": 0.2},
}
M1 = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
      "electronics.stretcher_gain", "electronics.deadband", "potentiometer.feedback_gain")
EXTERNAL, LEAST = "friction.load_friction_external", "electronics.minimum_drive_time"
TERMS = {EXTERNAL: 0.4, LEAST: 4e-4}
MODELS = {  # label -> terms beyond Coulomb friction
    "Coulomb friction (M1)": (),
    "+ outside load friction, least drive": (EXTERNAL, LEAST),
    "+ outside load friction": (EXTERNAL,),
    "+ least drive": (LEAST,),
}
FOLDS = 4
NOISE = {"output_angle": 0.02}  # rad, what of a residual counts in full: what the models leave open, not the encoder


def main(folder: Path) -> None:
    logs = [log for log in st.read_logs(folder / "miuzei_25kg" / "runs.json") if log.motion != "drop"]
    servo = st.servo_from_values("miuzei-25kg", START)
    print(f"Miuzei 25 kg: {len(logs)} runs, {FOLDS} folds by run; rms error of runs that were not fitted [deg], over "
          "all samples (mean of the runs)")
    for label, terms in MODELS.items():
        began = time.perf_counter()
        errors, slew, fitted = [], [], []
        start = servo.replace({name: TERMS[name] for name in terms})
        if EXTERNAL in terms:
            start = start.replace({"friction.load_friction_motor": 0.01})
        for names in folds(logs, FOLDS):
            fit = st.identify(logs, start, free=[*M1, *terms], priors=None, holdout=names, starts=1, intervals=False,
                              noise=NOISE, diagnose=False, compare_with=() if terms else ("slew",))
            errors += fit.holdout.errors["PulseServo"]
            fitted += fit.training.errors["PulseServo"]
            slew += fit.holdout.errors.get("delay + slew + lag", ())
        if slew:
            row("delay + slew + lag", slew)
        row(label, errors)
        row("  on the runs it was fitted to", fitted)
        print(f"  {'':36} {(time.perf_counter() - began) / FOLDS:.0f} s a fit", flush=True)
