"""The Miuzei 25 kg servo with an arm: folds by run, each fitted on the others and held against its own."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from report import folds, row

import servotwin as st
from servotwin.identification import Log, validate
from servotwin.parameters import Servo

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
EXTERNAL, LEAST = "friction.load_friction_external", "electronics.minimum_drive_time"
FIRMWARE = {  # of the digital servo; ticks are a guess, the dead zone is the 1 us of its class: runs would have none
    "control_period": 2e-3, "proportional_gain": 3.5, "derivative_gain": 0.08, "deadband_angle": 2.4e-3,
    "signal_loss": "limp", "signal_timeout": 0.015}  # without pulses the arm falls at once
SUPPLY = "supply.internal_resistance"
DIGITAL = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque", EXTERNAL,
           "firmware.proportional_gain", "firmware.derivative_gain", "potentiometer.feedback_gain", SUPPLY)
BRIDGES = ("diode", "brake")
M1 = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
      "electronics.stretcher_gain", "electronics.deadband", "potentiometer.feedback_gain")
TERMS = {EXTERNAL: 0.4, LEAST: 4e-4}
MODELS = {  # label -> terms beyond Coulomb friction
    "Coulomb friction (M1)": (),
    "+ outside load friction, least drive": (EXTERNAL, LEAST),
}
FOLDS = 4
NOISE = {"output_angle": 0.02}  # rad, what of a residual counts in full: what the models leave open, not the encoder
JITTER = {**NOISE, "time": 0.01}  # s, twice half a frame, of which no log tells: a reversal adds twice the speed


def drops(servo: Servo, logs: list[Log]) -> None:
    """Print how far servos that brake or coast without pulses are off a run whose pulses stop: not fitted, or its like.

    The two runs begin alike, with an arm held at 0 for ten samples; then no pulses come for a second, and it falls.
    """
    plain, (one, other) = [log for log in logs if log.motion != "drop"], [log for log in logs if log.motion == "drop"]
    print(f"the drops {one.name} and {other.name}, Coulomb friction: rms error while no pulses come, at the end [deg]")
    common = {"free": M1, "priors": None, "starts": 1, "intervals": False, "noise": NOISE, "diagnose": False,
                    "compare_with": ()}
    without = st.identify(plain, servo, holdout=None, **common).servo
    for state in ("brake", "coast"):
        word = {"electronics.silence_state": state}
        like = st.identify([*plain, one, other], servo.replace(word), holdout=[other.name], **common)
        for label, found in (("no drop fitted", without.replace(word)), (f"with {one.name}", like.servo)):
            trace = validate([other], found).traces[0]
            silent = np.isin(trace.time, other.time[~other.sent])
            error = np.degrees(trace.simulated - trace.measured)
            print(f"  {state:6} {label:16} {np.sqrt(np.mean(error[silent]**2)):6.1f} {error[-1]:+7.1f}", flush=True)


def digital(bridge: str) -> Servo:
    """Return where the search of a digital servo begins."""
    electronics = {name: START["electronics"][name] for name in (
        "one_shot_slope", "one_shot_offset", "frame_period", "pulse_width_min", "pulse_width_max")}
    made = st.servo_from_values("miuzei-25kg", {**START, "electronics": electronics,
                                                "firmware": {**FIRMWARE, "off_state": bridge}})
    near = {  # what first fits found, so that each fold ends in one valley
        "motor.armature_resistance": 1.55, "motor.torque_constant": 1.1 / REDUCTION, EXTERNAL: 0.14, SUPPLY: 0.1,
        "motor.back_emf_constant": 1.1 / REDUCTION, "motor.rotor_inertia": 0.0139 / REDUCTION**2,
        "friction.coulomb_torque_forward": 0.27 / REDUCTION, "friction.coulomb_torque_backward": 0.27 / REDUCTION,
        "firmware.proportional_gain": 3.3, "firmware.derivative_gain": 0.075}
    return replace(made, kind="digital").replace(near)


def folds_of_digital(logs: list[Log], bridge: str) -> None:
    """Print the errors of a digital servo on runs that were not fitted, and what each fold found.

    The first half of a run that was not fitted tells when its pulses come, and nothing else. Three windows in which
    commands are never followed are left out.
    """
    servo, late, all_of_them, fitted, began = digital(bridge), [], [], [], time.perf_counter()
    for names in folds(logs, FOLDS):
        fit = st.identify(logs, servo, free=DIGITAL, priors=None, holdout=names, mend=("not followed",), starts=1,
                          intervals=False, noise=JITTER, diagnose=False, compare_with=())
        late += fit.holdout.errors["DigitalServo"]
        fitted += fit.training.errors["DigitalServo"]
        all_of_them += [replace(one, judged=np.ones_like(one.judged)).error for one in fit.traces if one.held_out]
        print("   ", ", ".join(f"{name.rpartition('.')[2]} {value:.4g}" for name, value in fit.estimates.items()),
              flush=True)
    seconds = (time.perf_counter() - began) / FOLDS
    row(f"digital, {bridge}", all_of_them)
    row("  second halves, which tell no phase", late)
    row("  on the runs it was fitted to", fitted)
    middle, middle_late = (np.degrees(np.median([error.rms for error in errors if error.motion == "prbs"]))
                           for errors in (all_of_them, late))
    print(f"  {'':36} prbs, median of the runs {middle:.2f}, second halves {middle_late:.2f}; {seconds:.0f} s a fit",
          flush=True)


def main(folder: Path) -> None:
    every = st.read_logs(folder / "miuzei_25kg" / "runs.json")
    logs = [log for log in every if log.motion != "drop"]
    servo = st.servo_from_values("miuzei-25kg", START)
    print(f"Miuzei 25 kg: {len(every)} runs, {FOLDS} folds by run; rms error of runs that were not fitted [deg], over "
          "all samples (mean of the runs); analog servos without drops, on second halves")
    for bridge in BRIDGES:
        folds_of_digital(every, bridge)
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
    drops(servo, every)
