"""Bus and digital servos of the catalog: their firmware is complete, and each number says where it comes from."""

import math
from importlib import resources

import pytest

import rest_bands
import servotwin as st
from servotwin.identification import motor_range, servo_file_text, servo_from_sheet, sheet_contradictions, sheet_of
from servotwin.parameters import REGISTER_FAMILIES, catalog_names, load_servo, unit_of

BUS = ("dynamixel-2xl430-w250", "dynamixel-ax-12a", "dynamixel-mx-106", "dynamixel-mx-28", "dynamixel-mx-64",
       "dynamixel-xc330-t288", "dynamixel-xc430-w240", "dynamixel-xl-320", "dynamixel-xl330-m077",
       "dynamixel-xl330-m288", "dynamixel-xl430-w250", "dynamixel-xm430-w210", "dynamixel-xm430-w350",
       "feetech-sts3215-12v", "feetech-sts3215-7v4", "feetech-sts3250")
DIGITAL = ("dsservo-ds3218", "dsservo-rds3115", "emax-es08md", "feetech-ft-15m0", "feetech-ft-2806", "feetech-ft-7235",
           "hitec-hs-5485hb", "jx-pdi-6221mg", "towerpro-mg995", "towerpro-mg996r", "towerpro-sg92r")
FITTED = ("miuzei-25kg",)  # to logs, without a sheet
IMPOSSIBLE = ("dynamixel-xl330-m077",)
MEASURED = {"feetech-sts3215-12v": ("gear.backlash",), "dynamixel-xl330-m288": (
    "motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
    "motor.motor_viscous_friction", "friction.coulomb_torque_forward", "friction.coulomb_torque_backward",
    "friction.load_friction", "supply.bridge_drop_resistance")}  # and of the latter all is a fit to logs
OF_LOGS = ("dynamixel-xl330-m288",)
# kt [N m/A], R [ohm], armature [kg m2], friction_base [N m], friction_viscous [N m s/rad], load_friction_base, as
# BAM publishes them for its friction model M3, all at the output
PLANTS = {
    "feetech-sts3215-7v4": (1.264970308604636, 2.4529072783070904, 0.023496913022039195, 0.05564449100757786,
                            0.031494638163238914, 0.21155430308651182),
    "dynamixel-mx-64": (1.631491787799071, 3.5708899455080743, 0.011237906702031345, 0.10216727649779266,
                        0.0006300275797440622, 0.07580074806755707),
    "dynamixel-mx-106": (2.204165397088512, 2.653346939680077, 0.02484689556730746, 0.1133532996239035,
                         0.01194450384263248, 0.10824037267470683),
    "dynamixel-xl-320": (1.0408462056437213, 27.543138077523064, 0.001498599811990824, 0.020630491373515955,
                         0.0022633483259072375, 0.21898043608013565),
}
OF_LITERATURE = ("dynamixel-xl-320",)  # published, and not checked by logs
# Speed at full duty over the sheet's: of plants that were identified (BAM's XL-320 turns half as fast, as its notes
# say), and of sheets whose numbers no motor has all together
FULL_SPEED = {"dynamixel-2xl430-w250": 1.0054, "dynamixel-mx-106": 1.1323, "dynamixel-mx-28": 0.9870,
              "dynamixel-mx-64": 1.0914, "dynamixel-xc330-t288": 1.0021, "dynamixel-xc430-w240": 1.0059,
              "dynamixel-xl-320": 0.5023, "dynamixel-xl330-m077": 0.9913, "dynamixel-xl330-m288": 1.0725,
              "dynamixel-xl430-w250": 1.0054, "dynamixel-xm430-w210": 0.9924, "dynamixel-xm430-w350": 1.0031,
              "feetech-sts3215-7v4": 0.9920}
# Coulomb friction that others identified [N m]: ToddlerBot's of each, and of the XM430-W350 also that of a ROBOTIS OP3
FRICTIONS = {"dynamixel-xc330-t288": (0.006,), "dynamixel-xc430-w240": (0.014,), "dynamixel-2xl430-w250": (0.069,),
             "dynamixel-xm430-w210": (0.038,), "dynamixel-xm430-w350": (0.03, 0.105)}
TOLD_BY_LOGS = {  # and nothing else: the rest of a file that was fitted is assumed, or said of the rig
    "motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
    "friction.coulomb_torque_forward", "friction.coulomb_torque_backward", "friction.load_friction_external",
    "potentiometer.feedback_gain", "firmware.proportional_gain", "firmware.derivative_gain", "firmware.off_state",
    "firmware.signal_loss", "supply.internal_resistance"}
NEEDED = ("control_period", "compute_delay", "angle_quantum", "proportional_gain")


@pytest.mark.long
def test_these_are_the_bus_and_the_digital_servos():
    kinds = {name: load_servo(name).kind for name in catalog_names()}
    assert {name for name, kind in kinds.items() if kind == "bus"} == set(BUS)
    assert {name for name, kind in kinds.items() if kind == "digital"} == {*DIGITAL, *FITTED}
    for name, kind in kinds.items():
        assert (kind in load_servo(name).sheet["flags"]) is (kind != "analog"), name
        assert any(key.startswith("firmware.") for key in load_servo(name).names()) is (kind != "analog"), name


@pytest.mark.parametrize("name", [*BUS, *DIGITAL])
def test_the_firmware_is_complete_and_says_where_it_comes_from(name):
    servo = load_servo(name)
    for key in NEEDED:
        assert getattr(servo.firmware, key) is not None, key
    for key in servo.names():
        quantity = servo.source(key)
        assert quantity.source, key
        without = isinstance(quantity.value, str) or quantity.value == 0.0 or key == "electronics.comparator_gain"
        if quantity.origin in ("assumed", "identified") and not without:
            assert quantity.spread, key


@pytest.mark.parametrize("name", FITTED)
def test_a_servo_that_was_fitted_says_to_what_and_how_sure_each_number_is(name):
    servo = load_servo(name)
    assert {key for key in servo.names() if servo.source(key).origin == "identified"} == TOLD_BY_LOGS
    for key in servo.names():
        quantity = servo.source(key)
        assert quantity.source, key
        if quantity.origin == "identified":
            assert "github.com/" in quantity.source, key
        if quantity.origin in ("assumed", "identified") and not isinstance(quantity.value, str):
            assert quantity.lower <= quantity.value <= quantity.upper, key
            assert quantity.lower < quantity.upper, key


@pytest.mark.parametrize("name", FITTED)
def test_a_servo_that_was_fitted_follows_what_it_is_told(name):
    servo = load_servo(name)
    result = st.simulate(st.DigitalServo(servo), st.signals.step(-25.0, 25.0, at=0.05, unit="deg"), duration=1.0)
    result.raise_if_failed()
    assert result["output_speed"][-1] == 0.0
    assert abs(result["output_angle"][-1] - math.radians(25.0)) <= rest_bands.proportional(servo)


@pytest.mark.parametrize("name", DIGITAL)
def test_the_firmware_of_a_digital_servo_is_a_guess_about_its_own_sheet(name):
    servo = load_servo(name)
    assert {servo.source(key).origin for key in servo.names() if key.startswith("firmware.")} == {"assumed"}
    gain = servo.source("firmware.proportional_gain")
    assert (gain.lower, gain.upper) == (3.0, 20.0)
    rate = servo.electronics.pulse_to_voltage_gain / servo.potentiometer.feedback_gain
    w = servo.electronics.deadband if "deadband" in servo.sheet else 2e-6
    assert servo.firmware.deadband_angle == pytest.approx(0.5 * w * rate, rel=1e-5)


@pytest.mark.parametrize("name", BUS)
def test_a_bus_servo_has_the_factorys_registers_and_an_encoder(name):
    servo = load_servo(name)
    assert REGISTER_FAMILIES[servo.sheet["registers"]]({}, servo=servo) == servo
    groups = {key.partition(".")[0] for key in servo.names()}
    assert groups == {"motor", "gear", "friction", "firmware", "supply"}
    assert servo.firmware.command_kind == "goal"


@pytest.mark.long(but="dynamixel-xl330-m077")
@pytest.mark.parametrize("name", BUS)
def test_each_file_is_what_its_own_sheet_makes_but_for_what_was_identified(name):
    servo = load_servo(name)
    made = servo_from_sheet(sheet_of(servo), allow_impossible=True)
    if name not in PLANTS and name not in MEASURED:
        file = resources.files("servotwin.parameters") / "catalog" / f"{name}.toml"
        assert servo_file_text(made) == file.read_text(encoding="utf-8")
    own = {key for key in servo.names() if servo.source(key).origin in ("identified", "measured")}
    if name in (*PLANTS, *OF_LOGS):
        own |= {key for key in servo.names() if "Rhoban/bam, params" in servo.source(key).source}
        own |= {"supply.bridge_drop_voltage", "friction.load_friction_motor", "friction.load_friction_external"}
    for key in {*servo.names(), *made.names()} - own:
        value = made.get(key)
        assert servo.get(key) == (pytest.approx(value, rel=1e-5, abs=1e-12) if isinstance(value, float) else value), key
        assert servo.source(key).source == made.source(key).source, key


@pytest.mark.parametrize("name", PLANTS)
def test_plants_of_bam_are_as_published(name):
    servo = load_servo(name)
    N, motor, friction = servo.gear.gear_reduction, servo.motor, servo.friction
    found = (N * motor.torque_constant, motor.armature_resistance, N * N * motor.rotor_inertia,
             N * friction.coulomb_torque_forward, N * N * motor.motor_viscous_friction, friction.load_friction)
    assert found == pytest.approx(PLANTS[name], rel=1e-5)  # the files hold six digits
    assert motor.back_emf_constant == motor.torque_constant
    assert friction.coulomb_torque_backward == friction.coulomb_torque_forward
    for key in ("motor.torque_constant", "motor.armature_resistance", "motor.rotor_inertia", "friction.load_friction"):
        assert servo.source(key).origin == ("literature" if name in OF_LITERATURE else "identified")
        assert "Rhoban/bam" in servo.source(key).source


def full_speed(servo):
    """Speed without load at full duty, of the DC motor with Coulomb and viscous friction [rad/s]."""
    N, motor, friction = servo.gear.gear_reduction, servo.motor, servo.friction
    K, R = N * motor.torque_constant, motor.armature_resistance + (servo.supply.bridge_drop_resistance or 0.0)
    share = 1.0 - (friction.load_friction or friction.load_friction_motor or 0.0)
    U = (servo.firmware.duty_limit or 1.0) * servo.supply.open_circuit_voltage - servo.supply.bridge_drop_voltage
    F, B = N * friction.coulomb_torque_forward, N * N * motor.motor_viscous_friction
    return (share * K * U / R - F) / (share * K * K / R + B)


@pytest.mark.parametrize("name", BUS)
def test_each_turns_about_as_fast_as_its_sheet_says(name):
    """At full duty: those made of their sheet as it says, the others by as much more or less as was found."""
    servo = load_servo(name)
    printed = sheet_of(servo).nominal.no_load_speed
    found = full_speed(servo if servo.firmware.duty_limit is None else servo.replace({"firmware.duty_limit": 1.0}))
    assert found == pytest.approx(printed * FULL_SPEED.get(name, 1.0), rel=1e-5 if name not in FULL_SPEED else 5e-4)
    assert servo.supply.open_circuit_voltage == sheet_of(servo).nominal.supply_voltage


@pytest.mark.parametrize("name", FRICTIONS)
def test_the_friction_of_an_x_servo_is_assumed_as_wide_as_others_identified_it(name):
    servo = load_servo(name)
    known, N = servo.source("friction.coulomb_torque_forward"), servo.gear.gear_reduction
    assert known.origin == "assumed"
    for friction in FRICTIONS[name]:
        assert N * known.lower <= friction <= N * known.upper


@pytest.mark.long
def test_impossible_sheets_are_known_and_flagged():
    for name in BUS:
        found = sheet_contradictions(sheet_of(load_servo(name)))
        assert bool(found) is (name in IMPOSSIBLE), name
        assert motor_range(sheet_of(load_servo(name))).possible is (name not in IMPOSSIBLE), name


def test_the_printed_torque_constant_of_the_sts3250_is_within_reach():
    """Its sheet prints 11 kgf cm/A at the output; speed and currents make more, for they count the driver too."""
    servo = load_servo("feetech-sts3250")
    assert servo.gear.gear_reduction * servo.motor.torque_constant == pytest.approx(1.258 * 11 * 0.0980665, rel=1e-3)
    assert unit_of("motor.torque_constant") == "N m/A"
    assert math.isclose(servo.motor.back_emf_constant, servo.motor.torque_constant)
