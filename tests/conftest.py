"""What all tests share: a servo, a model of every class, and a folder of measured data where there is one."""

import signal
import threading
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import costs
import servotwin as st
from servotwin.models import MODELS

# A machine that does something else at the same time is no reason to fail, and each run draws the same examples
settings.register_profile("fixed", suppress_health_check=[HealthCheck.too_slow], derandomize=True, deadline=None)
settings.register_profile("explore", settings.get_profile("fixed"), derandomize=False)
settings.load_profile("fixed")


_LONG_FAMILY, _TURNS = 6, 3  # cases, of which one in so many runs


def pytest_addoption(parser):
    costs.add_options(parser)
    parser.addoption("--turn", type=int, metavar="N", help="run one in three cases of long families, by a number which")
    parser.addoption("--seed", type=int, help="run the tests that draw at random alone, from this seed on")


def pytest_configure(config):
    costs.begin(config)
    if threading.current_thread() is threading.main_thread():  # a shell has its background jobs ignore Ctrl-C
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.getoption("--seed") is not None:
        settings.load_profile("explore")
        config.option.hypothesisseed = config.getoption("--seed")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Take representatives of long families for quick; with `--seed` go on to other seeds, and leave out the rest."""
    examples = set(costs.BUDGETS["long_examples"])
    for item in items:
        if item.nodeid.partition("::")[2] in examples:
            item.add_marker("long")
        mark = item.get_closest_marker("long")
        if mark is not None and mark.kwargs.get("but") == getattr(getattr(item, "callspec", None), "id", ""):
            item.own_markers = [own for own in item.own_markers if own.name != "long"]
    seed = config.getoption("--seed")
    if seed is not None:
        drawing = [item for item in items if _shifted(item, 1000 * seed)]
        config.hook.pytest_deselected(items=[item for item in items if item not in set(drawing)])
        items[:] = drawing


@pytest.hookimpl(specname="pytest_collection_modifyitems", trylast=True)
def pytest_take_turns(config, items):
    """With `--turn`: run one in three cases of each family that has many among the tests that were chosen.

    What the documentation says is run whole: a page is to be true at every commit.
    """
    turn = config.getoption("--turn")
    if turn is None:
        return
    families = {}
    for item in items:
        families.setdefault(item.nodeid.partition("[")[0], []).append(item)
    drawn = {name for name, cases in families.items() if len(cases) >= _LONG_FAMILY and "tests/docs/" not in name}
    left = {item for name in drawn for k, item in enumerate(families[name]) if (k + turn) % _TURNS}
    config.hook.pytest_deselected(items=[item for item in items if item in left])
    items[:] = [item for item in items if item not in left]


def _shifted(item, by):
    """Tell whether a test draws at random: by hypothesis, or from a seed, which becomes another one."""
    parameters = item.callspec.params if hasattr(item, "callspec") else {}
    if isinstance(parameters.get("seed"), int):
        parameters["seed"] += by
        return True
    return getattr(getattr(item, "obj", None), "is_hypothesis_test", False)


@pytest.fixture(scope="session")
def servo():
    return st.load_servo("hitec-hs-755hb")


@pytest.fixture(scope="session")
def data_folder():
    folder = Path(__file__).resolve().parents[1].parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"measured data not found beside the repository ({folder})")
    return folder


# What no catalog servo states, all at once: play, Stribeck, load friction, heat, a regulator, a worn potentiometer
EVERYTHING = {
    "gear.backlash": 0.02, "gear.output_inertia": 1e-3, "friction.breakaway_ratio": 1.3,
    "friction.stribeck_speed": 10.0, "friction.stribeck_exponent": 1.5, "friction.load_friction_motor": 0.06,
    "friction.load_friction_external": 0.1, "friction.load_friction_motor_stribeck": 0.05,
    "friction.load_friction_external_quad": 0.2, "supply.internal_resistance": 0.2, "supply.current_limit": 1.2,
    "thermal.winding_capacity": 0.5, "thermal.housing_capacity": 5.0, "thermal.winding_to_housing": 10.0,
    "thermal.housing_to_ambient": 20.0, "thermal.magnet_coefficient": -1e-3, "potentiometer.backlash": 0.01,
    "potentiometer.linearity_angle": [0.0, 1.0, 2.0], "potentiometer.linearity_error": [0.0, 0.01, -0.01],
    "potentiometer.quantisation": 1e-3,
}


# What a program adds to an analog servo that makes a digital one of it
FIRMWARE = {"firmware.control_period": 1e-3, "firmware.proportional_gain": 6.0, "firmware.compute_delay": 7e-4,
            "firmware.derivative_gain": 0.02, "firmware.angle_quantum": 1e-3}


@pytest.fixture(params=[*MODELS, "pulse with everything", "pulse-inductive with everything",
                        "digital with everything"], scope="session")
def model(request, servo):
    name, _, more = request.param.partition(" with ")
    servo = servo.replace(FIRMWARE) if name == "digital" else servo
    return MODELS[name](servo.replace(EVERYTHING) if more else servo)
