"""The table of recipes for MuJoCo's own actuators: what they lift and how far they stand off, beside their servos.

`python docs/_ext/recipe_table.py` prints it.
"""

import math
import warnings

import servotwin as st
from servotwin.models import default_model

_REGISTERS = {"P_Coefficient": 16, "D_Coefficient": 32}  # LeRobot's
_SERVOS = ("feetech-sts3215-12v", "feetech-sts3215-7v4", "dynamixel-mx-64", "dynamixel-ax-12a", "hitec-hs-755hb",
           "towerpro-mg996r", "towerpro-sg90")
HEAD = ("servo", "load, N m", "lift, N m", "off, come up, deg", "come down", "at half the load: up", "down",
        "30° step, rms, deg", "sine, rms")


def models():
    """Return the servos of the table, by what they are called there."""
    soft = st.feetech_sts(_REGISTERS, servo=_SERVOS[0])
    return {f"{_SERVOS[0]}, P 16, D 32": st.DigitalServo(soft),
            **{name: default_model(st.load_servo(name)) for name in _SERVOS}}


def row(name, model):
    """Return a line: numbers of the servo, and behind a slash those of its recipe."""
    error = st.robots.recipe_of(model).error
    twin, own = ([math.degrees(e) for e in (*one.droops, *one.droops_at_half)] for one in (error, error.dcmotor))
    pairs = [f"{a:.2f} / {b:.2f}".replace("-", "−") for a, b in zip(twin, own, strict=True)]
    steps = " / ".join(f"{math.degrees(one.step_rms):.1f}" for one in (error.position, error.dcmotor))
    return (name, f"{error.load:.3g}", f"{error.lift:.3g} / {error.dcmotor.lift:.3g}", *pairs, steps,
            f"{math.degrees(error.dcmotor.sine_rms):.1f}")


def recipes():
    """Return all lines."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of models that leave parameters out
        return [row(name, model) for name, model in models().items()]


if __name__ == "__main__":
    from tables import markdown

    print(markdown(HEAD, recipes()))
