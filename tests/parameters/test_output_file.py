"""A file is written whole or not at all, and only where a file may be."""

import os
import stat

import pytest

from servotwin.errors import OutputError, OutputExistsError
from servotwin.parameters import write_file


def put(text):
    return lambda path: path.write_text(text)


def test_the_file_appears_whole(tmp_path):
    target = tmp_path / "a.txt"

    def write(path):
        assert not target.exists()
        assert path.parent == target.parent  # or it could not be moved in one step
        assert path.suffix == ".txt"
        path.write_text("half")
        path.write_text("whole")

    write_file(target, write)
    assert target.read_text() == "whole"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("error", [ValueError("bug"), KeyboardInterrupt(), OSError(28, "No space left on device")])
@pytest.mark.parametrize("existed", [True, False])
def test_a_failure_leaves_what_was_there(tmp_path, error, existed):
    target = tmp_path / "a.txt"
    if existed:
        target.write_text("old")

    def write(path):
        path.write_text("half")
        raise error

    expected = OutputError if isinstance(error, OSError) else type(error)
    with pytest.raises(expected):
        write_file(target, write, overwrite=True)
    assert os.listdir(tmp_path) == (["a.txt"] if existed else [])
    assert not existed or target.read_text() == "old"


def test_what_exists_is_kept_unless_asked(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(OutputExistsError, match=r"a\.txt exists already; use --force"):
        write_file(target, put("new"))
    assert target.read_text() == "old"
    write_file(str(target), put("new"), overwrite=True)
    assert target.read_text() == "new"


def test_others_may_read_it_as_any_file(tmp_path):
    (tmp_path / "plain").write_text("")
    write_file(tmp_path / "a.txt", put(""))
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)


def test_the_longest_name_that_a_file_can_have(tmp_path):
    name = "n" * 251 + ".txt"
    write_file(tmp_path / name, put("text"))
    assert os.listdir(tmp_path) == [name]


@pytest.mark.parametrize("overwrite", [True, False])
def test_a_device_is_not_replaced(tmp_path, overwrite):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OutputError if overwrite else OutputExistsError):
        write_file(pipe, put("text"), overwrite=overwrite)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert os.listdir(tmp_path) == ["pipe"]


@pytest.mark.parametrize("where", ["", "file/below.txt", "none/a.txt", "n" * 300, "a\0b", "file/../none/a"])
def test_places_where_no_file_can_be(tmp_path, where):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError) as caught:
        write_file(tmp_path / where, put("text"), overwrite=True)
    assert str(caught.value).isprintable()
    assert os.listdir(tmp_path) == ["file"]
