"""Flags of terms, which `|` unites.

`depends` of a term says on what the acceleration depends through it in a mode; dependence on the speed in a straight
line is not stated, for every solution has it. `needs` says what else whoever follows a servo has to follow. `ACTS` says
of each number of a term where it acts; a number that it does not name may act anywhere.
"""

from __future__ import annotations

# Answers of `depends`
ON_Q, ON_I = 1, 2  # in a straight line: on the angle, on a current with inertia
CURVED_Q, CURVED_W, CURVED_T = 4, 8, 16  # on angle, speed and time
STEEP_W = 32  # on the speed, and much of it within a short range
ON_HEAT = 64  # on temperatures
TWO_BODIES = 128  # motor and output move apart
FADING = 512  # on the speed, in no straight line while the shaft creeps
BY_SHARE = 256  # on the torques through the gear, in a straight line as long as the share keeps its sign

# Answers of `needs`
REGULATED = 1 << 10  # the source gives so much current at most
DROPS = 1 << 11  # between drives a current begins and ends
SILENCE = 1 << 12  # without pulses the bridge is off in another way than between drives
FREE_RUNNING = 1 << 13  # no back-EMF brakes the motor
FOLLOWS = 1 << 14  # the armature voltage follows the error
SLACK, STEPS = 1 << 15, 1 << 16  # the potentiometer has play, or is read in steps
PLAY, SPRING = 1 << 17, 1 << 18  # what lets two bodies move apart
PULSES, PROGRAM = 1 << 19, 1 << 20  # what decides on the drive
PWM, ONE_WAY = 1 << 21, 1 << 22  # the bridge is switched many times a tick; its current flows one way alone
TABLE, RECORDED = 1 << 23, 1 << 24  # inputs: the potentiometer's table, a torque over time

# Where a number acts that needs nothing by itself
STRAIGHT = 1 << 25  # in the straight-line law of a mode
DRY = 1 << 26  # in dry friction, constant while the shaft slides
AT_STOPS = 1 << 27  # at a stop
SHOWN = 1 << 28  # in outputs that the motion does not hang on
AT_COMMANDS = 1 << 29  # when a program hears a command
BEYOND = 1 << 30  # at ticks at which a program decides more than by P and D
