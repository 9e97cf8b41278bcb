"""The folder of a study: whole files, gone on with, never mixed with another study."""

import json
import resource
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, MissingExtraError, OutputError
from servotwin.simulation.progress import Here
from servotwin.tables import read_columns

STEP = st.signals.step(0.0, 60.0, at=0.1, unit="deg")
OPTIONS = {"duration": 0.5, "lanes": 40, "chunk": 10, "seed": 3,
           "vary": {"load.inertia": "uniform:0..2e-3", "electronics.off_state": "choice:brake,coast"}}
FILES = ["lanes-00000.csv", "lanes-00001.csv", "lanes-00002.csv", "lanes-00003.csv", "study.json", "summary.json"]


@pytest.fixture(scope="module")
def model(servo):
    return st.PulseServo(servo)


@pytest.fixture(scope="module")
def study(model):
    return st.sweep(model, STEP, **OPTIONS)


@pytest.fixture
def folder(model, tmp_path):
    st.sweep(model, STEP, directory=tmp_path / "study", **OPTIONS)
    return tmp_path / "study"


class Counting(Here):
    """An executor that counts, and may be interrupted."""

    def __init__(self, last=99):
        self.calls, self.last = 0, last

    def submit(self, work, *arguments):
        if self.calls == self.last:
            raise KeyboardInterrupt
        self.calls += 1
        return super().submit(work, *arguments)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def same(table, other):
    return list(table) == list(other) and all(
        np.array_equal(column, other[name], equal_nan=column.dtype.kind == "f") for name, column in table.items())


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_files_hold_the_table_to_the_last_bit(model, tmp_path, study, file_format):
    if file_format == "parquet":
        pytest.importorskip("pyarrow")
    found = st.sweep(model, STEP, directory=tmp_path / "study", file_format=file_format, **OPTIONS)
    assert same(found.table, study.table)
    assert names(tmp_path / "study") == [name.replace("csv", file_format) for name in FILES]
    parts = [read_columns(tmp_path / "study" / f"lanes-{k:05}.{file_format}") for k in range(4)]
    for name, column in study.table.items():
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), column, err_msg=name)


def test_study_and_summary_say_what_was_done(folder, study):
    said = json.loads((folder / "study.json").read_text())
    assert said["definition"]["seed"] == 3
    assert said["definition"]["vary"]["load.inertia"] == "uniform:0..2e-3"
    assert said["definition"]["parameters"]["motor.armature_resistance"] == pytest.approx(3.04101)
    assert said["definition"]["servotwin"] == st.__version__
    assert set(said["versions"]) == {"python", "numpy", "scipy"}
    assert len(said["sha256"]) == 64
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["metrics"]["rise_time"]["quantiles"]["0.5"] == study.quantiles()["rise_time"][0.5]
    assert {bar["name"] for bar in summary["metrics"]["overshoot"]["tornado"]} == set(OPTIONS["vary"])


def test_saving_writes_the_same_folder(folder, study, tmp_path):
    study.save(tmp_path / "saved")
    assert names(tmp_path / "saved") == names(folder)
    for name in FILES:
        assert (tmp_path / "saved" / name).read_bytes() == (folder / name).read_bytes()


def test_only_what_is_missing_is_computed(model, folder, study):
    kept = (folder / "lanes-00000.csv").stat().st_mtime_ns
    (folder / "lanes-00001.csv").unlink()
    (folder / "lanes-00003.csv").unlink()
    executor = Counting()
    found = st.sweep(model, STEP, directory=folder, resume=True, executor=executor, **OPTIONS)
    assert executor.calls == 2
    assert same(found.table, study.table)
    assert (folder / "lanes-00000.csv").stat().st_mtime_ns == kept
    assert names(folder) == FILES


def test_an_interrupt_leaves_what_is_done(model, tmp_path, study):
    with pytest.raises(KeyboardInterrupt):
        st.sweep(model, STEP, directory=tmp_path / "study", executor=Counting(last=3), **OPTIONS)
    done = names(tmp_path / "study")
    assert "summary.json" not in done
    assert len(done) < 5
    found = st.sweep(model, STEP, directory=tmp_path / "study", resume=True, **OPTIONS)
    assert same(found.table, study.table)
    assert names(tmp_path / "study") == FILES


def test_a_folder_that_is_there_is_refused_without_resume(model, folder):
    with pytest.raises(OutputError, match="not empty; resume=True"):
        st.sweep(model, STEP, directory=folder, **OPTIONS)


def test_all_that_differs_is_named(model, folder):
    with pytest.raises(OutputError, match=r"seed is 4 and was 3; .*truncate is true and was false; repeat"):
        st.sweep(model, STEP, directory=folder, resume=True, **{**OPTIONS, "seed": 4, "truncate": True})


@pytest.mark.parametrize(("change", "said"), [
    ({"seed": 4}, "seed is 4 and was 3"),
    ({"lanes": 50}, "lanes is 50 and was 40"),
    ({"duration": 0.6}, "duration is 0.6 and was"),
    ({"vary": {"load.inertia": "uniform:0..3e-3"}}, 'vary.load.inertia is "uniform:0..3e-3" and was'),
    ({"metrics": ["overshoot"]}, "metrics"),
    ({"load": st.loads.Constant(0.1)}, "load.torque"),
    ({"chunk": 20}, "chunk is 20 and was"),
    ({"truncate": True}, "truncate"),
])
def test_another_study_is_not_gone_on_with(model, folder, change, said):
    before = {name: (folder / name).read_bytes() for name in names(folder)}
    with pytest.raises(OutputError) as caught:
        st.sweep(model, STEP, directory=folder, resume=True, **{**OPTIONS, **change})
    assert "another study" in str(caught.value)
    assert said in str(caught.value)
    assert before == {name: (folder / name).read_bytes() for name in names(folder)}


@pytest.mark.parametrize("content", ["", "{", "[]", '{"definition": 3}'])
def test_a_broken_study_file_is_said(model, tmp_path, content):
    (tmp_path / "study.json").write_text(content)
    with pytest.raises(OutputError, match="holds no study"):
        st.sweep(model, STEP, directory=tmp_path, resume=True, **OPTIONS)


@pytest.mark.parametrize("content", [b"", b"lane,nothing\n1,2\n", b"\xff\xfe", b"lane\n1,2\n"])
def test_a_broken_chunk_is_said(model, folder, content):
    (folder / "lanes-00002.csv").write_bytes(content)
    with pytest.raises(InputError, match=r"lanes-00002\.csv"):
        st.sweep(model, STEP, directory=folder, resume=True, **OPTIONS)


def test_resuming_nothing_begins(model, tmp_path):
    st.sweep(model, STEP, directory=tmp_path / "study", resume=True, **OPTIONS)
    assert names(tmp_path / "study") == FILES


def test_places_that_cannot_be(model, tmp_path):
    (tmp_path / "file").write_text("")
    for place, said in ((tmp_path / "file", "is no folder"), (tmp_path / "none" / "study", "cannot be made"),
                        ("a\0b", "NUL"), (tmp_path / "file" / "study", "cannot be made")):
        with pytest.raises(OutputError, match=said):
            st.sweep(model, STEP, directory=place, **OPTIONS)
    with pytest.raises(InputError, match="csv, parquet"):
        st.sweep(model, STEP, directory=tmp_path / "study", file_format="xlsx", **OPTIONS)


def test_parquet_without_the_extra_is_one_line(model, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"servotwin\[sweep\]"):
        st.sweep(model, STEP, directory=tmp_path / "study", file_format="parquet", **OPTIONS)
    assert names(tmp_path) == []


FULL = """
    import resource, sys
    import servotwin as st
    from servotwin.errors import OutputError

    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    options = {"duration": 0.5, "vary": {"load.inertia": "uniform:0..2e-3"}, "lanes": 900, "chunk": 300}
    st.sweep(model, st.signals.step(0.0, 60.0, at=0.1, unit="deg"), **options)  # what is compiled is kept
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
    try:
        st.sweep(model, st.signals.step(0.0, 60.0, at=0.1, unit="deg"), directory="study", **options)
    except OutputError as error:
        print(error)
"""


@pytest.mark.long
@pytest.mark.skipif(not hasattr(resource, "RLIMIT_FSIZE"), reason="no limit of file sizes here")
def test_a_file_that_cannot_be_written_is_one_line(model, tmp_path):
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(FULL), "20000"], cwd=tmp_path, capture_output=True,
                          text=True, check=False)
    assert "study/lanes-00000.csv cannot be written (File too large)" in done.stdout, done.stderr
    assert "--resume" in done.stdout
    assert names(tmp_path / "study") == ["study.json"]
    vary = {"load.inertia": "uniform:0..2e-3"}
    st.sweep(model, STEP, duration=0.5, vary=vary, lanes=900, chunk=300, directory=tmp_path / "study", resume=True)
    assert len(names(tmp_path / "study")) == 5


@pytest.fixture
def small_disk(tmp_path):
    place = tmp_path / "disk"
    place.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)], capture_output=True,
                          check=False)
    if done.returncode != 0:
        pytest.skip("this user cannot mount a small disk")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_keeps_what_is_finished(model, small_disk):
    options = {"duration": 0.5, "vary": {"load.inertia": "uniform:0..2e-3"}, "lanes": 900, "chunk": 100}
    with pytest.raises(OutputError, match=r"No space left on device.*--resume"):
        st.sweep(model, STEP, directory=small_disk, **options)
    done = names(small_disk)
    assert "lanes-00000.csv" in done
    assert not any(name.startswith(".") for name in done)
    assert len(read_columns(small_disk / "lanes-00000.csv")["lane"]) == 100
    subprocess.run(["mount", "-o", "remount,size=1m", str(small_disk)], check=True)
    again = st.sweep(model, STEP, directory=small_disk, resume=True, **options)
    assert same(again.table, st.sweep(model, STEP, **options).table)


def test_a_recorded_load_belongs_to_the_definition(model, tmp_path):
    options = {"duration": 0.3, "lanes": 4, "vary": {"motor.torque_constant": "normal:2%"}}
    first, second = (st.loads.Recorded([0.0, 0.3], [0.0, torque]) for torque in (0.1, 0.2))
    st.sweep(model, STEP, load=first, directory=tmp_path / "study", **options)
    said = json.loads((tmp_path / "study" / "study.json").read_text())["definition"]["load"]
    assert said["recorded"][0]["torque"] == [0.0, 0.1]
    with pytest.raises(OutputError, match=r"another study: load\.recorded"):
        st.sweep(model, STEP, load=second, directory=tmp_path / "study", resume=True, **options)
