"""Numbers that are fixed together: what is drawn in their place, and what follows from it."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, ParameterError, UnknownNameError
from servotwin.parameters import Quantity
from servotwin.studies import variance_share
from servotwin.studies.distributions import Choice, Normal, Uniform, stated
from servotwin.studies.joint import Together, own_spread, scaled_spread
from servotwin.studies.study import Bar, chance_share, tornado_of

STEP = st.signals.step(0.0, 60.0, at=0.0, unit="deg")
STEP_LATER = st.signals.step(0.0, 60.0, at=0.1, unit="deg")
MOTOR = ("motor.torque_constant", "motor.back_emf_constant", "friction.coulomb_torque_forward",
         "friction.coulomb_torque_backward", "motor.motor_viscous_friction", "motor.rotor_inertia")
MODELS = (st.PulseServo, st.BoundedServo)


def drawn(model, lanes=16, only=None, **options):
    """Return the study of a short run, with what the servo's file states."""
    vary = {name: spread for name, spread in stated(model).items() if only is None or name.startswith(only)}
    return st.sweep(model, STEP, duration=0.02, vary=vary, lanes=lanes, metrics=["end_output_angle"], **options)


def lane_parameters(study):
    """Return the parameters of all lanes as `simulate_many` takes them, the load's apart."""
    known = study.plan.together
    return {name: column for name, column in study.table.items() if name in (*study.parameters, *study.followed)
            and name not in known.coordinates and name not in known.unread}


def numbers(distribution):
    """Return the numbers of a distribution, to compare with others nearly."""
    return {key: pytest.approx(getattr(distribution, key)) for key in distribution.__dataclass_fields__}


def without_sheet(name, **quantities):
    """Return a servo of the catalog as if it were made by hand."""
    servo = replace(st.load_servo(name), sheet={})
    return replace(servo, quantities={**servo.quantities, **quantities})


@pytest.mark.parametrize("kind", [*MODELS, st.DigitalServo])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_of_the_nominal_numbers_the_file_follows(kind):
    """Every servo of the catalog that the model knows is made of a sheet, and is the middle of its own fleet."""
    for name in st.catalog_names():
        servo = st.load_servo(name)
        measured = servo.kind == "bus" or "supply_voltage" not in servo.sheet
        if measured or (kind is st.DigitalServo and servo.kind == "analog"):
            continue  # has no numbers for this model, or its plant is measured
        model = kind(servo)
        together = Together(model)
        assert "sheet.no_load_speed" in together.coordinates, name
        nominal = {key: np.array([one.nominal]) for key, one in together.coordinates.items()}
        nominal |= {key: np.array([model.servo.get(key)]) for key in stated(model) if key not in nominal}
        found = together.follow(nominal)
        for key, column in found.items():
            assert column[0] == pytest.approx(model.servo.get(key), rel=1e-9, abs=1e-15), (name, key)
        given = {key for key in (*model.requires, *model.optional) if model.servo.get(key) is not None}
        assert set(found) == together.covers & given


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:.*contradicts itself")  # the sheet of the Geekservo
@pytest.mark.parametrize("name", ["hitec-hs-485hb", "geekservo-2kg", "hitec-hs-422"])
def test_each_lane_has_the_speed_and_the_torque_that_were_drawn(name):
    """A shaft without inertia worth mentioning is at its speed at once; it turns against less than its stall torque."""
    servo = st.load_servo(name)
    servo = servo.replace({"motor.rotor_inertia": 1e-10, "stops.lower_angle": -9.0, "stops.upper_angle": 9.0,
                           "gear.backlash": None, "gear.output_inertia": None})
    study = drawn(st.PulseServo(servo), only=("sheet.", "supply.", "gear.", "calibration.", "electronics.one"))
    speed, torque = study.table["sheet.no_load_speed"], study.table["sheet.stall_torque"]
    assert np.ptp(torque) > 0.2 * torque.mean()
    lanes, far = lane_parameters(study), st.signals.step(-45.0, 45.0, at=0.0, unit="deg")

    def at_the_end(signal, **load):
        loads = {f"load.{key}": column for key, column in load.items()}
        return st.simulate_many(st.PulseServo(servo), far, duration=0.09, parameters={**lanes, **loads},
                                output_times=[0.09], outputs=[signal])[signal][:, 0]

    np.testing.assert_allclose(at_the_end("output_speed"), speed, rtol=1e-6)
    assert np.all(at_the_end("output_speed", torque=torque * (1.0 - 1e-4)) > 0.0)
    assert np.all(at_the_end("output_speed", torque=torque * (1.0 + 1e-4)) <= 0.0)


@pytest.mark.long
@pytest.mark.parametrize("servo", [st.load_servo("hitec-hs-485hb"), without_sheet("hitec-hs-485hb")],
                         ids=["sheet", "hand"])
def test_the_gear_reduction_alone_moves_nothing_at_the_output(servo):
    model = st.PulseServo(servo.replace({"friction.stribeck_speed": 20.0, "friction.breakaway_ratio": 1.5}))
    study = drawn(model, only=("gear.gear_reduction", "sheet.no_load_speed", "output_torque_constant"))
    assert np.ptp(study.table["gear.gear_reduction"]) > 200.0
    lanes = lane_parameters(study)
    first = {name: np.full(16, column[0]) for name, column in lanes.items()}
    reduction = lanes["gear.gear_reduction"]
    # lane 0 again, with the reductions of the others: K_out and all else at the output stay those of lane 0
    by = reduction / reduction[0]
    first |= {"gear.gear_reduction": reduction, **{name: first[name] / by**power for name, power in (
        ("motor.torque_constant", 1), ("motor.back_emf_constant", 1), ("friction.coulomb_torque_forward", 1),
        ("friction.coulomb_torque_backward", 1), ("motor.motor_viscous_friction", 2), ("motor.rotor_inertia", 2),
        ("friction.stribeck_speed", -1))}}
    angle = st.simulate_many(model, STEP, duration=0.3, parameters=first, output_times=[0.1, 0.3],
                             outputs=["output_angle"])["output_angle"]
    np.testing.assert_allclose(angle, np.broadcast_to(angle[0], angle.shape), rtol=1e-9)
    # and the draws do just that: each lane is lane 0 but for its K_out
    for name, power in (("motor.rotor_inertia", 2), ("friction.stribeck_speed", -1)):
        np.testing.assert_allclose(lanes[name] * reduction**power, lanes[name][0] * reduction[0]**power, rtol=1e-12)


@pytest.mark.long(but="755-PulseServo")
@pytest.mark.parametrize("kind", MODELS)
@pytest.mark.parametrize("servo", [st.load_servo("hitec-hs-755hb"), st.load_servo("hitec-hs-485hb"),
                                   without_sheet("hitec-hs-485hb")], ids=["755", "485", "hand"])
def test_torque_and_back_emf_are_one_and_pulse_and_angle_go_together(servo, kind):
    table = drawn(kind(servo)).table
    np.testing.assert_array_equal(table["motor.torque_constant"], table["motor.back_emf_constant"])
    slope = table["electronics.one_shot_slope"]
    np.testing.assert_allclose(slope * table["potentiometer.feedback_gain"],
                               1.0 / table["calibration.angle_per_pulse"], rtol=1e-12)
    zero = table.get("calibration.zero_pulse", 1.5e-3)
    np.testing.assert_allclose(table["electronics.one_shot_offset"] + slope * table["potentiometer.feedback_offset"],
                               zero, rtol=1e-6)
    assert np.corrcoef(slope, table["potentiometer.feedback_gain"])[0, 1] < -0.5


def test_what_the_averaged_models_have_of_the_chip_is_the_mean_of_its_pulses():
    servo = st.load_servo("hitec-hs-485hb")
    study = drawn(st.BoundedServo(servo), lanes=4)
    for lane in range(4):
        values = {name: float(study.table[name][lane]) for name in (*study.parameters, *study.followed)
                  if name not in study.plan.together.coordinates}
        own = servo.replace(values)
        mean = st.PulseServo(own).averaged().servo
        for name in ("electronics.pulse_to_voltage_gain", "electronics.voltage_deadband"):
            assert own.get(name) == pytest.approx(mean.get(name), rel=1e-6), name
        gains = [x.electronics.bridge_gain * x.electronics.comparator_gain for x in (own, mean)]
        assert gains[0] == pytest.approx(gains[1], rel=1e-5)


@pytest.mark.long(but="hitec-hs-755hb-180.0")
@pytest.mark.parametrize(("name", "degrees"), [
    ("hitec-hs-485hb", 90.0), ("hitec-hs-755hb", 180.0), ("towerpro-sg90", 85.0), ("hitec-hs-55", 85.0),
    ("miuzei-ms18", 60.0)])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_no_lane_asks_for_a_pulse_that_its_chip_refuses(name, degrees):
    model = st.PulseServo(st.load_servo(name))
    study = st.sweep(model, st.signals.step(0.0, degrees, unit="deg"), duration=1e-3, vary=stated(model), lanes=1000,
                     metrics=["end_pulse_width"])
    asked = study.table["end_pulse_width"]
    assert np.ptp(asked) > 1e-5
    assert np.all((asked > study.table["electronics.pulse_width_min"])
                  & (asked < study.table["electronics.pulse_width_max"]))


def test_a_servo_made_by_hand_draws_what_acts_at_the_output():
    q = Quantity(value=2.42475e-3, unit="N m/A", origin="measured", source="me", std=1e-4)
    servo = without_sheet("hitec-hs-485hb", **{"motor.torque_constant": q})
    found = stated(st.PulseServo(servo))
    assert not any(name.startswith("sheet.") for name in found)
    assert vars(found["output_torque_constant"]) == numbers(Normal(280.0 * 2.42475e-3, 0.028))
    assert {"output_inertia", "output_viscous_friction", "output_coulomb_torque", "gear.gear_reduction",
            "motor.armature_resistance"} <= set(found)
    assert not set(MOTOR) & set(found)


@pytest.mark.long
def test_the_torque_constant_is_held_where_the_gear_reduction_alone_is_uncertain():
    exact = {name: replace(st.load_servo("hitec-hs-485hb").source(name), lower=None, upper=None)
             for name in ("motor.torque_constant", "motor.back_emf_constant")}
    model = st.PulseServo(without_sheet("hitec-hs-485hb", **exact))
    assert isinstance(stated(model)["output_torque_constant"], Choice)
    table = drawn(model).table
    np.testing.assert_allclose(table["motor.torque_constant"] * table["gear.gear_reduction"], 280.0 * 2.42475e-3,
                               rtol=1e-12)


@pytest.mark.long
def test_different_friction_both_ways_stays_so():
    other = Quantity(value=9e-4, unit="N m", origin="measured", source="me", std=1e-5)
    servo = without_sheet("hitec-hs-485hb").replace({"friction.coulomb_torque_backward": 9e-4})
    model = st.PulseServo(replace(servo, quantities={**servo.quantities, "friction.coulomb_torque_backward": other}))
    table = drawn(model).table
    assert {"output_coulomb_torque_forward", "output_coulomb_torque_backward"} <= set(table)
    np.testing.assert_allclose(table["friction.coulomb_torque_backward"] * table["gear.gear_reduction"],
                               table["output_coulomb_torque_backward"], rtol=1e-12)


@pytest.mark.parametrize("change", [{"motor.armature_resistance": 4.7}, {"motor.torque_constant": 2.4e-3},
                                    {"friction.load_friction_motor": 0.1}])
def test_a_motor_that_was_set_is_no_longer_that_of_the_sheet(change):
    found = stated(st.PulseServo(st.load_servo("hitec-hs-485hb").replace(change)))
    assert "sheet.no_load_speed" not in found
    assert not set(change) & set(found)


@pytest.mark.filterwarnings("ignore:the first change of the command")
def test_what_is_varied_by_name_is_varied_alone():
    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    study = st.sweep(model, STEP_LATER, duration=0.02, lanes=4, vary={"gear.gear_reduction": "normal:10%"})
    assert (study.parameters, study.followed) == (("gear.gear_reduction",), ())
    study = st.sweep(model, STEP_LATER, duration=0.02, lanes=4, vary={
        **stated(model), "motor.torque_constant": "normal:5%"})
    assert "motor.torque_constant" in study.parameters
    assert "motor.torque_constant" not in study.followed
    assert np.all(study.table["motor.torque_constant"] != study.table["motor.back_emf_constant"])


@pytest.mark.long
def test_a_single_number_of_the_sheet_can_be_varied():
    model = st.PulseServo(st.load_servo("hitec-hs-485hb"))
    study = st.sweep(model, STEP, duration=0.02, lanes=8, metrics=["peak_current"],
                     vary={"sheet.stall_torque": "uniform:10%"})
    assert "motor.armature_resistance" in study.followed
    # at the same speed and efficiency more torque takes more current
    order = np.argsort(study.table["sheet.stall_torque"])
    assert np.all(np.diff(study.table["motor.armature_resistance"][order]) < 0.0)


@pytest.mark.parametrize(("name", "kind", "said"), [
    ("sheet.stal_torque", UnknownNameError, "did you mean 'sheet.stall_torque'"),
    ("output_inertias", UnknownNameError, "did you mean 'output_inertia'"),
    ("output_stribeck_speed", ParameterError, "from which nothing of 'hitec-hs-485hb' follows"),
])
def test_names_that_cannot_be_drawn(name, kind, said):
    model = st.PulseServo(st.load_servo("hitec-hs-485hb"))
    with pytest.raises(kind) as caught:
        st.sweep(model, STEP, duration=0.02, lanes=4, vary={name: "uniform:10%"})
    assert said in str(caught.value)


def sheet_with(servo, key, **more):
    return replace(servo, sheet={**servo.sheet, key: {**servo.sheet[key], **more}})


@pytest.mark.parametrize(("key", "more", "name", "expected"), [
    ("stall_torque", {"std": 0.0586}, "sheet.stall_torque", Normal(1.0, 0.1)),
    ("stall_torque", {"lower": 0.5274}, "sheet.stall_torque", Uniform(0.9, 1.0)),
    ("speed_per_60deg", {"lower": 0.15, "upper": 0.2}, "sheet.no_load_speed", Uniform(0.9, 1.2)),
    ("no_load_current", {}, "sheet.no_load_current", Uniform(0.85, 1.15)),
])
def test_the_spread_that_the_table_states_goes_before_the_assumed_one(key, more, name, expected):
    model = st.PulseServo(sheet_with(st.load_servo("hitec-hs-485hb"), key, **more))
    found, nominal = stated(model)[name], Together(model).coordinates[name].nominal
    assert type(found) is type(expected)
    assert {which: value / nominal for which, value in vars(found).items()} == numbers(expected)


def test_other_sources_and_currents_that_are_not_printed_widen_the_range():
    model = st.PulseServo(st.load_servo("hitec-hs-422"))  # another source has 20 % less torque
    nominal = Together(model).coordinates
    torque = stated(model)["sheet.stall_torque"].quantile(np.array([0.0, 1.0]))
    low, high = torque / nominal["sheet.stall_torque"].nominal
    assert low < 0.84 or high > 1.16
    currents = stated(model)["sheet.no_load_current"].quantile(np.array([0.0, 1.0]))
    assert currents[1] / currents[0] > 3.0  # 4 to 30 % of the stall current


@pytest.mark.parametrize("bad", [{"value": "much", "unit": "N m"}, {"value": 1.0}, 3.0])
def test_a_figure_that_cannot_be_read_is_named(bad):
    servo = st.load_servo("hitec-hs-485hb")
    model = st.PulseServo(replace(servo, sheet={**servo.sheet, "stall_torque": bad}))
    with pytest.raises(InputError, match=r"\[sheet\] stall_torque of 'hitec-hs-485hb'"):
        stated(model)


@pytest.mark.parametrize(("first", "second", "expected"), [
    ({"lower": 0.36, "upper": 0.66}, {"lower": 1.0, "upper": 1.5}, Uniform(540.0, 660.0)),
    ({"lower": 0.4, "upper": 0.6}, {"lower": 1.0, "upper": 1.5}, None),  # all of it is the partner's
    ({"lower": 0.45, "upper": 0.55}, {"lower": 1.0, "upper": 1.5}, Uniform(540.0, 660.0)),  # surer than its partner
    ({"std": 0.05}, {"std": 0.1}, Normal(600.0, 60.0)),
    ({"lower": 0.45, "upper": 0.55}, {}, Uniform(540.0, 660.0)),
    ({}, {"lower": 1.0, "upper": 1.5}, None),
])
def test_the_spread_of_a_product(first, second, expected):
    one, two = (Quantity(value=value, unit="1", origin="assumed", **more)
                for value, more in ((0.5, first), (1.2, second)))
    found = scaled_spread(one, two, 600.0)
    assert type(found) is type(expected)
    assert expected is None or vars(found) == numbers(expected)


def test_a_word_has_no_spread():
    assert own_spread(Quantity(value="brake", unit="", origin="assumed")) is None


def test_what_does_not_move_a_metric_is_named_and_not_drawn():
    bars = [Bar("a", 0, 1, 0, 1, 1.0, 0.9), Bar("b", 0, 1, 0, 1, 0.011, 0.0), Bar("c", 0, 1, 0, 1, 0.009, 0.0),
            Bar("d", 0, 1, 0, 0, 0.0, 0.2), Bar("e", 0, 1, math.nan, 0, math.nan, math.nan),
            Bar("f", 0, 1, 0, 0, 0.0, math.nan)]
    found = tornado_of("rise_time", 1.0, bars, 2000)
    assert ([bar.name for bar in found.bars], found.still) == (["a", "b", "d", "e"], ("c", "f"))


def test_chance_makes_no_larger_share():
    rng, lanes = np.random.default_rng(0), 400
    shares = [variance_share(rng.random(lanes), rng.random(lanes)) for _ in range(300)]
    assert np.mean(np.array(shares) > chance_share(lanes)) < 0.02
    assert np.max(shares) > 0.3 * chance_share(lanes)


def test_the_slew_rate_of_a_fleet_is_that_of_its_sheet():
    """261 °/s of the maker; independent draws gave 186 to 444."""
    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    study = st.sweep(model, STEP_LATER, duration=0.6, vary=stated(model), lanes=300, metrics=["slew_rate"])
    low, high = (math.degrees(x) for x in study.quantiles([0.05, 0.95])["slew_rate"].values())
    assert 200.0 < low < 250.0 < high < 330.0
    tornado = study.tornado("slew_rate")
    assert tornado.bars[0].name == "sheet.no_load_speed"
    assert {"gear.gear_reduction", "electronics.command_pulse_offset", "stops.restitution"} <= set(tornado.still)


@pytest.mark.long
def test_a_study_of_what_a_file_states_goes_on_to_the_last_bit(tmp_path):
    model = st.PulseServo(st.load_servo("hitec-hs-485hb"))
    options = {"duration": 0.1, "vary": stated(model), "lanes": 32, "chunk": 8, "directory": tmp_path / "study"}
    command = st.signals.step(0.0, 60.0, at=0.01, unit="deg")
    first = st.sweep(model, command, **options)
    before = {file.name: file.read_bytes() for file in (tmp_path / "study").iterdir()}
    assert b"sheet.stall_torque," in before["lanes-00000.csv"]
    (tmp_path / "study" / "lanes-00002.csv").unlink()
    again = st.sweep(model, command, **options, resume=True)
    assert {file.name: file.read_bytes() for file in (tmp_path / "study").iterdir()} == before
    assert again.definition == first.definition
    assert first.definition["follow"] == sorted(first.followed)
    lane = {name: float(column[5]) for name, column in lane_parameters(first).items()}
    one = st.simulate(st.PulseServo(model.servo.replace(lane)), command, duration=0.1)
    assert first.table["end_output_angle"][5] == pytest.approx(one["output_angle"][-1], rel=1e-9)
