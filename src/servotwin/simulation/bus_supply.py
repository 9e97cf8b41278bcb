"""The supply that several servos share: what it may be, what it is to the engine, and which lanes hang on it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.models import DigitalServo, Model, PulseServo, PulseServoInductive
from servotwin.models.terms.elastic import Elastic, behind, present
from servotwin.models.terms.source import Source
from servotwin.parameters.groups import Supply
from servotwin.simulation.lanes.inputs import pick

if TYPE_CHECKING:
    from servotwin.simulation.lanes.inputs import LaneInputs

Indices = NDArray[np.int64]
OF_BUS = ("supply.open_circuit_voltage", "supply.internal_resistance", "supply.current_limit")
"""What a bus has in the place of the servo's own."""
MODELS = (PulseServo, PulseServoInductive, DigitalServo)
MODEL_NAMES = "PulseServo, PulseServoInductive or DigitalServo"
_OF_SERVO = ("bridge_drop_voltage", "bridge_drop_resistance")


def check_supply(what: str, supply: object) -> None:
    """Raise InputError unless this is a supply that servos can share."""
    if not isinstance(supply, Supply) or supply.open_circuit_voltage is None:
        raise InputError(what, got=supply, allowed="a Supply with open_circuit_voltage, such as "
                         "Supply(open_circuit_voltage=6.0, internal_resistance=0.5)")
    for name in _OF_SERVO:
        if getattr(supply, name) is not None:
            raise InputError(f"supply.{name} of a bus", got=getattr(supply, name), allowed="it belongs to each servo")


def source_of(supply: Supply) -> Source:
    """Return a supply as the engine has it."""
    V_oc, R_b, I_max = supply.open_circuit_voltage, supply.internal_resistance, supply.current_limit
    return Source(V_oc or 0.0, R_b or 0.0, math.inf if I_max is None else I_max)


def check_rigid(what: str, numbers: Elastic) -> None:
    """Raise InputError if a servo that shall share a supply has a spring between two bodies."""
    if present(numbers):
        raise InputError(what, got="a body behind an elastic shaft" if behind(numbers) else "gear.stiffness",
                         allowed="a stiff gear and shaft: on a shared supply there are no springs between two bodies")


def on_supply(model: Model, supply: Supply) -> Model:
    """Return a model with this supply instead of its own."""
    values = {name: getattr(supply, name.partition(".")[2]) for name in OF_BUS}
    return type(model)(model.servo.replace(values, source="the supply that all share"))


@dataclass(frozen=True, eq=False)
class Supplies:
    """The supplies that lanes share.

    Parameters
    ----------
    supplies : tuple of Supply
    lanes : tuple of ndarray of int64
        Which lanes hang on each.
    count : int
        Number of all lanes.
    """

    supplies: tuple[Supply, ...]
    lanes: tuple[Indices, ...]
    count: int

    @cached_property
    def bus_of(self) -> Indices:
        """Number of each lane's bus, shape (count,); −1 where it hangs on none."""
        found = np.full(self.count, -1)
        for k, lanes in enumerate(self.lanes):
            found[lanes] = k
        return found

    def parts(self, inputs: LaneInputs, which: Indices) -> Iterator[tuple[LaneInputs, Indices]]:
        """Return lanes by the supply that they have, with their inputs."""
        bus_of = self.bus_of[which]
        for k in np.unique(bus_of).tolist():
            yield (inputs if k < 0 else self._fed(inputs, k)), which[bus_of == k]

    def _fed(self, inputs: LaneInputs, k: int) -> LaneInputs:
        own = {name: column for name, column in inputs.numbers.items() if name not in OF_BUS}
        return replace(inputs, model=on_supply(inputs.model, self.supplies[k]), numbers=own)

    def check_parameters(self, names: Sequence[str], which: Indices) -> None:
        """Raise InputError if a number of the supply shall change for a lane that is on a bus."""
        on_bus = which[self.bus_of[which] >= 0]
        for name in names:
            if name in OF_BUS and len(on_bus):
                raise InputError(f"{name} of lane {on_bus[0]}", got="a new value",
                                 allowed="no other than that of its bus, which it shares")


def supplies_of(bus: Any, model: object, count: int) -> Supplies:
    """Return the supplies that `bus` of a `VectorSimulator` with so many lanes means.

    Raises
    ------
    InputError
        On bad input; names bus and lane.
    """
    if bus is None:
        return Supplies((), (), count)
    if not isinstance(model, MODELS):
        raise InputError("model of servos on a bus", got=model, allowed=MODEL_NAMES)
    given = [(bus, np.arange(count))] if isinstance(bus, Supply) else bus
    if not isinstance(given, Sequence) or not given or not all(
            isinstance(one, Sequence) and len(one) == 2 for one in given):
        raise InputError("bus", got=bus, allowed="a Supply that all lanes share, or a list of (Supply, lanes)")
    seen = np.full(count, -1)
    found = []
    for k, (supply, some) in enumerate(given):
        check_supply(f"supply of bus {k}", supply)
        lanes = _lanes_of(k, some, count)
        if (seen[lanes] >= 0).any():
            lane = int(lanes[np.argmax(seen[lanes] >= 0)])
            raise InputError(f"lane {lane} of bus {k}", got=f"a lane of bus {seen[lane]} too",
                             allowed="each lane on one bus at most")
        seen[lanes] = k
        found.append(lanes)
    return Supplies(tuple(supply for supply, _ in given), tuple(found), count)


def _lanes_of(k: int, some: Any, count: int) -> Indices:
    try:
        lanes = np.arange(0) if np.size(some) == 0 else pick(some, count)
    except InputError as error:
        raise InputError(f"lanes of bus {k}", got=error.got, allowed=error.allowed) from None
    if not len(lanes) or some is None:
        raise InputError(f"lanes of bus {k}", got=some if some is None else "none", allowed="at least one lane")
    return lanes
