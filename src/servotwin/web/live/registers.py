"""The registers of a bus servo as the page shows them: the maker's names, what they hold, what may be written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.errors import ServotwinError
from servotwin.parameters.registers.held import registers_of
from servotwin.parameters.registers.table import family_label
from servotwin.web.live.scene_servo import with_registers

if TYPE_CHECKING:
    from servotwin.parameters import Servo


def register_facts(servo: Servo) -> list[dict[str, Any]] | None:
    """Return the registers of a servo, each with what it holds, its range, and the numbers that follow from it.

    Examples
    --------
    >>> import servotwin as st
    >>> one, = (r for r in register_facts(st.load_servo("feetech-sts3215-12v")) if r["name"] == "P_Coefficient")
    >>> one["address"], one["value"], one["numbers"]
    (21, 32, ['firmware.proportional_gain'])
    """
    if family_label(servo) is None:
        return None
    return [{"name": name, "address": one.register.address, "low": one.register.lower, "high": one.register.upper,
             "only": list(one.register.only), "value": one.value, "why": one.register.why,
             "numbers": [f"firmware.{number}" for number in one.numbers]}
            for name, one in registers_of(servo).items() if _settable(servo, name, one.value)]


def _settable(servo: Servo, name: str, value: int) -> bool:
    """Tell whether a register can be written with what it holds: some stand for what is not computed."""
    try:
        with_registers(servo, {name: value})
    except ServotwinError:
        return False
    return True
