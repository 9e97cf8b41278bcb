"""What forms leave out and know follows from what terms say of themselves; nobody else keeps a list of terms."""

import ast
from itertools import product
from pathlib import Path

import pytest

import servotwin as st
from servotwin.models.engine import demands
from servotwin.models.engine.motions import choice, motion
from servotwin.models.state import modes
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.state.records import mapped
from servotwin.models.terms import dependence
from servotwin.models.terms.dependence import RECORDED
from servotwin.models.terms.firmware import NO_FIRMWARE
from servotwin.models.terms.frame import NO_CHIP
from servotwin.models.terms.numbers import ACTS, NEUTRAL, NOTHING, ROOMS, Numbers, moved, paths
from servotwin.physics.pieces import Piece

PACKAGE = Path(st.__file__).parent
FLAGS = {name: flag for name, flag in vars(dependence).items() if name.isupper()}
# Words that mean something else where they stand
OTHERS = {
    ("simulation/lanes/c_entry.py", "shaft"): "a word of the C struct: where the shaft is",
    ("simulation/compile/layout.py", "shaft"): "the same",
    ("simulation/compile/tick.py", "shaft"): "the same",
    ("simulation/lanes/inputs.py", "load"): "an argument of simulate_many",
    ("simulation/lanes/lane_numbers.py", "load"): "the same",
    ("simulation/lanes/packed.py", "motor"): "what is recorded of the motor's contact",
    ("simulation/lanes/packed.py", "firmware"): "a field of what all lanes share",
    ("simulation/lanes/forms.py", "heat"): "what lanes may have, as people read it",
    ("simulation/remarks.py", "heat"): "what a servo trips by, as people read it",
    ("simulation/vector_buses.py", "source"): "a field of what servos on a bus share",
    ("simulation/lanes/store.py", "chip"): "a field of a memory",
    ("simulation/lanes/lane_threads.py", "chip"): "a field of a memory",
    ("simulation/lanes/lane_threads.py", "shaft"): "of which loads are taken away",
    ("simulation/compile/threads.py", "firmware"): "a field of what a program gets",
    ("models/engine/batch/digital_batch.py", "sensor"): "a field of a tile",
    ("models/engine/batch/tiles.py", "chip"): "a field of a tile",
}


def strings(folder):
    """Return the strings of all modules in a folder of the package, each with the name of its module."""
    for file in sorted((PACKAGE / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield file.relative_to(PACKAGE).as_posix(), node.value


@pytest.mark.long
def test_nobody_else_names_a_term():
    numbers = {path for path, _, _ in paths()}
    found = {(file, text) for folder in ("simulation", "models/engine") for file, text in strings(folder)
             if text in ROOMS or text in numbers}
    assert found == set(OTHERS)


def test_every_number_that_is_said_to_act_somewhere_is_one():
    known = {path for path, _, _ in paths()} | set(Piece._fields)
    assert set(ACTS) <= known


def test_no_flag_means_two_things():
    assert len(set(FLAGS.values())) == len(FLAGS)
    assert all(flag.bit_count() == 1 for flag in FLAGS.values())


def test_what_a_number_asks_for_is_where_it_acts():
    """A number that alone asks for more than nothing does acts there: kernels that leave that out leave it out."""
    nothing = demands.demanded(NEUTRAL, NO_CHIP, NO_FIRMWARE, Piece())
    for path, acts in ACTS.items():
        if "." in path:
            asked = demands.demanded(*moved(path, 1.0), Piece())
            more = asked & ~nothing & ~dependence.SILENCE & ~dependence.DROPS
            assert not more or more & acts, (path, more, acts)


CASES = {  # numbers that ask for something
    "friction": {"friction": {"F_forward": 0.1, "F_backward": 0.1}},
    "varies": {"friction": {"F_forward": 0.1, "F_backward": 0.1, "varies": 1.0, "K_m": 0.1, "K_e": 0.05}},
    "fades": {"friction": {"F_forward": 0.1, "F_backward": 0.1, "varies": 1.0, "w_s": 2.0, "breakaway": 1.4}},
    "core": {"friction": {"F_forward": 0.1, "F_backward": 0.1, "kappa": 50.0}},
    "coil": {"motor": {"L": 1e-3}}, "spring": {"load": {"stiffness": 0.2}},
    "pendulum": {"load": {"gravity": 0.1}},
    "heat": {"heat": {"C_w": 5.0, "C_h": 50.0, "G_wh": 0.2, "G_ha": 0.05, "T_amb": 298.0}},
    "play": {"play": {"half": 0.01}}, "limit": {"source": {"I_max": 1.0}},
    "elastic": {"elastic": {"k": 20.0, "c": 0.01}},
}


@pytest.mark.long(but="True")
@pytest.mark.parametrize("behind", [True, False])
def test_motions_of_a_kind_come_up_only_where_it_is_said(servo, behind):
    """`begin` in every mode that a servo with these terms may be in, where something of that is to be followed."""
    kinds = {getattr(motion, word): word for word in demands._COMES_UP if hasattr(motion, word)
             and not hasattr(modes, word)}
    plain = st.PulseServo(servo).pack(st.loads.Inertia(1e-3) + st.loads.Constant(0.0))
    if not behind:
        plain = plain._replace(bridge=NOTHING["bridge"], source=NOTHING["source"])
    seen = set()
    for names in product(CASES, repeat=2):
        if {"play", "elastic"} == set(names) or (not behind and {"heat", "limit", "play", "elastic"} & set(names)):
            continue
        numbers = plain
        for name in names:
            for room, own in CASES[name].items():
                numbers = numbers._replace(**{room: getattr(numbers, room)._replace(**own)})
        numbers = mapped(float, numbers)
        for told in (0.0, 0.05):
            asked = demands.demanded(numbers, NO_CHIP, NO_FIRMWARE, Piece()) | (RECORDED if told else 0)
            never = demands.impossible(asked | dependence.STRAIGHT)
            for mode in modes_of(numbers, behind):
                y = Vector(0.3, 0.5 * way(mode), 0.1, 300.0, 299.0, 0.301, 0.4 * way(mode))
                found = choice.begin(numbers, mode, Piece(value=4.0), Piece(slope=told), 0.0, y, 1e-3, 0.1, 1e-9)
                word = kinds.get(found.kind)
                seen.add(word)
                assert word is None or word not in never, (names, told, mode, word)
    assert {"LONG_STEP", "CREEP", "APART", "WITH_CURRENT"} <= seen if behind else {"STEP"} <= seen


def way(mode):
    """Return which way the shaft moves in a mode."""
    return -1.0 if mode.contact == modes.BACKWARD else 1.0


def modes_of(numbers, behind):
    """Return modes that a servo may be in while it moves."""
    zones = (modes.CURRENT_FORWARD, modes.NO_CURRENT) if behind else (modes.LINEAR, modes.SATURATED)
    contacts = (modes.CORE,) if numbers.friction.kappa > 0.0 else (modes.FORWARD, modes.BACKWARD)
    mesh, motors = modes.RIGID, (modes.FREE,)
    if numbers.play.half > 0.0:
        mesh, motors = modes.INSIDE, (modes.FORWARD,)
    if numbers.elastic.k > 0.0:
        mesh, motors = modes.SPRUNG, (modes.FORWARD,)
    return [Mode(*one) for one in product(zones, contacts, (mesh,), motors, (0, 1))]


ASKED_FOR = dependence.STRAIGHT - 1  # flags that `depends` or `needs` say, not those of a place where numbers act


def test_a_number_that_is_said_to_act_nowhere_in_a_servo_does_not(servo, monkeypatch):
    """Else kernels would leave it out where it matters: what `ACTS` says has to be what a servo asks for."""
    model, load = st.PulseServo(servo.replace({"friction.breakaway_ratio": 1.2})), st.loads.Inertia(1e-3)
    command = st.signals.step(1000.0, 1500.0, at=0.005, unit="us")
    plain, chip = model.pack(load + st.loads.Constant(0.0)), model.chip()

    def angles(numbers):
        with monkeypatch.context() as patch:
            patch.setattr(st.PulseServo, "pack", lambda self, load: numbers)
            return st.simulate(model, command, load=load, duration=0.1, output_step=0.005)["output_angle"]

    before, asked = angles(plain), demands.demanded(plain, chip, NO_FIRMWARE, Piece())
    tried = 0
    for path, acts in ACTS.items():
        room, *fields = path.split(".")
        if acts & ~ASKED_FOR or not fields or room not in Numbers._fields or acts & asked:
            continue
        numbers = plain._replace(**{room: moved_in(getattr(plain, room), fields, 0.3)})
        if not demands.demanded(numbers, chip, NO_FIRMWARE, Piece()) & acts:
            tried += 1
            assert (angles(numbers) == before).all(), path
    assert tried > 15


def moved_in(record, fields, by):
    """Return a record with one of its numbers so much away from what it is."""
    first, *rest = fields
    own = getattr(record, first)
    return record._replace(**{first: moved_in(own, rest, by) if rest else own + by})
