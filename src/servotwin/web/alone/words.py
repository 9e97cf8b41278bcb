"""What the page as one file says, beside the refusals of the rules."""

from __future__ import annotations

from servotwin import errors
from servotwin.parameters import GROUPS
from servotwin.parameters.servo import PLACES, USUAL_NAMES
from servotwin.simulation.bus import MODEL_NAMES

ONLY_WITH_SERVER = "only with the server: servotwin web"
WORDS = {
    "alone": "This bench computes here, without a server. Only with one (servotwin web): fits, logs but plain CSV, "
             "servo files but of catalog servos.",
    "only_with_server": ONLY_WITH_SERVER,
    "no_plain_log": "{name}: got {got}, allowed: plain CSV with columns such as time_s, pulse_width_us, "
                    "output_angle_deg; the server's page (servotwin web) reads far more",
    "a_number": "a number", "a_width": "a positive width", "rows": "a header and at least one row",
    "cut_line": "line {line} does not end in a newline and was left out",
    "log": "log: got none, allowed: a log that is dropped on the page first",
    "log_hint": "Drop a plain CSV table anywhere on the page: columns such as time_s, pulse_width_us (or "
                "command_angle_deg), output_angle_deg. The server's page (servotwin web) reads other tables, too.",
    "twin": "The twin begins at rest where the log begins; delay, phase of the pulses and zero of the angle are fitted "
            "by the server's page (servotwin web).",
    "types": {"number": "float", "whole": "int", "string": "str", "boolean": "bool", "array": "list", "object": "dict"},
    "digits": 6, "smallest": -4,
    "known": {"parameter": "GROUP.NAME, with a group of " + ", ".join(GROUPS)},
    "places": {"parameter": tuple(PLACES)}, "groups": {"parameter": tuple(GROUPS)}, "usual": {"parameter": USUAL_NAMES},
    "near": {"least": errors.NEAR, "longest": errors.LONGEST_NAME, "suggestions": errors.SUGGESTIONS,
             "letters": errors.FEWEST_LETTERS, "begins": errors.BEGINS, "holds": errors.HOLDS},
    "none": "none", "longest": errors.LONGEST_SHOWN, "dots": "...",
    "stands": "the bench stands: ",
    "too_long": "motion: got 'one that takes too long to compute at t = {time} s', allowed: numbers of a servo that is "
                "not so fast, and a new beginning",
    "repeating": "action: got 'while the bench is being repeated', allowed: a moment later",
    "no_single_frame": "single frame: got 'a bench that is being repeated', allowed: one that stands",
    "new_beginning": "bench: got {got}, allowed: a new beginning",
    "speed": "speed: got {got}, allowed: a number from 1e-06 to 10, or unpaced",
    "mystery": "Mystery servo {seed}",
    "mystery_scene": 'format = 1\nname = "Mystery servo {seed}"\n[[servo]]\nmystery = {seed}\nmodel = "PulseServo"\n',
    "no_such_model": "model of {id}: got {got}, allowed: one that the servo has numbers for",
    "takes_goals": "{kind} command of {name}: got '{word}', allowed: angles: it takes goals on a bus "
                   "(firmware.command_kind)",
    "no_supply": "supply of a scene: allowed: a Supply with open_circuit_voltage, such as "
                 "Supply(open_circuit_voltage=6.0, internal_resistance=0.5)",
    "bus_models": MODEL_NAMES,
    "rigid": "a stiff gear and shaft: on a shared supply there are no springs between two bodies",
    "no_inertia": "gear.backlash: got {got}, allowed: play only with inertia behind it: gear.output_inertia, or a load "
                  "that has some",
    "frame_rate": "frame rate: got {got}, allowed: frames that a pulse fits into",
    "a_register": "the name of a register, such as {such}",
    "no_servo_file": "servo file: got {got}, allowed: a file of a servo of the catalog with its parameters; the "
                     "server's page (servotwin web) reads any",
    "no_mystery_file": "servo file of a mystery servo: allowed: none: find out what it is",
    "no_circuit": "a bench that has one", "of_pulses": "one of pulses",
    "late_circuit": "less than what a frame leaves after its longest pulse [s]",
    "no_reference": "reference of a converter that hangs on the supply: allowed: a positive voltage: the supply has "
                    "broken down",
    "no_registers": "none: it is no bus servo", "bus_registers": "registers of a bus servo",
    "no_torque": "torque_enable of {model}: got {got}, allowed: nothing: an analog servo has no such switch",
    "no_torque_switch": "torque: got {got}, allowed: nothing: no servo here has such a switch",
    "too_many_actions": "record of the bench: got '100000 actions', allowed: no more: start it anew",
}
"""Messages by their names; {got} is what was given."""
