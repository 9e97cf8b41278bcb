"""Where each word of `joints_layout` stands, and how many there are; what is not a place is a number of the method."""

from __future__ import annotations

from servotwin.models.engine.observe import Observed
from servotwin.robots.servos import joints_layout as layout

WORD = 8  # bytes
SIGNALS, OWN_SIGNALS, IN_FRONT = len(Observed._fields), len(layout.KEPT), len(layout.ROW)
PASSES = 6  # through a tick, at most
MISSED = 1e-3  # rad/s of a servo: what a prediction may be off by
RESTS = 1e-9  # rad/s: what a shaft at rest may turn with in the engine, by rounding
SLIGHT = 1e-9  # rad/s: what tells nothing of a share
RK4 = 1  # MuJoCo's number of it
SAME = 1e-6  # of a tick: within it one instant is another

DRIVE_WORDS, INSTANCE_WORDS, GROUP_WORDS = len(layout.DRIVE), len(layout.INSTANCE), len(layout.GROUP)
PIECE_WORDS, RECORD_WORDS, BOOK_NUMBERS = len(layout.PIECE), len(layout.RECORD), len(layout.BOOKS)
ROOM_ROWS, HEAD, EACH = len(layout.ROOM), len(layout.BLOCK), len(layout.OF_EACH)

(SERVOS, DOFS, COORDINATES, WIDE, BODIES, TIMESTEP, INTEGRATOR, TIME, QPOS, QVEL, CTRL, APPLIED, XFRC, USERDATA, XIPOS,
 PASSIVE, BIAS, ACTUATOR, CONSTRAINT, SPRING, ENERGY, SOLVE, ACTUATE, ACCELERATE, CONSTRAIN, PUSH, POTENTIAL, KINETIC,
 STEP, SLOT, OWN, OTHERS, ANGLE_AT, SPEED_AT, COMMAND_AT, GAIN, ZERO, ARMATURE, LOWER, UPPER, LOW, HIGH, SCALE, OFFSET,
 CONTROL_LOW, CONTROL_HIGH, TOLD_GAIN, TOLD_ZERO, REST, LONGEST, KEPT_AT, MEMORY, INSTANCES, ASK) = range(DRIVE_WORDS)
(DATA, KEPT, ROOM, RECORD, GROUPS, COUNT, CODE, CULPRIT, SERIAL_NOW, NEW, ANGLES, ANGLE_COUNT,
 BOOKS) = range(INSTANCE_WORDS)
(ADVANCE, TICK, DURATION, LOOK, LANES, WHICH, G_ANGLE, G_SPEED, G_GOAL, G_LOAD, G_INERTIA, G_REACHED, G_AFTER,
 G_STATUS, G_SEEN, PIECES, PIECE_COUNT) = range(GROUP_WORDS)
ROW, CAPACITY, USED, KEPT_ROWS = range(RECORD_WORDS)
KEEPS, LAST_TICK, TOTAL, FIRST, WORK, NOWHERE = range(BOOK_NUMBERS)
START, END, CALLS, FRESH, SERIAL, RESTORED, HALF = range(HEAD)
(R_ANGLE, R_SPEED, R_GOAL, R_LOAD, R_INERTIA, R_AFTER, R_FREE, R_ACCELERATION, R_PREDICTED, R_FOUND, R_ACTUAL, R_FINAL,
 R_FINAL_ACCELERATION, R_FINAL_SHARE, R_ASKED, R_PASSIVE, R_PUSHED) = range(ROOM_ROWS)
