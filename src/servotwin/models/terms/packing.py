"""From what is given of a servo and its load to all numbers of the engine; one text for plain Python and compiled.

Each model has its function. A term that it does not have is not there; `given` has what the model reads.
"""

from __future__ import annotations

from servotwin.models.terms import (
    bridge,
    duty,
    elastic,
    friction,
    heat,
    load,
    motor,
    play,
    sensor,
    shaft,
    source,
    stops,
)
from servotwin.models.terms.bridge import NO_BRIDGE
from servotwin.models.terms.elastic import NO_ELASTIC
from servotwin.models.terms.follower import NO_FOLLOWER, Follower
from servotwin.models.terms.friction import NO_FRICTION
from servotwin.models.terms.given import Given, Hung, either
from servotwin.models.terms.heat import NO_HEAT
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import NO_PLAY
from servotwin.models.terms.sensor import NO_SENSOR
from servotwin.models.terms.source import NO_SOURCE
from servotwin.models.terms.stops import NO_STOPS
from servotwin.physics.bridge import driving_voltage


def motor_alone(given: Given, hung: Hung) -> Numbers:
    """Return a motor, with a load on its own shaft or behind a gear that has nothing but its ratio."""
    N = either(given.gear_gear_reduction, 1.0)
    return Numbers(
        motor.pack(given, N), NO_BRIDGE, NO_SOURCE, NO_FOLLOWER, shaft.pack(given, hung, N), NO_FRICTION,
        load.pack(hung), NO_STOPS, NO_PLAY, NO_SENSOR, NO_HEAT, NO_ELASTIC)


def averaged(given: Given, hung: Hung) -> Numbers:
    """Return a servo whose voltage follows the error without bound, with smoothed friction."""
    N = given.gear_gear_reduction
    follower = Follower(given.electronics_bridge_gain * given.electronics_comparator_gain, 0.0, NO_FOLLOWER.V_max)
    return Numbers(
        motor.pack(given, N), NO_BRIDGE, NO_SOURCE, follower, shaft.pack(given, hung, N),
        friction.pack_smoothed(given, N), load.pack(hung), NO_STOPS, NO_PLAY, sensor.pack(given), NO_HEAT, NO_ELASTIC)


def bounded(given: Given, hung: Hung) -> Numbers:
    """Return a servo whose voltage follows the error between its bounds."""
    N = given.gear_gear_reduction
    V_max = driving_voltage(given.supply_open_circuit_voltage, 1.0, either(given.supply_bridge_drop_voltage, 0.0))
    follower = Follower(given.electronics_bridge_gain * given.electronics_comparator_gain,
                        0.5 * either(given.electronics_voltage_deadband, 0.0), V_max)
    return Numbers(
        motor.pack(given, N), NO_BRIDGE, NO_SOURCE, follower, shaft.pack(given, hung, N),
        friction.pack_sticking(given, N), load.pack(hung), stops.pack(given), NO_PLAY, sensor.pack(given), NO_HEAT,
        NO_ELASTIC)


def pulsed(given: Given, hung: Hung, error: float) -> Numbers:
    """Return an analog servo behind its bridge; `error` is that of its table where its feedback stands [V]."""
    N = given.gear_gear_reduction
    return Numbers(
        motor.pack(given, N), bridge.pack(given), source.pack(given), NO_FOLLOWER, shaft.pack(given, hung, N),
        friction.pack(given, N), load.pack(hung), stops.pack(given), play.pack(given),
        sensor.pack_pulsed(given, error), heat.pack(given), elastic.pack(given, hung))


def digital(given: Given, hung: Hung, error: float) -> Numbers:
    """Return a digital servo behind its bridge, as at full duty; `error` is that of its table where it stands [V]."""
    N = given.gear_gear_reduction
    return Numbers(
        motor.pack(given, N), duty.pack(given), source.pack(given), NO_FOLLOWER, shaft.pack(given, hung, N),
        friction.pack(given, N), load.pack(hung), stops.pack(given), play.pack(given),
        sensor.pack_counted(given, error), heat.pack(given), elastic.pack(given, hung))
