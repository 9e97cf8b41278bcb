"""However narrow a terminal is: every number that a wide one shows is there, whole, and no line is too long."""

import re
import shlex
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some
from typer.main import get_command

import servotwin as st
from servotwin.cli import main, terminal
from servotwin.cli.commands import app

ROOT = Path(__file__).parents[2]
WIDE, WIDTHS = 200, (60, 80, 120)
NUMBER = re.compile(r"(?<![\w.])[+-]?\d[\d.]*(?:[eE][+-]?\d+)?")
# Commands of the guide that need a board, a browser, minutes or files that no guide makes
LEFT_OUT = ("servotwin paper", "servotwin web", "servotwin wire", "servotwin bench", "servotwin robot",
            "servotwin fit ", "servotwin validate", "servotwin catalog check my-servo",
            "servotwin catalog from-sheet --csv", "servotwin catalog which --robot",
            "servotwin catalog which --motion", "servotwin simulate my-servo",
            "servotwin linear hitec-hs-755hb --load inertia=1e-3 --frame", "servotwin log ",
            "servotwin doctor my-servo", "servotwin doctor hitec")
# ... and what these tell of a log and a table that are made here
OF_FILES = (
    "servotwin log run.csv", "servotwin validate hitec-hs-422 run.csv", "servotwin doctor hitec-hs-422 run.csv",
    "servotwin doctor hitec-hs-422 --load inertia=1e-3 --set electronics.stretcher_gain=2500", "servotwin doctor",
    "servotwin fit --table table.csv --servo towerpro-mg90s --arm 1cm",
    "servotwin fit --table lifts.csv --servo towerpro-mg90s --arm 1cm",
    "servotwin fit run.csv --servo hitec-hs-422 --free output_inertia,output_coulomb_torque --no-compare --no-trials")
FIRST = "servotwin catalog which --lift 0.5kg --arm 10cm --voltage 5 --time 0.3"


def examples(command):
    """Return the examples in the help of a command and of those below it."""
    said = [part.removeprefix("Example: ").strip() for part in (command.epilog or "").split("\n\n")]
    return said + [line for each in getattr(command, "commands", {}).values() for line in examples(each)]


def documented():
    """Return the commands of the guide and of the help that end within seconds, with fewer lanes."""
    guide = (ROOT / "docs/guide/command-line.md").read_text(encoding="utf-8") + (
        ROOT / "docs/guide/curves.md").read_text(encoding="utf-8")
    found = [line.removeprefix("$ ") for line in guide.splitlines() if line.startswith("$ servotwin ")]
    found += examples(get_command(app))
    quick = [re.sub("^servotwin curves (?!.*--quick)", "servotwin curves --quick ", line) for line in found]
    return sorted({line for line in quick if line and not line.startswith(LEFT_OUT)})


def numbers(text):
    """Return how often each number stands in a text."""
    return Counter(NUMBER.findall(text))


def test_no_command_is_left_out_by_mistake():
    assert FIRST in documented()
    assert len(documented()) > 15


def made(folder):
    """Write a log and two tables."""
    model = st.PulseServo(st.load_servo("hitec-hs-422"))
    run = st.simulate(model, st.signals.step(-0.5, 0.2, at=0.5, unit="rad"), duration=1.5, output_step=0.01)
    run.save(folder / "run.csv")
    (folder / "table.csv").write_text("mass_g,current_mA\n100,230\n200,300\n320,370\n400,405\n450,450\n")
    (folder / "lifts.csv").write_text("mass_g,current_mA,time_60deg_s\n0,130,0.11\n100,230,0.13\n200,300,0.16\n"
                                      "320,370,0.21\n400,450,0.27\n")


@pytest.mark.long(but="line34")
@pytest.mark.parametrize("line", [*documented(), *OF_FILES])
def test_every_number_of_a_wide_terminal_stands_in_a_narrow_one(line, tmp_path, monkeypatch, capsys):
    """All widths are drawn of one run."""
    monkeypatch.chdir(tmp_path)
    if line in OF_FILES:
        made(tmp_path)
    monkeypatch.setenv("COLUMNS", str(WIDE))
    drawn = {width: "" for width in WIDTHS}
    as_drawn = terminal.drawn

    def at_all_widths(parts, width, **options):
        for each in WIDTHS:
            drawn[each] += as_drawn(parts, each, **options) + "\n"
        return as_drawn(parts, width, **options)

    monkeypatch.setattr(terminal, "drawn", at_all_widths)
    words = [re.sub(r"^(--lanes=)?(10000|200)$", "20", word) for word in shlex.split(line)[1:]]
    assert main(words) == 0, capsys.readouterr().err
    wide = capsys.readouterr().out
    if "--json" in words:
        return
    assert numbers(wide), line
    for width, text in drawn.items():
        assert set(numbers(text)) == set(numbers(wide)), (width, line)
        assert not numbers(wide) - numbers(text), (width, line)  # names of columns may stand there more often
        long = [row for row in text.splitlines() if len(row) > width and len(row.split()) > 1
                and max(map(len, row.split())) < width // 2]
        assert not long, (width, long)


CELLS = some.lists(some.sampled_from([
    "1.079 N m", "0.92 deg (0.55 to 1.67)", "a word", "electronics.minimum_drive_time", "", "-3.5e-07", "holding,",
    "10.8 deg (6.2 to 21.3), 1.02 A", "42"]), min_size=0, max_size=4).map(" ".join)


@given(some.integers(1, 8).flatmap(lambda n: some.tuples(
    some.lists(CELLS, min_size=n, max_size=n), some.lists(some.lists(CELLS, min_size=n, max_size=n), max_size=4))),
    some.integers(1, 150))
def test_a_table_of_any_width_has_all_words_whole(drawn, width):
    header, rows = drawn
    lines = [line.text for line in terminal.table_lines(header, rows, width)]
    shown = Counter(" ".join(lines).split())
    assert set(shown) - {"|"} <= {word for row in [header, *rows] for cell in row for word in cell.split()}
    for row in rows:  # a name may stand again behind each row, a value stands as often as it is there
        for word, count in Counter(" ".join(row).split()).items():
            assert shown[word] >= count
    assert all(len(line) <= max(width, 20) for line in lines) or width < 60


@given(some.lists(some.tuples(CELLS, CELLS), max_size=5), some.integers(1, 150))
def test_pairs_of_any_width_have_all_words_whole(rows, width):
    lines = [line.text for line in terminal.pair_lines(rows, width)]
    assert Counter(" ".join(lines).split()) == Counter(" ".join(f"{a} {b}" for a, b in rows).split())


def test_a_number_stays_with_its_unit():
    for width in range(20, 60):
        text = "\n".join(terminal.wrapped("holding 0.46 N m with 10.8 deg (6.2 to 21.3) and 1.02 A, 45 % of it", width))
        for whole in ("0.46 N m", "10.8 deg", "(6.2 to 21.3)", "1.02 A", "45 %"):
            assert whole in text


@pytest.mark.long
def test_the_stall_torque_at_80_columns(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["curves", "hitec-hs-755hb", "--voltage", "4.8", "--quick"]) == 0
    said = capsys.readouterr().out
    row = next(line.split() for line in said.splitlines() if line.startswith("stall torque, N m"))
    assert float(row[4]) > 1.0
    assert re.fullmatch(r"\d\.\d{3}", row[4])
    assert max(map(len, said.splitlines())) <= 80


def commands(command, path=()):
    """Return the words of a command and of those below it."""
    return [path] + [words for name, each in getattr(command, "commands", {}).items()
                     for words in commands(each, (*path, name))]


@pytest.mark.long(but="doctor")
@pytest.mark.parametrize("words", commands(get_command(app)), ids=" ".join)
def test_help_is_short_at_80_columns_and_all_of_it_is_behind_help_all(words, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([*words, "--help"]) == 0
    told = capsys.readouterr().out
    assert "Usage" in told
    assert "…" not in told
    assert len(told.splitlines()) <= 50
    command = get_command(app)
    for word in words:
        command = command.commands[word]
    options = {name for each in command.params for name in each.opts if name.startswith("--")}
    usual = {f"--{name}" for name in getattr(command.callback, "usual", ())}
    if not usual:
        assert options <= set(re.findall(r"--[a-z0-9-]+", told))
        return
    assert usual <= options
    assert set(re.findall(r"^[│|] (?:\*  |   )?(--[a-z0-9-]+)", told, re.MULTILINE)) == usual | {"--help", "--help-all"}
    assert main([*words, "--help-all"]) == 0
    assert options <= set(re.findall(r"--[a-z0-9-]+", capsys.readouterr().out))


def test_a_command_says_of_an_option_of_a_record_what_it_means_there(capsys):
    """A text of its own stands in the help of one command, and leaves that of the record to the others."""
    told = {}
    for name in ("simulate", "linear", "sweep"):
        assert main([name, "--help-all"]) == 0
        told[name] = " ".join(re.sub("[│|]", " ", capsys.readouterr().out).split())
    assert "geared-motor or dc-motor" in told["simulate"]
    assert "geared-motor" not in told["linear"] + told["sweep"]
    assert "as in servotwin simulate" in told["sweep"]
    assert "--register" in told["linear"]
    assert "--register" not in told["sweep"]
