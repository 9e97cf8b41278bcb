"""All that a servo and its load are, as plain numbers: a record for each term."""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.state.modes import Vector
from servotwin.models.terms.bridge import NO_BRIDGE, Bridge, Off
from servotwin.models.terms.elastic import NO_ELASTIC, Elastic
from servotwin.models.terms.follower import NO_FOLLOWER, Follower
from servotwin.models.terms.friction import NO_FRICTION, Friction
from servotwin.models.terms.heat import NO_HEAT, Heat
from servotwin.models.terms.load import NO_LOAD, Load
from servotwin.models.terms.motor import NO_MOTOR, Motor
from servotwin.models.terms.play import NO_PLAY, Play
from servotwin.models.terms.sensor import NO_SENSOR, Sensor
from servotwin.models.terms.shaft import NO_SHAFT, Shaft
from servotwin.models.terms.source import NO_SOURCE, Source
from servotwin.models.terms.stops import NO_STOPS, Stops
from servotwin.physics.thermal import magnet_factor, winding_resistance


class Numbers(NamedTuple):
    """Everything that the automaton reads, the chip apart; plain floats in SI, at the output shaft."""

    motor: Motor = NO_MOTOR
    bridge: Bridge = NO_BRIDGE
    source: Source = NO_SOURCE
    follower: Follower = NO_FOLLOWER
    shaft: Shaft = NO_SHAFT
    friction: Friction = NO_FRICTION
    load: Load = NO_LOAD
    stops: Stops = NO_STOPS
    play: Play = NO_PLAY
    sensor: Sensor = NO_SENSOR
    heat: Heat = NO_HEAT
    elastic: Elastic = NO_ELASTIC


NEUTRAL = Numbers()


def at_temperature(numbers: Numbers, T_w: float, T_h: float) -> Numbers:
    """Return the numbers with a winding and a housing of these temperatures [K]: copper and magnets follow them."""
    cold, bridge = numbers.motor, numbers.bridge
    off, silence = bridge.off, bridge.silence
    R = winding_resistance(T_w, cold.R)
    more = R - cold.R
    field = magnet_factor(T_h, numbers.heat.magnet)
    between = Off(off.D, off.R + more, off.coast)
    same = silence.R == off.R and silence.D == off.D and silence.coast == off.coast
    silent = between if same else Off(silence.D, silence.R + more, silence.coast)
    return Numbers(
        Motor(cold.K * field, cold.K_b * field, R, cold.L),
        Bridge(bridge.D_drive, bridge.R_drive + more, between, silent, bridge.V_br, bridge.pwm, bridge.one_way),
        numbers.source, numbers.follower, numbers.shaft, numbers.friction, numbers.load, numbers.stops, numbers.play,
        numbers.sensor, numbers.heat, numbers.elastic)


def warm(numbers: Numbers, y: Vector) -> Numbers:
    """Return the numbers at the temperatures of a state; the numbers themselves where they stay."""
    return at_temperature(numbers, y.T_w, y.T_h) if numbers.heat.C_w > 0.0 else numbers
