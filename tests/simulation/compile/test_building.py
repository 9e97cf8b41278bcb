"""Libraries are made once, found again, and made anew where they are of no use; what goes wrong is said in one line."""

import ctypes
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import servotwin
from servotwin.models.state.noise import gaussian
from servotwin.simulation.compile import Recipe, building, finding, kernels, library
from servotwin.simulation.compile.finding import compilers as at_hand

RECIPE = Recipe("noise", ("servotwin.models.state.noise:gaussian",))
SCRIPT = """
import sys
from servotwin.simulation.compile import Recipe, backend, building, kernels
building._LONGEST = float(sys.argv[1])
kernel = kernels(Recipe("noise", ("servotwin.models.state.noise:gaussian",)))
print(kernel.gaussian(3, 7), "plain" if backend.is_plain() else "compiled")
"""
WANTED = gaussian(3, 7)
pytestmark = pytest.mark.skipif(sys.platform == "win32" or shutil.which("cc") is None, reason="shell scripts call cc")


def start(folder, *, longest=100.0, **variables):
    """Start a process that asks for a kernel."""
    package = str(Path(servotwin.__file__).parents[1])
    variables = {"PYTHONPATH": package, "SERVOTWIN_CC": "cc", **variables, "SERVOTWIN_CACHE_DIR": str(folder)}
    variables = os.environ | {name: value for name, value in variables.items() if value is not None}
    return subprocess.Popen([sys.executable, "-c", SCRIPT, str(longest)], text=True, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, env=variables)


def ended(process):
    """Return how kernels run in a process, and the lines that it wrote to stderr; its number is right."""
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    number, way = output.split()
    assert float(number) == pytest.approx(WANTED, rel=1e-14)
    return way, [line for line in errors.splitlines() if line and not line.startswith("  ")]  # of a warning, its text


def run(folder, **more):
    return ended(start(folder, **more))


def script(path, *lines):
    """Write a compiler."""
    path.write_text("\n".join(["#!/bin/sh", *lines, ""]))
    path.chmod(0o755)
    return str(path)


def counting(tmp_path):
    """Return a compiler that notes its runs, and the file where it does."""
    notes = tmp_path / "runs.txt"
    return script(tmp_path / "counting-cc", f"echo run >> {notes}", 'exec cc "$@"'), notes


def runs(notes):
    return notes.read_text().count("run") if notes.exists() else 0


def only(folder, pattern="*.so"):
    (found,) = folder.glob(pattern)
    return found


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """Return a cache in which there is a library, made by `cc`."""
    folder = tmp_path_factory.mktemp("filled")
    assert run(folder) == ("compiled", ["servotwin: compiling kernels for this machine, once"])
    assert sorted(path.suffix for path in folder.iterdir()) == [".json", ".lock", ".so"]
    return folder


@pytest.fixture
def folder(filled, tmp_path):
    """Return a copy of it."""
    return shutil.copytree(filled, tmp_path / "cache")


@pytest.mark.long
def test_what_has_been_made_is_found_again(folder):
    before = sorted((path.name, path.stat().st_mtime_ns) for path in folder.iterdir())
    assert run(folder) == ("compiled", [])
    assert sorted((path.name, path.stat().st_mtime_ns) for path in folder.iterdir()) == before


# --- compilers that are of no use -------------------------------------------------------------------------------------

BAD = {
    "names nothing": (None, "SERVOTWIN_CC names no program (no-such-compiler)"),
    "fails": (('echo "x.c:1: error: I do not like it" >&2', "exit 1"), "x.c:1: error: I do not like it"),
    "fails without a word": (("exit 3",), "it ended with 3"),
    "makes nothing": (("exit 0",), "it made no file"),
    "is killed half way": (('for a; do last=$o; o=$a; done; kill -9 $$',), "it ended with -9"),
    "writes rubbish": (('while [ "$1" != -o ]; do shift; done; echo rubbish > "$2"',),
        "file too short|invalid ELF header"),
    "hangs": (("sleep 60 & wait",), "it took more than 0.5 s"),
    "writes a program": (('while [ "$1" != -o ]; do shift; done', 'echo "int main(void) { return 0; }" > m.c',
                          'cc m.c -o "$2"'),
                         "cannot dynamically load|undefined symbol|position-independent"),
}


@pytest.mark.long(but="fails without a word")
@pytest.mark.parametrize("name", BAD)
def test_a_compiler_of_no_use_is_said_and_kernels_run_in_plain_python(name, tmp_path):
    lines, why = BAD[name]
    compiler = script(tmp_path / "bad-cc", *lines) if lines else "no-such-compiler"
    begun = time.monotonic()
    way, errors = run(tmp_path / "cache", SERVOTWIN_CC=compiler, longest=0.5 if name == "hangs" else 100.0)
    assert way == "plain"
    *made, warning = errors
    assert len(made) <= 1  # that kernels are compiled
    assert "RuntimeWarning" in warning
    assert "plain Python" in warning
    assert any(each in warning for each in why.split("|")), warning
    assert time.monotonic() - begun < 30.0
    assert not list((tmp_path / "cache").glob(".making-*"))


def test_without_any_compiler(tmp_path, monkeypatch):
    hiding = SCRIPT.replace("import sys\n", "import sys\nimport importlib.util\n"
                            "find = importlib.util.find_spec\n"
                            "importlib.util.find_spec = lambda name: None if name == 'ziglang' else find(name)\n")
    monkeypatch.setitem(globals(), "SCRIPT", hiding)
    way, errors = run(tmp_path / "cache", SERVOTWIN_CC="", PATH=str(tmp_path))
    assert way == "plain"
    (warning,) = errors
    assert "RuntimeWarning: no C compiler" in warning
    assert "pip install 'servotwin[compile]'" in warning


def test_a_compiler_that_hangs_leaves_nothing_running(tmp_path):
    pid = tmp_path / "pid"
    compiler = script(tmp_path / "bad-cc", f"sleep 61 & echo $! > {pid}", "wait")
    run(tmp_path / "cache", SERVOTWIN_CC=compiler, longest=0.5)
    state = Path(f"/proc/{pid.read_text().strip()}/stat")
    assert not state.exists() or state.read_text().split()[2] == "Z"


# --- caches that are of no use ----------------------------------------------------------------------------------------


def cut(path):
    path.write_bytes(path.read_bytes()[:path.stat().st_size // 2])


def cut_at_the_end(path):
    path.write_bytes(path.read_bytes()[:-16])


def other_architecture(path):
    content = bytearray(path.read_bytes())
    content[18] = 0xB7 if content[18] != 0xB7 else 0x3E  # e_machine: aarch64 or x86-64
    path.write_bytes(content)


def without_the_kernel(path):
    source = path.with_name("other.c")
    source.write_text("int other(void) { return 1; }")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", str(path), str(source)], check=True)
    source.unlink()


HARM = {"empty": lambda path: path.write_bytes(b""), "cut off": cut, "cut off at the end": cut_at_the_end,
        "rubbish": lambda path: path.write_text("rubbish" * 50), "of another architecture": other_architecture}


@pytest.fixture
def here(folder, monkeypatch):
    """Return that cache, for this process."""
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(folder))
    for module in (building, finding):
        monkeypatch.setattr(module, "compilers", lambda: tuple(filter(None, [finding._program("cc")])))
    building.tell.cache_clear()
    return folder


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="libraries as Linux has them")
@pytest.mark.parametrize("name", HARM)
def test_a_library_that_cannot_be_loaded_is_made_anew(here, name, monkeypatch, capsys):
    made = only(here)
    HARM[name](made)
    if name.startswith("cut off"):
        assert library._is_cut_off(made)  # or the system ends the process
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert capsys.readouterr().err == "servotwin: compiling kernels for this machine, once\n"
    assert only(here) == made
    monkeypatch.setattr(building, "_made", None)
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert capsys.readouterr().err == ""


@pytest.mark.long
def test_a_library_without_the_kernel_is_made_anew_for_the_next_process(folder):
    without_the_kernel(only(folder))
    way, errors = run(folder)  # the system gives what it has loaded from there once more
    assert way == "plain"
    assert len([line for line in errors if "RuntimeWarning" in line]) == 1
    assert run(folder) == ("compiled", [])


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"text": 5, "functions": []}',
    '{"text": "x", "functions": 7}',
                                  '{"text": "x", "functions": [["a"]]}', '{"name": "of another program"}', "\0\0"])
def test_an_index_of_no_use_is_written_anew(here, text, monkeypatch, capsys):
    index = only(here, "*.json")
    right = json.loads(index.read_text())
    index.write_text(text)
    monkeypatch.setattr(building, "compiled", None)  # the library is still there
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert capsys.readouterr().err == ""
    assert json.loads(index.read_text()) == right


def test_an_index_whose_entries_are_not_those_of_the_recipe(here):
    index = only(here, "*.json")
    right = json.loads(index.read_text())
    index.write_text(json.dumps(right | {"functions": right["functions"] * 2}))
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert json.loads(index.read_text()) == right


def test_a_file_in_place_of_the_cache(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    way, errors = run(tmp_path / "file")
    assert way == "compiled"
    first, second = errors
    assert "cannot be kept" in first
    assert "SERVOTWIN_CACHE_DIR" in first
    assert second == "servotwin: compiling kernels for this machine, once"
    assert (tmp_path / "file").read_text() == "not a folder"


def not_writable(monkeypatch):
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode, **more: not mode & os.W_OK and access(path, mode, **more))


def test_a_cache_that_cannot_be_written(tmp_path, monkeypatch, capsys):
    not_writable(monkeypatch)  # the permissions of a folder do not keep out its owner's system
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path))
    found = library.loaded(RECIPE)
    assert found.gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert not list(tmp_path.iterdir())
    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if "cannot be kept" in line] == lines[:1]


@pytest.mark.usefixtures("here")
def test_a_cache_that_cannot_be_written_but_has_everything_is_used_without_a_word(monkeypatch, capsys):
    not_writable(monkeypatch)
    monkeypatch.setattr(building, "_made", None)
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert capsys.readouterr().err == ""


def test_a_disk_that_is_full(tmp_path, monkeypatch):
    def full(*arguments, **more):
        raise OSError(28, "No space left on device")

    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(building.tempfile, "TemporaryDirectory", full)
    monkeypatch.setattr(building, "problems", said := [])
    assert library.loaded(RECIPE) is None
    assert said
    assert all("No space left on device" in line for line in said)


# --- caches that others may write -------------------------------------------------------------------------------------

OTHER = 65534  # nobody


def plant(path, mark):
    """Put a library in the place of another that leaves a mark where it is loaded."""
    source = path.with_name("planted.c")
    source.write_text("#include <stdio.h>\n__attribute__((constructor)) static void planted(void) {\n"
                      f'    fclose(fopen("{mark}", "w"));\n}}\n')
    subprocess.run(["cc", "-shared", "-fPIC", "-o", str(path), str(source)], check=True)
    source.unlink()


FOLDER, FILE = "the kernels cannot be kept in", "{library} is made anew"
OWNERS = {  # what is done to folder and library, and the beginning of what is said
    "a folder that all may write": (lambda folder, library: folder.chmod(0o777), FOLDER),
    "a folder that a group may write": (lambda folder, library: folder.chmod(0o770), FOLDER),
    "a library that all may write": (lambda folder, library: library.chmod(0o666), FILE),
    "a folder of another": (lambda folder, library: os.chown(folder, OTHER, -1), FOLDER),
    "a library of another": (lambda folder, library: os.chown(library, OTHER, -1), FILE),
    "a link to one of another": (lambda folder, library: linked(library), FILE),
    "a link of another to a folder": (lambda folder, library: moved(folder), FOLDER),
}


def linked(library):
    elsewhere = library.rename(library.parent.parent / library.name)
    os.chown(elsewhere, OTHER, -1)
    library.symlink_to(elsewhere)


def moved(folder):
    elsewhere = folder.rename(folder.with_name("elsewhere"))
    folder.symlink_to(elsewhere)
    os.chown(folder, OTHER, -1, follow_symlinks=False)


@pytest.mark.parametrize("name", OWNERS)
def test_nothing_is_loaded_that_others_may_have_put_there(name, here, tmp_path, capsys):
    if "another" in name and os.geteuid() != 0:
        pytest.skip("only root gives files away")
    (harm, said), made, mark = OWNERS[name], only(here), tmp_path / "planted"
    plant(made, mark)
    harm(here, made)
    found = library.loaded(RECIPE)
    assert not mark.exists()
    assert found.gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    first, *more = capsys.readouterr().err.splitlines()
    assert more in ([], ["servotwin: compiling kernels for this machine, once"])
    assert first.startswith(f"servotwin: {said.format(library=made)}")
    assert said == FILE or first.endswith("set SERVOTWIN_CACHE_DIR to a private folder")
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert capsys.readouterr().err == ""
    assert said == FOLDER or only(here).stat().st_mode & 0o777 == 0o700


def test_the_planted_library_is_one_that_would_be_loaded(here, tmp_path):
    plant(only(here), tmp_path / "planted")
    library.loaded(RECIPE)
    assert (tmp_path / "planted").exists()


def test_an_index_of_others_is_not_read(here, capsys):
    index = only(here, "*.json")
    index.chmod(0o666)
    index.write_text(json.dumps({"text": "../planted", "functions": []}))
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    said = f"servotwin: {index} is made anew, for others may write it, until chmod go-w\n"
    assert capsys.readouterr().err.startswith(said)
    assert json.loads(index.read_text())["text"] != "../planted"
    assert index.stat().st_mode & 0o777 == 0o600


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0 or shutil.which("setpriv") is None, reason="two users")
def test_another_user_gets_nothing_of_a_folder_that_all_may_write(tmp_path, monkeypatch):
    """Who comes first makes the folder, for itself alone; who comes second is told and makes its own kernels."""
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o1777)
    for path in (tmp_path, *tmp_path.parents[:3]):
        path.chmod(path.stat().st_mode | 0o055)
    nobody = as_nobody(tmp_path / "python")
    if subprocess.run([nobody, "-c", "import servotwin"], capture_output=True, check=False).returncode != 0:
        pytest.skip("another user cannot read this package")
    assert run(shared / "cache")[0] == "compiled"
    assert (shared / "cache").stat().st_mode & 0o777 == 0o700
    monkeypatch.setattr(sys, "executable", str(nobody))
    way, errors = run(shared / "cache", HOME=str(tmp_path))
    assert way == "compiled"
    assert errors[0] == (f"servotwin: the kernels cannot be kept in {shared / 'cache'} (Permission denied); set "
                         "SERVOTWIN_CACHE_DIR to a private folder")
    (shared / "cache").rename(shared / "of root")
    (shared / "cache").mkdir()
    os.chown(shared / "cache", OTHER - 1, -1)
    assert "it belongs to another user" in run(shared / "cache", HOME=str(tmp_path))[1][0]


def as_nobody(path):
    path.write_text(f'#!/bin/sh\nexec setpriv --reuid {OTHER} --regid {OTHER} --clear-groups {sys.executable} "$@"\n')
    path.chmod(0o755)
    return path


@pytest.mark.long
def test_a_cache_is_made_for_its_user_alone(tmp_path):
    old = os.umask(0o002)
    try:
        assert run(tmp_path / "new" / "cache") == ("compiled", ["servotwin: compiling kernels for this machine, once"])
        assert run(tmp_path / "new" / "cache") == ("compiled", [])
    finally:
        os.umask(old)
    made = tmp_path / "new" / "cache"
    assert {path.stat().st_mode & 0o077 for path in (made, *made.iterdir())} == {0}


def test_a_cache_that_is_named_from_here(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", "below/cache")
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert only(tmp_path / "below" / "cache")
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(odd := tmp_path / "red\x1b[31m\n"))
    odd.mkdir()
    odd.chmod(0o777)
    capsys.readouterr()
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert "red\\x1b[31m\\n (others may write it" in capsys.readouterr().err


def test_a_lock_is_no_way_into_another_file(here, tmp_path, monkeypatch):
    precious = tmp_path / "precious"
    precious.write_text("kept")
    lock = only(here, "*.lock")
    lock.unlink()
    lock.symlink_to(precious)
    only(here).unlink()
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert precious.read_text() == "kept"


def test_a_library_for_another_processor_is_not_loaded(tmp_path, monkeypatch):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path))
    names = set()
    try:
        for features in ({}, {"AVX2": True, "FMA3": True, "F16C": True}):
            monkeypatch.setattr(finding, "features", lambda features=features: features)
            finding.level.cache_clear()
            assert not finding.is_ready(RECIPE)
            (made, *_) = finding.built(RECIPE)
            assert finding.is_ready(RECIPE)
            names.add(made.path.name)
        assert len(names) == (2 if finding.levels()[0].startswith("x86") else 1)
    finally:
        finding.level.cache_clear()


def test_a_library_for_a_newer_c_library_is_made_anew(here, monkeypatch):
    asked, load = [], ctypes.CDLL

    def picky(name):
        asked.append(name)
        if len(asked) == 1:
            raise OSError(f"{name}: version `GLIBC_9.99' not found")
        return load(name)

    monkeypatch.setattr(ctypes, "CDLL", picky)
    before = only(here).stat().st_mtime_ns
    assert library.loaded(RECIPE).gaussian(3, 7) == pytest.approx(WANTED, rel=1e-14)
    assert len(asked) == 2
    assert only(here).stat().st_mtime_ns != before


# --- what is made once ------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_of_four_processes_at_once_one_compiles(tmp_path):
    compiler, notes = counting(tmp_path)
    cache = tmp_path / "cache"
    all_ = [start(cache, SERVOTWIN_CC=compiler) for _ in range(4)]
    assert [ended(process)[0] for process in all_] == ["compiled"] * 4
    assert runs(notes) == 1
    assert sorted(path.suffix for path in cache.iterdir()) == [".json", ".lock", ".so"]


@pytest.mark.long
def test_an_edited_docstring_compiles_nothing_and_edited_code_does(tmp_path):
    package = tmp_path / "package" / "servotwin"
    shutil.copytree(Path(servotwin.__file__).parent, package,
                    ignore=shutil.ignore_patterns("__pycache__", "*.hex", "page", "catalog"))
    compiler, notes = counting(tmp_path)
    with_own = {"PYTHONPATH": str(package.parent), "SERVOTWIN_CC": compiler}
    assert run(tmp_path / "cache", **with_own)[0] == "compiled"
    assert runs(notes) == 1
    noise = package / "models" / "state" / "noise.py"
    noise.write_text(noise.read_text() + '\n\ndef _of_no_use() -> None:\n    """Do nothing."""\n# a comment\n')
    law = package / "physics" / "motor.py"
    law.write_text(law.read_text().replace('"""', '"""Edited. ', 1))
    assert run(tmp_path / "cache", **with_own) == ("compiled", [])
    assert runs(notes) == 1
    text = noise.read_text()
    assert "math.sqrt(" in text
    noise.write_text(text.replace("math.sqrt(", "1.0 * math.sqrt(", 1))
    assert run(tmp_path / "cache", **with_own)[0] == "compiled"
    assert runs(notes) == 2


# --- threads ----------------------------------------------------------------------------------------------------------


COUNTING = """
def count(n: int):
    state = 1
    for k in range(n):
        state = (state * 1103515245 + k) & 2147483647
    return state
"""


@pytest.mark.long
def test_threads_run_kernels_at_the_same_time(tmp_path):
    """While a kernel counts, Python goes on in another thread."""
    from simulation.compile.by_hand import Both

    both = Both(COUNTING, tmp_path)
    span, moments = [], []

    def work():
        span.append(time.perf_counter())
        found.append(both.compiled("count", 400_000_000))
        span.append(time.perf_counter())

    found = []
    thread = threading.Thread(target=work)
    thread.start()
    while thread.is_alive():
        moments.append(time.perf_counter())
        time.sleep(1e-3)
    thread.join()
    begin, end = span
    within = [each for each in moments if begin + 0.2 * (end - begin) < each < end - 0.2 * (end - begin)]
    assert len(within) > 3
    assert found == [both.compiled("count", 400_000_000)]


def test_simulators_in_threads_give_the_same_bits(servo):
    model = servotwin.PulseServo(servo)

    def angles(lanes):
        own = servotwin.VectorSimulator(model, lanes=lanes, load=servotwin.loads.Inertia(1e-3), seed=3)
        own.reset(pulse_width=1.5e-3)
        found = []
        for k in range(200):
            own.advance(1e-3, pulse_width=1.2e-3 + 3e-6 * k)
            found.append(own["output_angle"].tobytes())
        return found

    lanes = (64, 65, 64)
    alone = [angles(each) for each in lanes]
    with ThreadPoolExecutor(len(lanes)) as pool:
        assert list(pool.map(angles, lanes)) == alone
    assert len(set(alone[0])) == 200


def test_threads_that_ask_for_a_kernel_at_once_get_the_same(tmp_path, monkeypatch):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path))
    recipe = Recipe("noise_of_threads", RECIPE.entries)
    barrier, found = threading.Barrier(4), []

    def ask():
        barrier.wait()
        own = kernels(recipe)
        found.append((own, [own.gaussian(seed, 5) for seed in range(1000)]))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert at_hand()
    assert len({id(own) for own, _ in found}) == 1
    assert all(numbers == found[0][1] for _, numbers in found)
    assert len(list(tmp_path.glob("*.so"))) == 1
