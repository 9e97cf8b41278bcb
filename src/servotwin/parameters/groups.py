"""The parameter groups, by the tables of a servo file.

Names, letters and ranges are those of Urrea & Kern (2011) where the paper has them; the theory pages list both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np

from servotwin.parameters.firmware import Firmware
from servotwin.parameters.group import (
    ANY,
    AT_LEAST_ONE,
    CATALOG,
    CELSIUS,
    FRACTION,
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    THEORY,
    TURNS,
    Group,
    Relation,
    check_column,
    choice,
    parameter,
    table,
)
from servotwin.units import si_unit


@dataclass(frozen=True, kw_only=True)
class Motor(Group):
    """The DC motor, at its own shaft (paper, eq. 4-15)."""

    title = "motor"
    armature_resistance: float | None = parameter(
        "R_a", "resistance", POSITIVE, "armature resistance (7)", CATALOG.of(0.02, 200.0))
    armature_inductance: float | None = parameter(
        "L_a", "inductance", POSITIVE, "armature inductance (7)", CATALOG.of(1e-06, 0.05))
    torque_constant: float | None = parameter(
        "k_a", "torque per current", POSITIVE, "torque per current (4, 26)", CATALOG.of(0.02, 30.0))
    back_emf_constant: float | None = parameter(
        "k_b", "voltage per speed", POSITIVE, "back-EMF per speed (6, 24)", CATALOG.of(0.02, 30.0))
    rotor_inertia: float | None = parameter(
        "J_m", "inertia", POSITIVE, "inertia of rotor and first gear (10)", CATALOG.of(1e-07, 2.0))
    motor_viscous_friction: float | None = parameter(
        "B_m", "torque per speed", NOT_NEGATIVE, "viscous friction (10)", CATALOG.of(0.0, 1.0))
    brush_drop_voltage: float | None = parameter(
        "V_br", "voltage", NOT_NEGATIVE, "voltage lost at the brushes", THEORY.of(0.0, 3.0))


@dataclass(frozen=True, kw_only=True)
class Gear(Group):
    """The gear train (paper, eq. 16-22); the paper's n is 1/gear_reduction."""

    title = "gear"
    gear_reduction: float | None = parameter(
        "N = 1/n", "number", AT_LEAST_ONE, "motor turns per output turn (18)", CATALOG.of(1.0, 4000.0))
    backlash: float | None = parameter(
        "", "angle", NOT_NEGATIVE, "total play between motor and output, at the output", THEORY.of(0.0, 0.2))
    output_inertia: float | None = parameter(
        "", "inertia", NOT_NEGATIVE, "inertia of gear wheel and horn", THEORY.of(0.0, 0.1))
    stiffness: float | None = parameter(
        "k_g", "torque per angle", POSITIVE, "stiffness between motor and output", THEORY.of(1.0, 100000.0))
    damping: float | None = parameter(
        "", "torque per speed", NOT_NEGATIVE, "damping beside that stiffness", THEORY.of(0.0, 100.0))

    def _relations(self) -> Iterator[Relation]:
        yield from self._only_with("damping", ("stiffness",))


_ONE_SHARE = ("load_friction", "load_friction_stribeck")
_TWO_SHARES = ("load_friction_motor", "load_friction_external", "load_friction_motor_stribeck",
               "load_friction_external_stribeck", "load_friction_motor_quad", "load_friction_external_quad")


@dataclass(frozen=True, kw_only=True)
class Friction(Group):
    """Dry friction of motor and gear (paper, eq. 37-41), at the motor shaft; both Coulomb torques are magnitudes.

    The friction behind the play is given at the output shaft.
    """

    title = "friction"
    coulomb_torque_forward: float | None = parameter(
        "F_ec1", "torque", NOT_NEGATIVE, "Coulomb torque forward (41)", CATALOG.of(0.0, 10.0))
    coulomb_torque_backward: float | None = parameter(
        "F_ec2", "torque", NOT_NEGATIVE, "Coulomb torque backward (41)", CATALOG.of(0.0, 10.0))
    zero_crossing_slope: float | None = parameter(
        "k", "inverse speed", POSITIVE, "slope of tanh at speed zero (41)", THEORY.of(0.01, 10000.0))
    breakaway_ratio: float | None = parameter(
        "r", "number", AT_LEAST_ONE, "static over Coulomb friction", THEORY.of(1.0, 10.0))
    stribeck_speed: float | None = parameter(
        "v_s", "speed", POSITIVE, "motor speed at which static friction fades", THEORY.of(0.0001, 100.0))
    stribeck_exponent: float | None = parameter(
        "alpha", "number", POSITIVE, "how sharply it fades", THEORY.of(0.1, 10.0))
    load_friction: float | None = parameter(
        "K_l", "number", NOT_NEGATIVE, "gear friction per torque through the gear", CATALOG.of(0.0, 3.0))
    load_friction_stribeck: float | None = parameter(
        "K_ls", "number", NOT_NEGATIVE, "its static part", CATALOG.of(0.0, 3.0))
    load_friction_motor: float | None = parameter(
        "K_m", "number", NOT_NEGATIVE, "gear friction per motor torque", CATALOG.of(0.0, 3.0))
    load_friction_external: float | None = parameter(
        "K_e", "number", NOT_NEGATIVE, "gear friction per load torque", CATALOG.of(0.0, 3.0))
    load_friction_motor_stribeck: float | None = parameter(
        "K_ms", "number", NOT_NEGATIVE, "static part of K_m", CATALOG.of(0.0, 3.0))
    load_friction_external_stribeck: float | None = parameter(
        "K_es", "number", NOT_NEGATIVE, "static part of K_e", CATALOG.of(0.0, 3.0))
    load_friction_motor_quad: float | None = parameter(
        "K_mq", "inverse torque", NOT_NEGATIVE, "quadratic in motor torque", THEORY.of(0.0, 100.0))
    load_friction_external_quad: float | None = parameter(
        "K_eq", "inverse torque", NOT_NEGATIVE, "quadratic in load torque", THEORY.of(0.0, 100.0))
    bearing_coulomb_torque: float | None = parameter(
        "T_o", "torque", NOT_NEGATIVE,
        "part of the Coulomb friction that stands behind the play, at the output shaft; absent: 0.06 of it",
        THEORY.of(0.0, 1.0))

    def _relations(self) -> Iterator[Relation]:
        yield from self._only_with("stribeck_exponent", ("stribeck_speed",))
        # Models M3 and M4 know one share for all torque through the gear, M5 and M6 one for each side of it.
        one = [name for name in _ONE_SHARE if getattr(self, name) is not None]
        two = [name for name in _TWO_SHARES if getattr(self, name) is not None]
        if one and two:
            yield Relation(f"friction.{two[0]}", False, getattr(self, two[0]),
                           f"not beside friction.{one[0]}, which belongs to another friction law")


@dataclass(frozen=True, kw_only=True)
class Potentiometer(Group):
    """The position sensor (paper, eq. 38; Table II)."""

    title = "potentiometer"
    feedback_gain: float | None = parameter(
        "p", "voltage per angle", POSITIVE, "voltage per output angle (38)", CATALOG.of(0.02, 10.0))
    feedback_offset: float | None = parameter(
        "b_o", "voltage", ANY, "voltage at output angle 0", CATALOG.of(-15.0, 15.0))
    backlash: float | None = parameter(
        "", "angle", NOT_NEGATIVE, "total play between output and potentiometer", THEORY.of(0.0, 0.2))
    noise: float | None = parameter("", "voltage", NOT_NEGATIVE, "noise, rms", THEORY.of(0.0, 0.3))
    linearity_angle: tuple[float, ...] | None = table(
        "", "angle", "angles of the linearity table", TURNS.of(-20.0, 20.0))
    linearity_error: tuple[float, ...] | None = table(
        "", "voltage", "voltage added at these angles", THEORY.of(-3.0, 3.0))
    quantisation: float | None = parameter(
        "", "voltage per count", POSITIVE, "voltage per count", THEORY.of(1e-06, 0.1))
    fixed_angle: float | None = parameter(
        "", "angle", ANY,
        "angle at which a potentiometer off the shaft stands: the servo turns without end", TURNS.of(-20.0, 20.0))

    def _relations(self) -> Iterator[Relation]:
        angles, errors = self.linearity_angle, self.linearity_error
        if (angles is None) != (errors is None) or (angles and errors and len(angles) != len(errors)):
            yield Relation("potentiometer.linearity_error", False, errors,
                           "as many values as potentiometer.linearity_angle")
        if angles and any(b <= a for a, b in pairwise(angles)):
            yield Relation("potentiometer.linearity_angle", False, angles, "increasing angles")


@dataclass(frozen=True, kw_only=True)
class Electronics(Group):
    """Pulse-to-voltage converter, comparator and bridge (paper, eq. 38), and the chip at pulse level."""

    title = "electronics"
    less = (("pulse_width_min", "pulse_width_max"),)
    bridge_gain: float | None = parameter(
        "A", "voltage gain", POSITIVE, "gain of the bridge (38)", CATALOG.of(0.1, 10000.0))
    comparator_gain: float | None = parameter(
        "k_s", "voltage gain", POSITIVE, "gain of the comparator (38)", CATALOG.of(0.01, 1000.0))
    voltage_to_pulse_gain: float | None = parameter(
        "k_p1", "time per voltage", POSITIVE, "pulse per command voltage (38)", CATALOG.of(1e-05, 0.05))
    pulse_to_voltage_gain: float | None = parameter(
        "k_p2", "voltage per time", POSITIVE, "voltage per pulse width (38)", CATALOG.of(10.0, 100000.0))
    command_offset: float | None = parameter(
        "b_i", "voltage", ANY, "control voltage at command voltage 0", CATALOG.of(-15.0, 15.0))
    command_pulse_offset: float | None = parameter(
        "t_0", "time", ANY, "pulse width at command voltage 0", CATALOG.of(-0.01, 0.01))
    voltage_deadband: float | None = parameter(
        "w_v", "voltage", NOT_NEGATIVE, "full width of the deadband, averaged models", CATALOG.of(0.0, 1.0))
    frame_period: float | None = parameter("T_f", "time", POSITIVE, "period of the pulses", THEORY.of(0.0002, 0.2))
    deadband: float | None = parameter(
        "w", "time", NOT_NEGATIVE, "full width of the comparator's deadband", CATALOG.of(1e-07, 0.0005))
    stretcher_gain: float | None = parameter(
        "K", "number", POSITIVE, "drive time per pulse error", CATALOG.of(1.0, 5000.0))
    minimum_drive_time: float | None = parameter("t_min", "time", NOT_NEGATIVE, "shortest drive", THEORY.of(0.0, 0.01))
    stretcher_time_constant: float | None = parameter(
        "tau_s", "time", POSITIVE, "of an RC stretcher; absent: linear", THEORY.of(0.001, 1.0))
    off_state: str | None = choice(("brake", "coast"), "what the bridge does between drives")
    silence_state: str | None = choice(
        ("brake", "coast"), "what it does before the first pulse and after pulse_timeout; absent: as off_state")
    one_shot_offset: float | None = parameter(
        "T_0", "time", ANY, "width of the one-shot at feedback voltage 0", CATALOG.of(-0.01, 0.01))
    one_shot_slope: float | None = parameter(
        "1/s_r", "time per voltage", POSITIVE, "one-shot width per feedback voltage", CATALOG.of(1e-05, 0.05))
    back_emf_injection: float | None = parameter(
        "beta", "number", ANY, "share of the motor's voltage in the feedback", SHARE.of(-1.0, 1.0))
    supply_coupling: float | None = parameter(
        "c_s", "number", ANY, "share of a supply sag in the feedback", SHARE.of(-1.0, 1.0))
    pulse_timeout: float | None = parameter(
        "", "time", POSITIVE, "drive ends so long after the last pulse", THEORY.of(0.001, 30.0))
    pulse_width_min: float | None = parameter("", "time", POSITIVE, "shortest pulse accepted", CATALOG.of(1e-05, 0.02))
    pulse_width_max: float | None = parameter("", "time", POSITIVE, "longest pulse accepted", CATALOG.of(0.0001, 0.05))


@dataclass(frozen=True, kw_only=True)
class Supply(Group):
    """Battery or regulator, and what the bridge takes of it."""

    title = "supply"
    less = (("bridge_drop_voltage", "open_circuit_voltage"),)
    open_circuit_voltage: float | None = parameter(
        "V_oc", "voltage", POSITIVE, "voltage without load", CATALOG.of(0.5, 100.0))
    internal_resistance: float | None = parameter(
        "R_b", "resistance", NOT_NEGATIVE, "resistance of the source", THEORY.of(0.0, 20.0))
    bridge_drop_voltage: float | None = parameter(
        "V_ce0", "voltage", NOT_NEGATIVE, "constant drop of a conducting pair", THEORY.of(0.0, 5.0))
    bridge_drop_resistance: float | None = parameter(
        "r_c", "resistance", NOT_NEGATIVE, "resistance of a conducting pair", THEORY.of(0.0, 20.0))
    current_limit: float | None = parameter(
        "", "current", POSITIVE, "most that the source gives", THEORY.of(0.01, 100.0))

    @classmethod
    def of(cls, text: str, *, what: str = "supply") -> Supply:
        """Return the supply that a text names, such as "usb", "12V:0.1ohm" or "5V:0.5A".

        Parameters
        ----------
        text : str
            "usb" (5 V, 0.5 A), or a voltage and, each after a colon, resistance and limit of current; numbers without
            a unit are volts and ohms.
        what : str
            What to call it in an error.

        Raises
        ------
        InputError
            If it has another form.

        Examples
        --------
        >>> Supply.of("usb") == Supply.of("5V:0.5A"), Supply.of("12:0.15").internal_resistance
        (True, 0.15)
        """
        from servotwin.parameters.supplies import supply_numbers

        return cls(**supply_numbers(text, what))


@dataclass(frozen=True, kw_only=True)
class Stops(Group):
    """End stops of the output shaft."""

    title = "stops"
    less = (("lower_angle", "upper_angle"),)
    lower_angle: float | None = parameter("", "angle", ANY, "lowest output angle", TURNS.of(-20.0, 20.0))
    upper_angle: float | None = parameter("", "angle", ANY, "highest output angle", TURNS.of(-20.0, 20.0))
    restitution: float | None = parameter(
        "", "number", FRACTION, "speed after over speed before an impact", SHARE.of(0.0, 1.0))


_MASSES = ("winding_capacity", "housing_capacity", "winding_to_housing", "housing_to_ambient")


@dataclass(frozen=True, kw_only=True)
class Thermal(Group):
    """Two thermal masses, winding and housing."""

    title = "thermal"
    winding_capacity: float | None = parameter("", "heat capacity", POSITIVE, "of the winding", THEORY.of(0.05, 500.0))
    housing_capacity: float | None = parameter("", "heat capacity", POSITIVE, "of the housing", THEORY.of(0.5, 5000.0))
    winding_to_housing: float | None = parameter(
        "", "thermal resistance", POSITIVE, "from winding to housing", THEORY.of(0.1, 500.0))
    housing_to_ambient: float | None = parameter(
        "", "thermal resistance", POSITIVE, "from housing to the air", THEORY.of(0.1, 500.0))
    ambient: float | None = parameter("", "temperature", POSITIVE, "temperature of the air", CELSIUS.of(200.0, 400.0))
    magnet_coefficient: float | None = parameter(
        "", "inverse temperature", ANY, "of k_a and k_b", THEORY.of(-0.02, 0.02))

    def _relations(self) -> Iterator[Relation]:
        # Heat is on with all four numbers of the two masses, and off with none.
        for name in _MASSES:
            yield from self._only_with(name, tuple(partner for partner in _MASSES if partner != name))
        yield from self._only_with("magnet_coefficient", _MASSES)


GROUPS: dict[str, type[Group]] = {
    group.title: group for group in (
        Motor, Gear, Friction, Electronics, Potentiometer, Firmware, Supply, Stops, Thermal)
}


def check_columns(group: str, values: Mapping[str, Any]) -> None:
    """Check the values of a group of which some are columns, one number per lane.

    Parameters
    ----------
    group : str
    values : mapping
        Value by field, None where absent; a column has shape (B,).

    Raises
    ------
    ParameterError
        If a value breaks its range, or two break their relation; names the lane where columns take part.
    """
    checked: Group = object.__new__(GROUPS[group])
    for f in fields(GROUPS[group]):
        value = values.get(f.name)
        if f.metadata["rule"] == "table":  # all lanes share it
            value = value if value is None else checked._checked(f.name, value, f.metadata)
        elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
            check_column(f"{group}.{f.name}", value, f.metadata["rule"], si_unit(f.metadata["dimension"]))
        elif isinstance(value, np.ndarray):
            options = f.metadata["rule"]
            Relation(f"{group}.{f.name}", np.isin(value, options), value, " or ".join(options)).check()
        elif value is not None:
            value = checked._checked(f.name, value, f.metadata)
        object.__setattr__(checked, f.name, value)
    for relation in checked._relations():
        relation.check()


