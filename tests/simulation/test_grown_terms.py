"""A law or a number that no fast form knows takes the general one: slow, never wrong.

What docs/theory/growing.md says of it is done here, step by step, in a copy of the package; its kernels run as text.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import servotwin

PACKAGE = Path(servotwin.__file__).parent
PAGE = Path(__file__).parents[2] / "docs/theory/growing.md"
GROUPS, FRICTION = "parameters/groups.py", "models/terms/friction.py"
PARAMETER = "    bearing_coulomb_torque: float | None = parameter("
SLIDES = "    F = coulomb(friction, forward)\n    if friction.varies == 0.0:\n        return F\n    if friction.w_s"
HOLDS = "    F = coulomb(friction, forward)\n    if friction.varies == 0.0:\n        return breakaway"


def parameters(*names):
    """Return the change that declares parameters of friction, beside the last one."""
    new = "".join(f'    {name}: float | None = parameter("", "number", ANY, "grown", THEORY.of(-1e3, 1e3))\n'
                  for name in names)
    return PARAMETER, new + PARAMETER


def value(name):
    """Return how `pack` asks for a parameter of friction."""
    return f"either(given.friction_{name}, 0.0)"


def reads(*names):
    """Return the change by which servos read parameters."""
    return "READS = (\n", "READS = (\n" + "".join(f'    "friction.{name}",\n' for name in names)


# A friction law: the parameter, the law, its name, and its term
A_FRICTION_LAW = {
    GROUPS: [parameters("quadratic_friction")],
    "physics/load_friction.py": [("def share_balance(", """\
def quadratic_friction(speed: float, coefficient: float) -> float:
    return coefficient * speed * speed


def share_balance(""")],
    "physics/__init__.py": [
        ("share_balance = array",
         "quadratic_friction = array_form(load_friction.quadratic_friction)\nshare_balance = array"),
        ('    "share_balance",\n', '    "quadratic_friction",\n    "share_balance",\n')],
    FRICTION: [
        reads("quadratic_friction"), ("    K_eq: float\n", "    K_eq: float\n    K_w: float\n"),
        ("Friction(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0,", "Friction(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0,"),
        ('**dict.fromkeys(_SHARES, _VARIES)}', '**dict.fromkeys(_SHARES, _VARIES), "K_w": CURVED_W}'),
        ("friction.K_e, 0.0, 0.0, 0.0, 0.0)", "friction.K_e, 0.0, 0.0, 0.0, 0.0, friction.K_w)"),
        ("K_m, K_e, K_ms, K_es, K_mq, K_eq)\n\n\ndef _coulomb",
         f"K_m, K_e, K_ms, K_es, K_mq, K_eq, {value('quadratic_friction')})\n\n\ndef _coulomb"),
        ("kappa, 0.0, 0.0, 1.0,", "kappa, 0.0, 0.0, 1.0, 0.0,"),
        ("ratio, 0.0, 0.0, 0.0, 1.0,", "ratio, 0.0, 0.0, 0.0, 1.0, 0.0,"),
        ("    gear_friction_budget,\n", "    gear_friction_budget,\n    quadratic_friction,\n"),
        (SLIDES,
         "    F = coulomb(friction, forward)\n    if friction.K_w > 0.0:\n"
         "        F += quadratic_friction(w, friction.K_w)\n"
         "    if friction.varies == 0.0:\n        return F\n    if friction.w_s"),
        ("    return (STEEP_W if contact == CORE else 0 if",
         "    return (STEEP_W if contact == CORE else CURVED_W if friction.K_w > 0.0 and not at_rest(contact)"
         " else 0 if")]}
# An off state: one more word and the resistance, and the loop in `pack`
OFF_STATE = '    off_state: str | None = choice(("brake", "coast"), "what the bridge does between drives")\n'
AN_OFF_STATE = {
    GROUPS: [(OFF_STATE, OFF_STATE.replace('"coast")', '"coast", "resist")')
              + '    off_resistance: float | None = parameter("R_off", "resistance", NOT_NEGATIVE, "of the brake", '
                "THEORY.of(0.0, 1e3))\n")],
    "models/terms/bridge.py": [
        ("READS = (\n", 'READS = (\n    "electronics.off_resistance",\n'),
        ("\n\nclass Off(", '_RESIST = place("electronics.off_state", "resist")\n\n\nclass Off('),
        ("    return Off(V_br + opens * V, given.motor_armature_resistance + (",
         "    resists = given.electronics_off_state == _RESIST\n"
         "    R_off = either(given.electronics_off_resistance, 0.0) if resists else 0.0\n"
         "    return Off(V_br + opens * V, given.motor_armature_resistance + R_off + (")]}
HEATS = {"thermal.winding_capacity": 0.5, "thermal.housing_capacity": 5.0, "thermal.winding_to_housing": 10.0,
         "thermal.housing_to_ambient": 20.0}
PLAYS = {"gear.backlash": 0.02, "gear.output_inertia": 1e-3}
FORMS = {  # of servos that resist between drives: what they have anyway, by the kernels that they take
    "side_by_side_float64": ("pulse", {}),
    "by_bands": ("pulse", {"friction.breakaway_ratio": 1.4, "friction.stribeck_speed": 5.0}),
    "by_strides": ("pulse", HEATS | {"friction.load_friction": 0.05}),
    "by_coils": ("inductive", {"motor.armature_inductance": 5e-4, "friction.load_friction": 0.05}),
    "by_gaps": ("pulse", PLAYS | HEATS),
    "runs": ("inductive", HEATS | {"motor.armature_inductance": 5e-4})}
# A number in each room, and of friction one of which `depends` says nothing
NUMBERS = {
    FRICTION: [("    K_eq: float\n", "    K_eq: float\n    new: float = 0.0\n"),
               ("K_m, K_e, K_ms, K_es, K_mq, K_eq)\n\n\ndef _coulomb",
                f"K_m, K_e, K_ms, K_es, K_mq, K_eq, {value('new_friction')})\n\n\ndef _coulomb"),
               (SLIDES, SLIDES.replace("forward)\n", "forward) + friction.new\n", 1)),
               (HOLDS, HOLDS.replace("forward)\n", "forward) + friction.new\n", 1))],
    "models/terms/shaft.py": [("    b_out: float\n", "    b_out: float\n    new: float = 0.0\n"),
                              ("B_L, reduction), J_L, B_L)", f"B_L, reduction), J_L, B_L, {value('new_shaft')})"),
                              ("import Given, Hung, inertia_on\n", "import Given, Hung, either, inertia_on\n"),
                              ("dry, against, shaft.b, shaft.J)", "dry, against, shaft.b + shaft.new, shaft.J)")],
    "models/engine/dynamics/coefficients.py": [("damping = (own.b + of_load", "damping = (own.b + own.new + of_load"),
                                      ("0.0, 0.0) - tau[0] -", "0.0, 0.0) - tau[0] - numbers.load.new -")],
    "models/terms/heat.py": [("    magnet: float  # [1/K]\n", "    magnet: float  # [1/K]\n    new: float = 0.0\n"),
                             ("magnet_coefficient, 0.0))", f"magnet_coefficient, 0.0), {value('new_heat')})"),
                             ("copper_loss(i, R), flow", "copper_loss(i, R) + heat.new, flow")],
    "models/terms/source.py": [("a regulator gives; inf: a battery\n",
                                "a regulator gives; inf: a battery\n    new: float = 0.0\n"),
                               ("current_limit, math.inf))", f"current_limit, math.inf), {value('new_source')})")],
    "models/terms/bridge.py": [
        ("in the sense of the drive alone\n", "in the sense of the drive alone\n    new: float = 0.0\n"),
        ("bridge.pwm, bridge.one_way)", "bridge.pwm, bridge.one_way, bridge.new)"),
        ("silent_coast), V_br, 0.0, 0.0)", f"silent_coast), V_br, 0.0, 0.0, {value('new_bridge')})"),
        ("    R = bridge.R_drive\n", "    R = bridge.R_drive + bridge.new + source.new\n")],
    "models/terms/frame.py": [("from which the bus sags\n", "from which the bus sags\n    new: float = 0.0\n"),
                              ("T_f, given.supply_open_circuit_voltage)",
                              f"T_f, given.supply_open_circuit_voltage, {value('new_chip')})"),
                              ("chip.slope, chip.T_0)", "chip.slope, chip.T_0 + chip.new)")],
    "models/terms/load.py": [("    hanging_angle: float\n", "    hanging_angle: float\n    new: float = 0.0\n"),
                             ("torque = tau + spring", "torque = tau + load.new + spring"),
                             ("def pack(hung: Hung)", "def pack(hung: Hung, new: float = 0.0)"),
                             ("hung.hanging_angle)", "hung.hanging_angle, new)")],
    "models/terms/packing.py": [
        (f"load.pack(hung), stops.pack(given), play.pack(given),\n        sensor.pack_{kind}",
         f"load.pack(hung, {value('new_load')}), stops.pack(given), play.pack(given),\n        sensor.pack_{kind}")
        for kind in ("pulsed", "counted")],
    "models/terms/stops.py": [("    restitution: float\n", "    restitution: float\n    new: float = 0.0\n"),
                              ("stops_restitution, 0.0))", f"stops_restitution, 0.0), {value('new_stops')})")],
    "models/engine/dynamics/contacts.py": [("numbers.stops.restitution)",
                                            "numbers.stops.restitution + numbers.stops.new)")],
    "models/terms/sensor.py": [("from one step to the next; 0: none\n",
                                "from one step to the next; 0: none\n    new: float = 0.0\n"),
                               ("potentiometer_quantisation, 0.0))",
                                f"potentiometer_quantisation, 0.0), {value('new_sensor')})"),
                               ("    if len(curve) > 0:\n        v_o +=",
                                "    v_o += sensor.new\n    if len(curve) > 0:\n        v_o +=")],
    "models/terms/firmware.py": [("    b_o: float  # V of", "    new: float  # grown\n    b_o: float  # V of"),
                                 ("        noise=either", f"        new={value('new_firmware')}, noise=either")],
    "models/engine/controller.py": [("- firmware.b_o + noise", "- firmware.b_o + firmware.new + noise")],
    "models/terms/elastic.py": [("    hanging_angle: float\n", "    hanging_angle: float\n    new: float = 0.0\n"),
                                ("        return NO_ELASTIC\n",
                                 "        return Elastic(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, "
                                 f"{value('new_elastic')})\n")],
    "models/engine/dynamics/currents.py": [  # where there is no spring either
        ("    return bridge.loop(numbers.bridge, numbers.source, zone, u)\n",
         "    v, R = bridge.loop(numbers.bridge, numbers.source, zone, u)\n    return v, R + numbers.elastic.new\n")],
}
ROOMS = {  # by how much, and what the servo has anyway
    "friction": (0.2, {}), "shaft": (0.05, {}),
    "heat": (50.0, HEATS),
    "source": (0.5, {}), "bridge": (0.5, {}), "chip": (5e-5, {}), "load": (0.05, {}),
    "stops": (0.3, {"stops.upper_angle": 0.3, "stops.restitution": 0.2}), "sensor": (0.05, {}),
    "elastic": (0.5, {}), "firmware": (0.05, {})}
NAMES = [f"new_{room}" for room in ROOMS]
A_NUMBER_IN_EACH_ROOM = NUMBERS | {GROUPS: [parameters(*NAMES)], FRICTION: [reads(*NAMES), *NUMBERS[FRICTION]]}


def grown(folder, growth, cases):
    """Return what a copy of the package with some changes tells of servos."""
    shutil.copytree(PACKAGE, folder / "servotwin", ignore=shutil.ignore_patterns("__pycache__"))
    for name, changes in growth.items():
        file = folder / "servotwin" / name
        text = file.read_text(encoding="utf-8")
        for before, after in changes:
            assert text.count(before) == 1, (name, before, text.count(before))
            text = text.replace(before, after)
        file.write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(folder), "SERVOTWIN_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run([sys.executable, str(Path(__file__).with_name("grown_runs.py")), json.dumps(cases)],
                          text=True, capture_output=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert Path(told["package"]).is_relative_to(folder)
    return told["cases"]


def check(cases):
    """Check that what has grown moves servos, and lanes of a batch alike."""
    for name, told in cases.items():
        assert told["changed"] > 1e-4, (name, told)
        assert told["apart"] < 1e-9, (name, told)


def files_of(section):
    """Return the files that the steps of a section of the page name, behind their numbers."""
    text = PAGE.read_text(encoding="utf-8").split(f"\n## {section}\n")[1].split("\n## ")[0]
    return {name for line in re.findall(r"^\d\. (.*?):", text, re.MULTILINE) for name in re.findall(r"`(.*?)`", line)}


@pytest.mark.parametrize(("section", "growth", "most"), [
    ("A friction law", A_FRICTION_LAW, 4), ("An off state of the bridge", AN_OFF_STATE, 6)])
def test_the_page_names_the_files_that_are_touched(section, growth, most):
    assert files_of(section) == set(growth)
    assert len(growth) <= most


@pytest.mark.slow
def test_a_friction_law(tmp_path):
    law = {"friction.quadratic_friction": 0.02}
    check(dict(enumerate(grown(tmp_path, A_FRICTION_LAW, [["pulse", 1200.0, {}, law], ["digital", 1200.0, {}, law]]))))


@pytest.mark.slow
def test_an_off_state_of_the_bridge(tmp_path):
    state = {"electronics.off_state": "resist", "electronics.off_resistance": 5.0}
    cases = [[kind, 800.0, known, state] for kind, known in FORMS.values()]
    told = dict(zip(FORMS, grown(tmp_path, AN_OFF_STATE, cases), strict=True))
    check(told)
    for form, found in told.items():
        assert form in found["used"], (form, found)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pulse", "digital"])
def test_a_number_in_each_room(tmp_path, kind):
    rooms = [room for room in ROOMS if room not in (
        ("firmware",) if kind == "pulse" else ("chip", "bridge", "source"))]  # a duty makes bridge and source anew
    cases = [[kind, 1200.0, ROOMS[room][1], {f"friction.new_{room}": ROOMS[room][0]}] for room in rooms]
    check(dict(zip(rooms, grown(tmp_path, A_NUMBER_IN_EACH_ROOM, cases), strict=True)))
