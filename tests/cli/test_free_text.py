"""Free text through every command that writes: what comes out opens, and holds a name as letters or not at all.

A servo file, a log, a robot or a scene of a stranger may call itself anything. Names with what no reader sees are
refused when they are read; all others are letters in whatever is written.
"""

import ast
import csv
import dataclasses
import functools
import json
import math
import re
import shutil
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as Xml
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest
import typer

import servotwin as st
from servotwin.cli.commands import app
from servotwin.errors import HIDDEN
from servotwin.logs.csv_logs import write_log
from servotwin.parameters.servo_file import servo_text

# All that may stand in a name, at once, as one of the ends of a comment, a string, a tag, a formula or a path
LEGAL = '''*/ void f(){} /* "'</b><script>x</script>$\\frac{$ %s{0} ../../x??/ a,b \\'''
REFUSED = {"nul": "a\0b", "escape": "a\x1b[2Jb", "line end": "*/\nvoid f(){}\n/*", "right to left": "a\u202egpj.b",
           "10 kB": "n" * 10_000}
JOINTS = (LEGAL, "../../x", "n" * 10_000)
ALONE = ["--no-video", "--size", "5mm", "--speed", "0.2"]

RUNS = {
    "simulate": ["simulate", "pulse.toml", "--step", "0:60", "--duration", "0.1", "--out", "run.csv", "--plot",
                 "run.svg", "--json"],
    "simulate, printed": ["simulate", "pulse.toml", "--step", "0:60", "--duration", "0.1", "--plot", "run.png"],
    "curves": ["curves", "pulse.toml", "--quick", "--voltage", "6", "--out", "c.html", "--plot", "c.pdf", "--csv",
               "c.csv", "--json"],
    "linear": ["linear", "bounded.toml", "--model", "bounded", "--amplitude", "20deg", "--out", "l.html", "--plot",
               "l.svg", "--csv", "l.csv", "--json"],
    "sweep": ["sweep", "pulse.toml", "--step", "0:60", "--duration", "0.2", "--vary",
              "motor.torque_constant=normal:10%", "--lanes", "4", "--out", "study", "--plot", "--json"],
    "log": ["log", "log.csv", "--plot", "log.svg", "--out", "mended.csv", "--json"],
    "validate": ["validate", "bounded.toml", "log.csv", "--model", "bounded", "--report", "v.html", "--json"],
    "fit": ["fit", "log.csv", "--servo", "bounded.toml", "--model", "bounded", "--free", "output_inertia",
            "--no-intervals", "--no-trials", "--out", "fitted.toml", "--report", "f.html", "--json"],
    "doctor": ["doctor", "bounded.toml", "--model", "bounded", "--json"],
    "catalog show": ["catalog", "show", "pulse.toml", "--json"],
    "catalog show, printed": ["catalog", "show", "pulse.toml"],
    "catalog check": ["catalog", "check", "pulse.toml", "--json"],
    "catalog from-sheet": ["catalog", "from-sheet", "--csv", "sheet.csv", "--out", "sheets", "--json"],
    "catalog which": ["catalog", "which", "--prices", "prices.csv", "--lift", "0.5kg", "--arm", "10cm", "--json"],
    "robot run": ["robot", "run", "arm.xml", "--servo", "*=pulse.toml", "--mount", "*=-90deg", "--motion", "wave.csv",
                  "--settle", "0.05", "--no-video", "--out", "robot", "--json"],
    "robot validate": ["robot", "validate", "arm.xml", "episodes.csv", "--servo", "*=bus.toml", "--out", "checked",
                       "--json"],
    "robot fit": ["robot", "fit", "arm.xml", "episodes.csv", "--servo", "*=bus.toml", "--no-intervals", "--no-trials",
                  "--out", "fits", "--json"],
    "robot two-link": ["robot", "two-link", "--servo", "bounded.toml", "--model", "bounded", *ALONE, "--out",
                       "two-link", "--json"],
    "robot mobile": ["robot", "mobile", "--servo", "pulse.toml", "--waypoints", "0,0; 0.05,0", "--no-video", "--out",
                     "mobile", "--json"],
    "export c": ["export", "c", "pulse.toml", "--out", "c", "--json"],
    "export fmu": ["export", "fmu", "pulse.toml", "--sources", "--out", "p.fmu", "--json"],
    "bench rehearse": ["bench", "rehearse", "pulse.toml", "--mock", "-e", "hold", "--duration", "0.5", "--range",
                       "1000us:2000us", "--voltage", "6V", "--current-limit", "2A", "--out", "rehearsal", "--json"],
    "wire": ["wire", "wire.toml", "--duration", "0.05", "--keep", "kept.json", "--record", "recorded", "--json"],
}
NAMED = {"curves": LEGAL, "linear": LEGAL, "validate": LEGAL, "fit": LEGAL, "robot run": LEGAL, "robot fit": LEGAL,
         "robot validate": LEGAL, "export c": "void f(){} / *", "export fmu": "void f(){} / *"}
# Parameters that name what is read
READ = {"--pulses", "--command", "--draws", "--table", "--scene", "--link", "--hand", "--faults", "--motion",
        "--prices", "--package", "--calibration", "--wiring", "--log", "files", "file"}
# Writers that no name of a user reaches, or that another test writes with
ELSEWHERE = {
    ("paper", "--out"): "the paper's own servo", ("paper", "--json"): "the paper's own servo",
    ("bench paper", "--out"): "the paper's own servo", ("bench paper", "--json"): "the paper's own servo",
    ("curves", "--loop"): "the writer of --plot",
    ("robot compare", "--out"): "escapes as two-link; its runs take a minute", ("robot compare", "--json"): "as above",
    ("robot scara", "--out"): "the writer of two-link", ("robot scara", "--json"): "the writer of two-link",
    ("catalog list", "--json"): "the catalog's own names", ("catalog registers", "--json"): "the catalog's own names",
    ("web", "--export"): "test_page_alone: a scene travels packed", ("web", "--json"): "an address",
    ("bench list", "--json"): "ports", ("bench check", "--json"): "a board's own words",
    ("bench calibrate", "--out"): "numbers of channels", ("bench calibrate", "--json"): "numbers of channels",
    ("bench record", "--out"): "the recorder of rehearse", ("bench record", "--json"): "the recorder of rehearse",
    ("bench marker", "--out"): "a mark without words", ("bench video", "--out"): "the writer of logs",
    ("bench video", "--json"): "numbers of a film",
}
# Modules that write files or make their contents; a new one has to show here what names do in it
WRITERS = {
    "bench/recording/bench_wiring.py", "bench/recording/recorder.py", "bench/video/film_log.py",
    "bench/video/marker.py", "cli/bench.py", "cli/curves.py", "cli/curves_report.py", "cli/linear.py",
    "cli/linear_report.py", "cli/log.py", "cli/output_files.py", "cli/robot.py", "cli/robot_report.py",
    "cli/robot_task_report.py", "cli/web.py", "export/c_writing.py", "export/fmu.py",
    "identification/report/page.py", "identification/sheets/sheet.py", "logs/csv_logs.py", "logs/sidecar.py",
    "look/reports.py", "look/style.py", "paper/report.py", "parameters/output_file.py", "parameters/servo_file.py",
    "plotting/block_diagrams.py", "plotting/files.py", "simulation/compile/building.py",
    "simulation/compile/storage.py", "simulation/compile/threads.py", "simulation/lanes/c_entry.py",
    "simulation/result.py", "studies/study.py",
    "tables/columns.py", "web/alone/page.py", "web/server/own/reading.py", "web/server/own/work.py",
    "wire/service.py", "wire/traffic.py",
}


# --- what is written with ---------------------------------------------------------------------------------------------


@functools.cache
def text_of(servo):
    """Return a servo file of the catalog without its name, with notes that a terminal would obey."""
    text = servo_text(dataclasses.replace(st.load_servo(servo), notes="red: \x1b[31m */"))
    return text.split("\n", 2)[2]


def servo_file(path, servo, name):
    """Write a servo file that calls itself so."""
    path.write_text(f"name = {json.dumps(name)}\ntitle = {json.dumps(name)}\n{text_of(servo)}")


def robot(name, joints):
    text = "".join(f'<body pos="0.1 0 0"><joint name={quoteattr(joint)} axis="0 -1 0" range="-90 90"/><geom '
                   'type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" mass="0.05"/>' for joint in joints)
    return (f'<mujoco model={quoteattr(name)}><option timestep="0.002"/><worldbody>{text}'
            f"{'</body>' * len(joints)}</worldbody></mujoco>")


def table(path, header, rows):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """A folder of files whose names are all that a name may be."""
    folder = tmp_path_factory.mktemp("named")
    for name, of in (("pulse", "hitec-hs-755hb"), ("bounded", "hitec-hs-755hb"), ("bus", "feetech-sts3215-12v")):
        servo_file(folder / f"{name}.toml", of, LEGAL)
    (folder / "arm.xml").write_text(robot(LEGAL, JOINTS))
    times = np.linspace(0.0, 0.3, 16).tolist()
    table(folder / "wave.csv", ["time_s", *(f"{joint}_deg" for joint in JOINTS)],
          [[t, 20.0 * math.sin(3.0 * t), 10.0 * t, 0.0] for t in times])
    goals = [[0.5 * math.sin(3.0 * t), 0.3 * math.sin(2.0 * t), 0.2 * t] for t in np.linspace(0.0, 1.0, 51).tolist()]
    table(folder / "episodes.csv",
          ["episode_index", "timestamp", *(f"{side}.{joint}_rad" for side in ("action", "state") for joint in JOINTS)],
          [[k, 0.02 * n, *row, *(0.95 * x for x in row)] for k in (0, 1) for n, row in enumerate(goals)])
    result = st.simulate(st.BoundedServo(st.load_servo("hitec-hs-755hb")),
                         st.signals.step(0.5, 1.2, at=0.1, unit="rad"), duration=0.6, output_step=5e-3)
    seen = result["output_angle"] + np.random.default_rng(0).normal(0.0, 2e-3, len(result.time))
    log = st.Log(name=LEGAL, time=result.time, command=result["command_angle"], command_kind="angle", motion=LEGAL,
                 measured={"output_angle": seen})
    write_log(log, folder / "log.csv")
    table(folder / "sheet.csv", ["maker", "model", "V", "stall_torque_Nm", "speed_s_per_60deg"],
          [[LEGAL, "S 1", 6.0, 0.4, 0.19]])
    table(folder / "prices.csv", ["servo", "price_EUR"], [["towerpro-sg90", 2.5], ["pulse.toml", 1.0]])
    (folder / "wire.toml").write_text(f'[[servo]]\nid = 1\nservo = {json.dumps("bus.toml")}\n'
                                        f"joint = {json.dumps(LEGAL)}\n")
    return folder


@pytest.fixture
def here(cli, named, tmp_path, monkeypatch):
    """The command in a copy of that folder."""
    monkeypatch.setenv("MUJOCO_GL", "off")
    shutil.copytree(named, tmp_path, dirs_exist_ok=True)
    return cli


# --- what is written --------------------------------------------------------------------------------------------------


class Page(HTMLParser):
    """What a browser makes of a page: its elements, its words and the pictures in it."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.words, self.open = set(), [], []
        self.pictures = []
        self.feed(text)
        assert not self.open, self.open
        assert self.tags <= {"html", "head", "meta", "title", "style", "body", "h1", "h2", "h3", "p", "ul", "ol", "li",
                             "nav", "a", "b", "i", "em", "code", "div", "section", "span", "sub", "sup", "br", "wbr",
                             "table", "caption", "thead", "tbody", "tr", "th", "td", "figure", "figcaption", "img",
                             "footer", "details", "summary", "strong"}, self.tags

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        if tag not in ("meta", "img", "br", "wbr"):
            self.open.append(tag)
        for name, value in attributes:
            assert not name.startswith("on"), (tag, name)
            assert name in ("charset", "name", "content", "lang", "class", "id", "style", "href", "src", "alt",
                            "aria-label", "scope", "colspan"), (tag, name, value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def opened(path):
    """Open a file as who reads it does; return its text where a name may stand in it."""
    kind = path.suffix
    if kind == ".html":
        page = Page(path.read_text(encoding="utf-8"))
        assert not any(HIDDEN.search(word.replace("\n", "")) for word in page.words)
        return " ".join(page.words)
    if kind == ".svg":
        Xml.parse(path)
    elif kind == ".png":
        from matplotlib.image import imread

        assert imread(path).size
    elif kind == ".json":
        json.loads(path.read_text())
    elif kind == ".toml":
        st.load_servo(path)
    elif kind == ".csv":
        with path.open(newline="") as file:
            assert len({len(row) for row in csv.reader(file) if row}) == 1
    elif kind in (".c", ".h"):
        return commented(path.read_text())
    elif kind == ".fmu":
        import zipfile

        with zipfile.ZipFile(path) as whole:
            for name in whole.namelist():
                assert ".." not in name
                if name.endswith(".xml"):
                    Xml.fromstring(whole.read(name))
            return commented(*(whole.read(name).decode() for name in whole.namelist() if name.endswith((".c", ".h"))))
    else:
        assert kind in (".pdf", ".npz", ".parquet", ".jsonl", ".txt"), path
    return ""


def commented(*texts):
    """Return the comments of texts in C; nothing of a name stands outside of them."""
    for text in texts:
        code = re.sub(r"/\*.*?\*/", " ", text.replace("??/", "\\"), flags=re.DOTALL)
        assert "void f()" not in code
    return "".join(re.findall(r"/\*.*?\*/", "".join(texts), re.DOTALL))


def check_printed(text):
    assert not HIDDEN.search(re.sub(r"[\n\t]", "", text))


@pytest.mark.long(but="doctor")
@pytest.mark.parametrize("what", RUNS)
def test_whatever_a_name_is_what_is_written_opens(what, here, tmp_path, request):
    if what.startswith("robot"):
        pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
    words = RUNS[what]
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    ended = here(*words)
    assert ended.code == 0, ended.err
    check_printed(ended.out + ended.err)
    if "--json" in words:
        json.loads(ended.out)
    made = [path for path in tmp_path.rglob("*") if path.is_file() and path not in before]
    assert not any(before[path] != path.read_bytes() for path in before)
    named = [word for word in words[1:] if re.fullmatch(r"[\w-]+\.(csv|svg|png|pdf|html|toml|fmu)", word)]
    assert {word for word in named if tmp_path / word not in before} <= {path.name for path in made}
    texts = " ".join([opened(path) for path in made])
    if what in NAMED:
        assert NAMED[what] in texts


def test_a_terminal_gets_letters(here, tmp_path):
    assert "red: \\x1b[31m" in here("catalog", "show", "pulse.toml").out


# --- what is refused --------------------------------------------------------------------------------------------------


def with_a_servo():
    """Yield each command that reads a servo file, with a name for it; one that ends at once with every name."""
    kinds, k = list(REFUSED), 0
    for what, words in RUNS.items():
        if any(word.endswith((".toml", "*=pulse.toml")) for word in words[1:-1]) and "printed" not in what:
            for kind in kinds if what == "catalog check" else kinds[k % len(kinds):][:1]:
                yield what, kind
            k += 1


@pytest.mark.long(but="catalog check-nul")
@pytest.mark.parametrize(("what", "kind"), list(with_a_servo()))
def test_a_servo_with_a_name_that_no_reader_sees_is_refused_before_anything_is_written(what, kind, here, tmp_path):
    if what.startswith("robot"):
        pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
    for file in ("pulse", "bounded", "bus"):
        servo_file(tmp_path / f"{file}.toml", "hitec-hs-755hb", REFUSED[kind])
    before = sorted(tmp_path.rglob("*"))
    ended = here(*(word for word in RUNS[what] if word != "--json"))
    assert ".toml name: not possible: got " in ended.error
    assert ("at most 200 characters" if kind == "10 kB" else "without control or bidirectional") in ended.error
    check_printed(ended.error)
    assert sorted(tmp_path.rglob("*")) == before


def of_columns(path, name):
    table(path, ["time_s", "command_angle_deg", "output_angle_deg", name], [[0.1 * k, 1, 1, 1] for k in range(5)])


def of_a_sidecar(path, key, value):
    of_columns(path, "x")
    path.with_suffix(".json").write_text(json.dumps({"format": "servotwin-log-1", key: value}))


HIDDEN_NAMES = [name for key, name in REFUSED.items() if key not in ("10 kB", "line end", "nul")]


@pytest.mark.long
@pytest.mark.parametrize("name", HIDDEN_NAMES)
def test_names_of_columns_logs_joints_robots_and_scenes_are_refused_with_their_place(name, here, tmp_path):
    of_columns(tmp_path / "run.csv", name)
    assert "run.csv: line 1, name of column 4: got " in here("log", "run.csv").error
    for key, said in (("name", "name of a log"), ("motion", "motion")):
        of_a_sidecar(tmp_path / "run.csv", key, name)
        assert f"run.csv: {said}: got " in here("log", "run.csv").error
    of_a_sidecar(tmp_path / "run.csv", "conditions", {"room": name})
    assert "run.csv: conditions, room: got " in here("log", "run.csv").error
    table(tmp_path / "sheet.csv", ["maker", "model", "V", "stall_torque_Nm", "speed_s_per_60deg"],
          [["Acme", name, 6.0, 0.4, 0.19]])
    assert "sheet.csv: line 2, maker and model: got " in here("catalog", "from-sheet", "--csv", "sheet.csv").error
    (tmp_path / "wire.toml").write_text(f'[[servo]]\nid = 1\nservo = "feetech-sts3215-12v"\njoint = {json.dumps(name)}')
    assert "wire.toml: joint of servo 1: got " in here("wire", "wire.toml", "--duration", "0.1").error
    with pytest.raises(st.errors.InputError, match="name of a scene: got"):
        st.web.read_scene(f'format = 1\nname = {json.dumps(name)}\n[[servo]]\nid = "hitec-hs-755hb"\n')


@pytest.mark.parametrize(("what", "name", "joint"), [("a robot", "a\u202eb", "hip"), ("a joint", "arm", "hi\u2066p")])
def test_a_robot_whose_names_no_reader_sees_is_refused(what, name, joint, here, tmp_path):
    pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
    (tmp_path / "arm.xml").write_text(robot(name, [joint]), encoding="utf-8")
    words = ("robot", "run", "arm.xml", "--servo", "*=pulse.toml", "--motion", "wave.csv", "--out", "new")
    assert re.search(r"arm\.xml: name of (the model|a joint): got ", here(*words).error)
    assert not (tmp_path / "new").exists()


def test_a_header_of_two_lines_is_one_of_blanks(here, tmp_path):
    (tmp_path / "run.csv").write_text('time_s,command_angle_deg,"output_angle\n_deg","the\tload\r\n(N m)"\n' + "".join(
        f"{0.1 * k},{k},{k},0\n" for k in range(12)))
    assert "the load (N m)" in here("log", "run.csv", "--columns", "output_angle=output_angle _deg:deg").out


def test_a_text_that_is_no_unicode_is_said_in_a_line(here, tmp_path):
    words = ("catalog", "from-sheet", "--name", "zz", "--torque", "1 N m @6", "--speed", "0.2 s/60deg @6", "--note",
             "x\udcff", "--out", "new.toml")
    assert "not valid Unicode" in here(*words).error
    assert not (tmp_path / "new.toml").exists()


# --- all writers ------------------------------------------------------------------------------------------------------


def commands(group, path=()):
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))
    if not getattr(group, "commands", None):
        yield " ".join(path), command_options(group)


def command_options(command):
    """Return the parameters of a command that name a file, or let it print for machines."""
    for one in command.params:
        if re.search(r"\b(FILE|FOLDER|PATH|DIR)\b", one.metavar or "") or {"--json", "--plot"} & set(one.opts):
            yield one.opts[0]


def test_every_command_that_writes_is_tried():
    known = dict(commands(typer.main.get_command(app)))
    written = {(name, option) for name, options in known.items() for option in options
               if option not in READ}
    tried = {(name, option) for words in RUNS.values() for name in known for option in words
             if name.split() == words[:len(name.split())] and option.startswith("--")} & written
    assert written - tried == set(ELSEWHERE), sorted(written ^ (tried | set(ELSEWHERE)))
    assert len(tried) == 48


WRITES = re.compile(r"""\b(?:write_text|write_bytes|write_files?|writestr|savefig|savetxt|csv\.writer)\(|"""
                    r"""\b(?:Report|Beside)\(|\breports\.|"""
                    r"""(?<!\.)\bto_bytes\((?!self)|open\([^()]*(?:\([^()]*\))?[^()]*["'](?:w|wb|x|r\+)["']""")


def test_every_module_that_writes_is_known():
    package = Path(st.__file__).parent
    found = {path.relative_to(package).as_posix() for path in package.rglob("*.py")
             if WRITES.search(re.sub(r"^ *(>>>|\.\.\.) .*$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE))}
    assert found == WRITERS, found ^ WRITERS


def test_the_page_puts_texts_in_as_text():
    """No script of the page makes elements of a text, and no file loads one that it was not built with."""
    folder = Path(st.__file__).parent / "web"
    scripts = [path for path in folder.rglob("*.js") if "vendor" not in path.parts]
    assert len(scripts) > 40
    made = re.compile(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|createContextualFragment|\beval\(")
    for path in scripts:
        assert not made.search(path.read_text(encoding="utf-8")), path


@pytest.mark.parametrize("kind", ["csv", "script", "servo", "scene"])
def test_files_of_the_page(kind, tmp_path):
    from servotwin.web.live import SceneServo
    from servotwin.web.live.replay import exported

    servo_file(tmp_path / "pulse.toml", "hitec-hs-755hb", LEGAL)
    scene = st.web.Scene(servos=(SceneServo(file=(tmp_path / "pulse.toml").read_text()),), name=LEGAL, end=0.05)
    made = exported(kind, scene, tuple(one.built() for one in scene.servos))
    assert re.fullmatch(r"[\w.+-]+", made.name)
    if kind == "script":
        tree = ast.parse(made.text)
        assert not any(isinstance(node, ast.FunctionDef) for node in ast.walk(tree))
        (text,) = (node.value.value for node in tree.body if isinstance(node, ast.Assign)
                   and node.targets[0].id == "SCENE")
        assert st.web.read_scene(text) == scene
    elif kind == "csv":
        assert len({len(row) for row in csv.reader(made.text.splitlines())}) == 1
    else:
        assert tomllib.loads(made.text)["name"] == LEGAL
