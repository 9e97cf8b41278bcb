"""Every exception carries what, got and allowed, says them in one line, and survives a trip to another process."""

import copy
import pickle

import pytest

from servotwin import errors

EXAMPLES = [
    errors.InputError("duration", got=0.0, allowed="a positive number"), errors.UnitError("unit", got="x", allowed="s"),
    errors.ParameterError("motor.rotor_inertia", got=-1.0, allowed="a positive number [kg m2]"),
    errors.MissingParameterError("BoundedServo", "mine", ["motor.rotor_inertia", "gear.gear_reduction"]),
    errors.ServoFileError("a.toml", "wrong unit", table="motor", key="rotor_inertia", got="V", allowed="kg m2"),
    errors.UnknownNameError("servo", "hs755", ["hs-755", "sg90"]), errors.CommandError("step(at)", got=float("inf")),
    errors.LoadError("load.inertia", got=-1.0), errors.OutputExistsError("run.csv"), errors.OutputError("no room"),
    errors.BenchError("port /dev/ttyUSB0", "the cable is gone"), errors.MissingExtraError("pandas", "data"),
    errors.SimulationError("DIVERGED", 0.5, "not finite"),
]


def test_there_is_an_example_of_each():
    known = {kind for kind in vars(errors).values()
             if isinstance(kind, type) and issubclass(kind, errors.ServotwinError)}
    assert known - {type(error) for error in EXAMPLES} == {errors.ServotwinError}


@pytest.mark.parametrize("error", EXAMPLES, ids=lambda e: type(e).__name__)
@pytest.mark.parametrize("trip", [copy.copy, lambda e: pickle.loads(pickle.dumps(e))], ids=["copy", "pickle"])
def test_a_trip_loses_nothing(error, trip):
    again = trip(error)
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


@pytest.mark.parametrize(("error", "builtin"), [
    (errors.InputError, ValueError), (errors.UnknownNameError, KeyError), (errors.UnknownNameError, errors.InputError),
    (errors.BenchError, OSError), (errors.MissingExtraError, ImportError), (errors.SimulationError, RuntimeError),
    (errors.ServoFileError, errors.InputError), (errors.CommandError, errors.InputError),
    (errors.LoadError, errors.InputError), (errors.OutputExistsError, errors.InputError),
])
def test_the_tree_meets_the_builtin_one(error, builtin):
    assert issubclass(error, builtin)
    assert issubclass(error, errors.ServotwinError)


@pytest.mark.parametrize(("error", "text"), [
    (errors.InputError("a"), "a"), (errors.InputError("a", got=1), "a: got 1"),
    (errors.InputError("a", allowed="b"), "a: allowed: b"), (errors.InputError("a", got=0, allowed="b"),
                                                             "a: got 0, allowed: b"),
    (errors.ServoFileError("f", "wrong unit", table="t", key="k", got="V", allowed="A"),
     "f [t] k: wrong unit: got 'V', allowed: A"),
    (errors.UnknownNameError("servo", "hs755", ["hs-755", "sg90"]),
     "unknown servo 'hs755'; did you mean 'hs-755'?: allowed: hs-755, sg90"),
    (errors.UnknownNameError("servo", "zzz", []), "unknown servo 'zzz': allowed: none"),
    (errors.MissingParameterError("M", "s", ["a.b", "c.d"]), "M needs a.b, c.d, which servo 's' does not give"),
])
def test_messages(error, text):
    assert str(error) == text


@pytest.mark.parametrize("hostile", ["a\nb", "a\r\nb", "a\x1b[31mb", "a\u2028b", "a\0b"])
@pytest.mark.parametrize("make", [
    lambda s: errors.InputError(s, got=s, allowed=s), lambda s: errors.ServoFileError(s, s, table=s, key=s, got=s),
    lambda s: errors.UnknownNameError("servo", s, [s + "1"]), errors.OutputExistsError,
    lambda s: errors.MissingParameterError(s, s, [s]),
])
def test_whatever_it_quotes_the_message_is_one_printable_line(hostile, make):
    assert str(make(hostile)).isprintable()


@pytest.mark.parametrize("name", [3, None, 1.5, ("a",), "x" * 100_000])
def test_an_unknown_name_may_be_anything(name):
    error = errors.UnknownNameError("signal", name, ["time"])
    assert len(str(error)) < 300
    assert "allowed: time" in str(error)


def test_a_long_value_is_cut():
    assert len(str(errors.InputError("a", got=list(range(10_000))))) < 200
