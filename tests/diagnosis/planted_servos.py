"""Servos as `planted` drew them: fifteen with one planted cause each, and ten healthy ones."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import servotwin as st
from servotwin.loads import Load


class Row(NamedTuple):
    """A servo of the catalog with other numbers, under a load [N m], [kg m²]."""

    name: str
    symptom: str
    cause: str
    changes: dict[str, float]
    torque: float
    inertia: float


def servo_of(row: Row) -> tuple[Any, Load]:
    """Return servo and load of a row."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        servo = st.load_servo(row.name).replace(row.changes)
    return servo, Load(torque=row.torque, inertia=row.inertia)


PLANTED: tuple[Row, ...] = (
    Row("towerpro-sg90", "buzzes", "deadband", {
        "motor.armature_resistance": 7.2396,
        "motor.rotor_inertia": 7.09201e-09,
        "friction.coulomb_torque_forward": 0.000296686,
        "friction.coulomb_torque_backward": 0.000296686,
        "electronics.deadband": 4.375e-07,
        "electronics.minimum_drive_time": 0.000704542,
        "potentiometer.noise": 0.000248631}, 0, 7.20844e-05),
    Row("futaba-s3305", "buzzes", "gain", {
        "motor.armature_resistance": 3.92215,
        "motor.rotor_inertia": 7.01596e-08,
        "friction.coulomb_torque_forward": 0.000497301,
        "friction.coulomb_torque_backward": 0.000497301,
        "electronics.stretcher_gain": 1366.88,
        "electronics.minimum_drive_time": 0.000539698,
        "potentiometer.noise": 0.00030875}, 0, 0.00501253),
    Row("jx-pdi-6221mg", "buzzes", "play", {
        "motor.armature_resistance": 1.28668,
        "motor.rotor_inertia": 1.19734e-07,
        "gear.backlash": 0.00698132,
        "friction.coulomb_torque_forward": 0.00108955,
        "friction.coulomb_torque_backward": 0.00108955,
        "potentiometer.noise": 0.000387135,
        "firmware.minimum_duty": 0.000570913}, 0, 0.00532075),
    Row("hitec-hs-755hb", "sags", "supply", {
        "motor.armature_resistance": 3.26941,
        "motor.rotor_inertia": 8.20181e-08,
        "friction.coulomb_torque_forward": 0.000904164,
        "friction.coulomb_torque_backward": 0.000904164,
        "electronics.minimum_drive_time": 0.00114536,
        "potentiometer.noise": 0.000193109,
        "supply.internal_resistance": 7.44813}, 0.264907, 0.00391244),
    Row("hitec-hs-422", "sags", "load", {
        "motor.armature_resistance": 7.19491,
        "motor.rotor_inertia": 2.5708e-08,
        "friction.coulomb_torque_forward": 0.000240944,
        "friction.coulomb_torque_backward": 0.000240944,
        "electronics.minimum_drive_time": 0.00111073,
        "potentiometer.noise": 0.000165277}, 0.181633, 0.000887168),
    Row("hitec-hs-485hb", "sags", "friction", {
        "motor.armature_resistance": 4.69359,
        "motor.rotor_inertia": 3.06182e-08,
        "friction.coulomb_torque_forward": 0.00271575,
        "friction.coulomb_torque_backward": 0.00271575,
        "electronics.minimum_drive_time": 0.00107178,
        "potentiometer.noise": 0.00014709}, 0, 0.000972637),
    Row("futaba-s3305", "overshoots", "gain", {
        "motor.armature_resistance": 3.98832,
        "motor.rotor_inertia": 6.33514e-08,
        "friction.coulomb_torque_forward": 0.000487194,
        "friction.coulomb_torque_backward": 0.000487194,
        "electronics.stretcher_gain": 911.25,
        "electronics.minimum_drive_time": 0.000482003,
        "potentiometer.noise": 0.000177496}, 0, 0.00419729),
    Row("feetech-ft-2806", "overshoots", "load", {
        "motor.armature_resistance": 3.38055,
        "motor.rotor_inertia": 8.89441e-09,
        "friction.coulomb_torque_forward": 0.000113378,
        "friction.coulomb_torque_backward": 0.000113378,
        "potentiometer.noise": 0.000192424,
        "firmware.minimum_duty": 0.00081019}, 0, 0.00223436),
    Row("feetech-ft-2806", "overshoots", "frame rate", {
        "motor.armature_resistance": 3.18081,
        "motor.rotor_inertia": 1.00453e-08,
        "friction.coulomb_torque_forward": 0.000119776,
        "friction.coulomb_torque_backward": 0.000119776,
        "potentiometer.noise": 0.000193036,
        "firmware.control_period": 0.0018,
        "firmware.minimum_duty": 0.088098}, 0, 0.000799112),
    Row("hitec-hs-485hb", "gets warm", "friction", {
        "motor.armature_resistance": 4.22742,
        "motor.rotor_inertia": 3.00449e-08,
        "friction.coulomb_torque_forward": 0.00272936,
        "friction.coulomb_torque_backward": 0.00272936,
        "electronics.minimum_drive_time": 0.000493773,
        "potentiometer.noise": 0.000138932}, 0.122339, 0.00424729),
    Row("hitec-hs-485hb", "gets warm", "load", {
        "motor.armature_resistance": 4.92169,
        "motor.rotor_inertia": 3.39461e-08,
        "friction.coulomb_torque_forward": 0.000713208,
        "friction.coulomb_torque_backward": 0.000713208,
        "electronics.minimum_drive_time": 0.000508163,
        "potentiometer.noise": 0.000308824}, 0.346001, 0.00179359),
    Row("feetech-ft-2806", "overshoots", "gain", {
        "motor.armature_resistance": 3.64135,
        "motor.rotor_inertia": 9.47188e-09,
        "friction.coulomb_torque_forward": 0.000120371,
        "friction.coulomb_torque_backward": 0.000120371,
        "potentiometer.noise": 0.000127127,
        "firmware.proportional_gain": 27,
        "firmware.minimum_duty": 0.0642383}, 0, 0.000633651),
    Row("jx-pdi-6221mg", "does not move", "deadband", {
        "motor.armature_resistance": 1.2569,
        "motor.rotor_inertia": 1.18182e-07,
        "friction.coulomb_torque_forward": 0.00118167,
        "friction.coulomb_torque_backward": 0.00118167,
        "potentiometer.noise": 0.000399119,
        "firmware.deadband_angle": 0.0292818,
        "firmware.minimum_duty": 0.00757362}, 0, 0.00847318),
    Row("dynamixel-mx-28", "does not move", "supply", {
        "motor.armature_resistance": 8.49543,
        "motor.rotor_inertia": 1.57274e-07,
        "friction.coulomb_torque_forward": 0.000775754,
        "friction.coulomb_torque_backward": 0.000775754,
        "supply.open_circuit_voltage": 3.93216}, 0, 0.0077517),
    Row("feetech-sts3250", "trips", "register", {
        "motor.armature_resistance": 2.82082,
        "motor.rotor_inertia": 6.23197e-08,
        "friction.coulomb_torque_forward": 0.0012255,
        "friction.coulomb_torque_backward": 0.0012255,
        "firmware.trip_current": 0.285322}, 0, 0.00100484),
)

SOUND: tuple[Row, ...] = (
    Row("futaba-s3305", "", "", {
        "motor.armature_resistance": 4.03767,
        "motor.rotor_inertia": 6.72792e-08,
        "friction.coulomb_torque_forward": 0.000506252,
        "friction.coulomb_torque_backward": 0.000506252,
        "electronics.minimum_drive_time": 0.000740662,
        "potentiometer.noise": 0.00037582}, 0.181821, 0.00818088),
    Row("hitec-hs-645mg", "", "", {
        "motor.armature_resistance": 2.65683,
        "motor.rotor_inertia": 7.06707e-08,
        "friction.coulomb_torque_forward": 0.00117242,
        "friction.coulomb_torque_backward": 0.00117242,
        "electronics.minimum_drive_time": 0.000879639,
        "potentiometer.noise": 0.000209674}, 0.0873521, 0.00592849),
    Row("hitec-hs-422", "", "", {
        "motor.armature_resistance": 7.7777,
        "motor.rotor_inertia": 2.40177e-08,
        "friction.coulomb_torque_forward": 0.000227393,
        "friction.coulomb_torque_backward": 0.000227393,
        "electronics.minimum_drive_time": 0.000970668,
        "potentiometer.noise": 0.000262104}, 0.0386075, 0.0009591),
    Row("feetech-ft-2806", "", "", {
        "motor.armature_resistance": 3.41331,
        "motor.rotor_inertia": 9.61739e-09,
        "friction.coulomb_torque_forward": 0.00011854,
        "friction.coulomb_torque_backward": 0.00011854,
        "potentiometer.noise": 0.000153836,
        "firmware.minimum_duty": 0.0981765}, 0.0565413, 0.00101141),
    Row("feetech-ft-2806", "", "", {
        "motor.armature_resistance": 3.38777,
        "motor.rotor_inertia": 9.74477e-09,
        "friction.coulomb_torque_forward": 0.000113133,
        "friction.coulomb_torque_backward": 0.000113133,
        "potentiometer.noise": 0.000129273,
        "firmware.minimum_duty": 0.0584709}, 0, 0.000503832),
    Row("feetech-sts3215-12v", "", "", {
        "motor.armature_resistance": 4.22395,
        "motor.rotor_inertia": 2.7963e-07,
        "friction.coulomb_torque_forward": 0.000805143,
        "friction.coulomb_torque_backward": 0.000805143}, 0.0884905, 0.0515898),
    Row("futaba-s3003", "", "", {
        "motor.armature_resistance": 7.06642,
        "motor.rotor_inertia": 3.05858e-08,
        "friction.coulomb_torque_forward": 0.000398348,
        "friction.coulomb_torque_backward": 0.000398348,
        "electronics.minimum_drive_time": 0.000757683,
        "potentiometer.noise": 0.000187727}, 0.0505254, 0.000244625),
    Row("futaba-s3003", "", "", {
        "motor.armature_resistance": 7.05427,
        "motor.rotor_inertia": 3.15591e-08,
        "friction.coulomb_torque_forward": 0.000404609,
        "friction.coulomb_torque_backward": 0.000404609,
        "electronics.minimum_drive_time": 0.000839056,
        "potentiometer.noise": 0.000271773}, 0.110006, 0.000651702),
    Row("dynamixel-mx-28", "", "", {
        "motor.armature_resistance": 8.62128,
        "motor.rotor_inertia": 1.33147e-07,
        "friction.coulomb_torque_forward": 0.000901662,
        "friction.coulomb_torque_backward": 0.000901662}, 0, 0.00457063),
    Row("futaba-s3003", "", "", {
        "motor.armature_resistance": 6.91835,
        "motor.rotor_inertia": 2.87416e-08,
        "friction.coulomb_torque_forward": 0.000375865,
        "friction.coulomb_torque_backward": 0.000375865,
        "electronics.minimum_drive_time": 0.000630724,
        "potentiometer.noise": 0.000294819}, 0.0322146, 0.00201475),
)
