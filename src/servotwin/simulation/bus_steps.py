"""Servos on one supply that stop and go on, in plain Python: what is shown live."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from servotwin.models.engine import controller
from servotwin.models.engine.step import COMPLETED
from servotwin.models.terms import control
from servotwin.models.terms.source import Source
from servotwin.simulation.bus_rows import Segments, events_of, segments_of
from servotwin.simulation.bus_run import Plainly, Rows, tape_of, taped
from servotwin.simulation.engine import Event, Plan, State, failure
from servotwin.simulation.status import Status


class Stretch(NamedTuple):
    """What servos did in a stretch of time: their states at its end, and, of each, segments and events."""

    states: list[State]
    segments: list[Segments]
    events: list[tuple[Event, ...]]


class BusSteps:
    """Servos on one supply that stop and go on.

    Splitting an interval into several calls changes nothing beyond rounding.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.simulation.bus_supply import on_supply, source_of
    >>> supply = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.5)
    >>> sim = st.Simulator(on_supply(st.PulseServo(st.load_servo("hitec-hs-755hb")), supply))
    >>> command, steps = st.signals.step(0.0, 60.0, unit="deg"), BusSteps()
    >>> states = [sim.initial(command), sim.initial(command)]
    >>> for until in (0.1, 0.15, 0.2):
    ...     states = steps.go_on(source_of(supply), [sim.plan(command)] * 2, states, until).states
    >>> fleet = st.simulate_bus({"a": (sim.model, command), "b": (sim.model, command)}, supply=supply, duration=0.2)
    >>> abs(states[1]["output_angle"] - float(fleet["b"]["output_angle"][-1])) < 1e-12
    True
    """

    def __init__(self) -> None:
        self._way: Plainly | None = None
        self._source: Source | None = None

    def go_on(self, source: Source, plans: Sequence[Plan], states: Sequence[State], until: float,
              tell: Callable[[float], object] | None = None) -> Stretch:
        """Let all servos go on to a time.

        Parameters
        ----------
        source : Source
            That they share.
        plans, states : sequence of Plan, of State
            Of the servos, always in the same order.
        until : float
            [s]
        tell : callable, optional
            Is told the time [s] now and then; the servos cannot go on after it has raised.

        Raises
        ------
        SimulationError
            If the run cannot go on.
        """
        if self._way is None:
            self._way, self._tape = Plainly(plans, states, source), tape_of(len(plans))
        else:
            self._way.begin(plans, states)
            if source != self._source or self._are_others(plans, states):
                self._way.break_up(source)
        self._source = source
        rows = taped(self._way, until, self._tape, tell)
        if rows.status != COMPLETED:
            raise failure(Status.of_code(rows.status), rows.ended)
        return self._stretch(plans, states, until, rows)

    def _are_others(self, plans: Sequence[Plan], states: Sequence[State]) -> bool:
        """Tell whether numbers of a servo are others than before, or its clock is."""
        memories = self._way.memories if self._way is not None else []
        return any(plan.numbers != state.numbers or memory.beat != state.memory.beat
                   for plan, state, memory in zip(plans, states, memories, strict=True))

    def _stretch(self, plans: Sequence[Plan], states: Sequence[State], until: float, rows: Rows) -> Stretch:
        found = []
        memories = self._way.memories if self._way is not None else []
        for plan, state, memory in zip(plans, states, memories, strict=True):
            if plan.digital:
                controller.pause(plan.inputs, memory)
                memory = memory._replace(firm=(control.frozen(memory.firm[0]),))
            found.append(replace(state, time=until, memory=memory, numbers=plan.numbers))
        return Stretch(found, segments_of(plans, rows), list(events_of(plans, rows)))
