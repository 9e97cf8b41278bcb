"""What lasts is told about: a bar on a terminal, else a line now and then."""

import pytest

import servotwin as st
from servotwin.identification.fitting import checks
from servotwin.simulation import progress


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    plain = progress.lines
    monkeypatch.setattr(checks, "lines", lambda what: plain(what, clock=made))
    monkeypatch.setattr(progress, "lines", lambda what: plain(what, clock=made))
    return made


def test_a_fit_without_a_terminal_writes_a_line_every_ten_seconds(clock, capsys):
    with checks.shown(True) as show:
        for second in range(0, 36):
            clock.now = float(second)
            show(second / 40.0, "all logs")
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == ["fit: 25 %, all logs, about 30 s left", "fit: 50 %, all logs, about 20 s left",
                                "fit: 75 %, all logs, about 10 s left"]


def test_what_has_not_begun_tells_no_time_and_long_ones_tell_minutes(clock, capsys):
    with checks.shown(True) as show:
        for now, share in ((20.0, 0.0), (40.0, 0.1)):
            clock.now = now
            show(share, "start 1 of 3")
    assert capsys.readouterr().err.splitlines() == ["fit: 0 %, start 1 of 3",
                                                    "fit: 10 %, start 1 of 3, about 6 min left"]


def test_batches_write_the_same_lines(clock, capsys):
    with progress.shown(True, 200, "simulating") as show:
        clock.now = 12.0
        show(50)
    assert capsys.readouterr().err == "simulating: 25 %, about 36 s left\n"


def test_nothing_is_written_about_what_is_over_soon(servo, capsys):
    st.simulate(st.BoundedServo(servo), st.signals.constant(0.0, unit="deg"), duration=0.1, progress=True)
    assert capsys.readouterr() == ("", "")
