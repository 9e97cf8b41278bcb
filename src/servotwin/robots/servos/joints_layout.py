"""The words of servos at the joints of a rigid-body engine, as compiled code reads them; each has eight bytes."""

from __future__ import annotations

PLACES = ("time", "qpos", "qvel", "ctrl", "qfrc_applied", "xfrc_applied", "userdata", "xipos", "qfrc_passive",
          "qfrc_bias", "qfrc_actuator", "qfrc_constraint", "qfrc_spring", "energy")
"""Of the engine's data: how many bytes behind its beginning time and energies stand, and the addresses of arrays."""
FUNCTIONS = ("mj_solveM", "mj_fwdActuation", "mj_fwdAcceleration", "mj_fwdConstraint", "mj_applyFT", "mj_energyPos",
             "mj_energyVel", "mj_step")
"""Addresses of functions of the engine."""
ARRAYS = ("angle_at", "speed_at", "command_at", "gain", "zero", "armature", "lower", "upper", "low", "high",
          "control_scale", "control_offset", "control_low", "control_high", "told_gain", "told_zero", "rest")
"""Of each servo: places in qpos, qvel and ctrl (or −1); what a turn of the servo is at the joint, and where it begins;
its own inertia there; ends of its travel, and of its commands; what a control asks of the joint, and its ends; what a
command of the joint is to the servo, and its command before there is one (nan: to hold where it begins)."""
DRIVE = ("servos", "dofs", "coordinates", "wide", "bodies", "timestep", "integrator", *PLACES, *FUNCTIONS, "slot",
         "own", "others", *ARRAYS, "longest", "kept_at", "memory", "instances", "ask")
"""All that servos share, wherever they are simulated."""
INSTANCE = ("data", "block", "room", "record", "groups", "count", "code", "culprit", "serial", "fresh",
            "angles", "angle_count", "books")
"""Servos in one of the engine's data; `room` is for numbers that are worked out anew at each tick. `fresh` is what they
remember at rest (0: ask Python), in which the words of `angles`, pairs of place and servo, are the angle of a servo."""
BOOKS = ("kept", "tick", "energy", "first", "work", "nowhere")
"""Energy [J] while a record is kept, at the beginning of a tick: whether there is any yet, and the last tick's duration
[s]; kinetic and potential energy, and what it was at first; the work of servos, actuators and applied forces since; the
most by which the energy has exceeded both. Behind it stand the work of each servo, and speed and force of each degree
of freedom, without those of gravity, springs and constraints."""
ROOM = ("angle", "speed", "goal", "load", "inertia", "after", "free", "acceleration", "predicted", "found",
        "engine's speed", "final torque", "final acceleration", "final share", "asked", "passive", "pushed")
"""Numbers of each servo there, behind the unit rows of their degrees of freedom, those of M⁻¹, all forces, and a square
for equations. The last two are the passive force of its joint without its torque, and with it."""
GROUP = ("advance", "tick", "duration", "look", "lanes", "which", "angle", "speed", "goal", "load", "inertia",
         "reached", "after", "status", "seen", "pieces", "count")
"""Servos of one model there, `which` of all: the function that advances them, its struct, where in this the duration
and the address of a signal stand, and arrays."""
PIECE = ("address", "rows", "stride", "bytes")
"""A part of their memory."""
RECORD = ("row", "capacity", "used", "rows")
"""The record of a run: numbers in a row, rows that there is room for, that there are, and where."""
KEPT = ("output_angle", "output_speed", "command_angle", "joint_torque", "asked", "joint_work")
"""Of each servo in a row of the record, before what `models.engine.observe` sees; "asked" is the command before it was
clipped."""
ROW = ("time", "energy", "energy_from_nowhere")
"""The first numbers of a row."""
BLOCK = ("start", "end", "calls", "fresh", "serial", "restored", "half")
"""The memory of servos of a tick: its times, the calls of the engine's step in it, whether it is the first, who worked
it out last, whether it was restored with its constraint forces, and which half of the memories is of its beginning.
Behind it stand the numbers of `OF_EACH`, the constraint forces that it took, and both halves."""
_CARRIED = ("known torque", "known acceleration", "share")
OF_EACH = ("torque", *_CARRIED, *(f"{name} before" for name in _CARRIED), "held", "goal",
           "told")
"""Numbers of each servo in a block: its mean torque over the tick; from where on the next torque is predicted, and how
much of another acceleration of its joint the servo takes up, from 0 (nothing) to 1 (it holds); where it holds before a
command; the goal sent to the joint, of one without an actuator, and whether one was (0: not)."""

ASK_NEW, ASK_RESET, ASK_ROOM = range(3)
"""Calls of compiled code to Python."""

WELL, NOT_FINITE, TOO_LONG, FAILED, REFUSED, FOREIGN, RESTARTED = range(7)
MESSAGES = {
    NOT_FINITE: "its angle, speed or command in MuJoCo is not a number",
    TOO_LONG: "MuJoCo's step is longer than a frame of the servo",
    FAILED: "the servo cannot go on",
    REFUSED: "the servos could not be set up",
    FOREIGN: "another control callback is installed",
    RESTARTED: "MuJoCo has met a number that is not finite, or too large, and has started anew",
}
"""Faults."""
