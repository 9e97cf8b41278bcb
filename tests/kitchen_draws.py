"""Draws of kitchen tables read by the package, and whether their intervals hold; for tests and for the benchmark."""

from __future__ import annotations

import math
import tempfile
import warnings
from pathlib import Path

import servotwin as st
from reference import kitchen_tables
from servotwin.bench import calibrate_loads, calibrate_table
from servotwin.bench.table_columns import wide

N = 100.0
_NAMES = {"compliance": "sag per torque", "first sag": "sag without load", "torque constant": "voltage per speed"}


def servo_of(truth, **wrong):
    """Return a servo file's worth of a true servo, whose numbers that a table tells are off by factors."""
    K, R, tau_c, mu = (getattr(truth, name) * wrong.get(name, 1.0) for name in ("K", "R", "tau_c", "mu"))
    shares = {"load_friction": mu} if mu else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return st.servo_from_values("mine", {
            "motor": {"armature_resistance": R, "torque_constant": K / N, "back_emf_constant": K / N,
                      "rotor_inertia": 1e-7, "motor_viscous_friction": 0.0},
            "gear": {"gear_reduction": N},
            "friction": {"coulomb_torque_forward": tau_c / N, "coulomb_torque_backward": tau_c / N, **shares},
            "supply": {"open_circuit_voltage": truth.V, "bridge_drop_voltage": truth.V_d}})


# what each kind tells, so that it may be wrong in the file at first
_WRONG = {"current": {"tau_c": 1.4, "mu": 0.6}, "speed": {"K": 1.3, "R": 0.8}, "voltage": {"K": 0.7, "tau_c": 1.5},
          "sag": {}, "both ways": {}}


def holds(kind: str, seed: int) -> dict[str, bool]:
    """Return of each figure and parameter of a draw whether its interval of 95 % holds the truth."""
    drawn = kitchen_tables.table(kind, seed)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "table.csv"
        file.write_text(drawn.text)
        if kind == "both ways":
            line = calibrate_table(file).lines["q(t_a)"].line
            pairs = {"hysteresis": (line.hysteresis, line.hysteresis_error), "slope": (line.slope, line.slope_error)}
            return {name: abs(value - math.degrees(drawn.figures[name])) <= line.wide(error)
                    for name, (value, error) in pairs.items()}
        servo = servo_of(drawn.servo, **_WRONG[kind])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            found = calibrate_loads(file, servo, arm=drawn.arm)
    made = {}
    for name, true in drawn.figures.items():
        figure = found.figure(_NAMES.get(name, name))
        made[name] = figure.lower <= true <= figure.upper
    freedom = min(one.line.freedom for one in found.lines.lines.values())
    for name, true in _true_parameters(drawn.servo).items():
        if name in found.parameters:
            one = found.parameters[name]
            made[name] = abs(one.value - true) <= wide(one.std, freedom)
    return made


def _true_parameters(truth: kitchen_tables.Truth) -> dict[str, float]:
    return {"motor.torque_constant": truth.K / N, "motor.armature_resistance": truth.R,
            "friction.coulomb_torque_forward": truth.tau_c / N, "friction.load_friction": truth.mu}


def shares(kind: str, draws: int) -> dict[str, float]:
    """Return of each figure and parameter the share of draws whose interval holds, where at least half have it."""
    found: dict[str, list[bool]] = {}
    for seed in range(draws):
        for name, hold in holds(kind, seed).items():
            found.setdefault(name, []).append(hold)
    return {name: sum(each) / len(each) for name, each in found.items() if 2 * len(each) >= draws}
