"""Formulas of the block diagrams, and their numbers for one servo."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.loads import Inertia
from servotwin.look import picture
from servotwin.models import AveragedServo, DCMotor, GearedMotor
from servotwin.paper.reproduction import LOAD_INERTIA, PaperStudy
from servotwin.plotting import formula_svg

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MOTOR = r"(L_a s + R_a)(J_m s + B_m) + k_a k_b"
_LOADED = r"(L_a s + R_a)(J_o s + B_o) + k_a k_b"
_LOOP = r"n\,k_a\,A\,k_s"

# number of the figure -> formulas: (equation, math text)
FORMULAS: dict[int, tuple[tuple[str, str], ...]] = {
    2: (("(15)", rf"$\dfrac{{\Theta_m}}{{V_a}} = \dfrac{{k_a}}{{s\,[{_MOTOR}]}}$"),),
    4: (("(22) with (19), (20)",
         r"$\dfrac{\Theta_L}{V_a} = "
         r"\dfrac{n\,k_a}{s\,[(L_a s + R_a)((J_m + n^2 J_L)\,s + B_m + n^2 B_L) + k_a k_b]}$"),),
    5: (("(16)", r"$\dfrac{\Theta_L}{T_o} = \dfrac{n\,/\,[(J_m s + B_m)\,s]}"
                 r"{1 + n\,/\,[(J_m s + B_m)\,s]\;\cdot\;n\,s\,(J_L s + B_L)}$"),
        ("(17)", r"$\dfrac{\Theta_L}{T_o} = \dfrac{n}{[(J_m + n^2 J_L)\,s + (B_m + n^2 B_L)]\,s}$")),
    6: (("(22)", rf"$\dfrac{{\Theta_L}}{{V_a}} = \dfrac{{n\,k_a}}{{s\,[{_LOADED}]}}$"),),
    8: (("(38) around (22), friction apart",
         rf"$\dfrac{{Q}}{{V_i}} = \dfrac{{{_LOOP}\,k_{{p1}} k_{{p2}}}}{{s\,[{_LOADED}] + {_LOOP}\,p}}$"),),
}


class Numeric(NamedTuple):
    """A transfer function with the servo's numbers: math text, poles [1/s] and what it is of."""

    text: str
    poles: tuple[complex, ...]
    words: str


def numeric(study: PaperStudy, number: int) -> Numeric | None:
    """Return the transfer function of a figure with the numbers of the servo; None where it has none of its own."""
    from servotwin.linear import transfer_function

    load = Inertia(LOAD_INERTIA)
    if number == 2:
        system = transfer_function(DCMotor(study.servo), input="armature_voltage", output="motor_angle")
        name, words = r"\dfrac{\Theta_m}{V_a}", "the motor of the servo alone (rad/V)"
    elif number == 6:
        system = transfer_function(GearedMotor(study.servo), input="armature_voltage", output="output_angle", load=load)
        name, words = r"\dfrac{\Theta_L}{V_a}", "with a load of 0.001 kg m² (rad/V)"
    elif number == 8:
        system = transfer_function(AveragedServo(study.servo), input="command_voltage", output="output_angle",
                                   load=load)
        name, words = r"\dfrac{Q}{V_i}", "without inductance, with a load of 0.001 kg m² (rad/V)"
    else:
        return None
    top, bottom = (np.atleast_1d(np.asarray(c, dtype=np.float64)) for c in (system.num[0][0], system.den[0][0]))
    lowest = bottom[np.flatnonzero(bottom)[-1]]
    text = rf"${name} = \dfrac{{{polynomial(top / lowest)}}}{{{polynomial(bottom / lowest)}}}$"
    return Numeric(text, tuple(complex(p) for p in system.poles()), words)


def polynomial(coefficients: NDArray[np.float64]) -> str:
    r"""Return a polynomial in s, highest power first, as math text with four digits.

    Examples
    --------
    >>> polynomial(np.array([2.0, 0.0, 1.0]))
    '2\\,s^{2} + 1'
    """
    terms = []
    for power, c in zip(range(coefficients.size - 1, -1, -1), coefficients.tolist(), strict=True):
        if c == 0.0:
            continue
        variable = "" if power == 0 else "s" if power == 1 else f"s^{{{power}}}"
        factor = _decimal(c)
        terms.append(variable if factor == "1" and variable else rf"{factor}\,{variable}" if variable else factor)
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _decimal(value: float) -> str:
    if 1e-2 <= abs(value) < 1e4:
        return f"{value:.4g}"
    mantissa, exponent = f"{value:.3e}".split("e")
    return rf"{float(mantissa):.4g} \cdot 10^{{{int(exponent)}}}"


def formula(text: str) -> str:
    """Return math text as a picture that goes with the letters around it."""
    made = formula_svg(text)
    return picture(made.svg, text.strip("$"), kind="formula",
                   style=f"width:{made.width / 10:.2f}em;aspect-ratio:{made.width:.1f}/{made.height:.1f}")
