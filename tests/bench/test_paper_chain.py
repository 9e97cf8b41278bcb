"""Table II through the emulated chain: firmware, pin, servo, converters, display."""

import numpy as np
import pytest

import servotwin as st
from servotwin.bench import Bench, bench_servo, compare
from servotwin.bench.emulator.plant import chain_rows, display_of
from servotwin.bench.emulator.process import harness
from servotwin.errors import BenchError


@pytest.fixture(scope="module")
def chain():
    try:
        harness()
    except BenchError as error:
        pytest.skip(str(error))
    return chain_rows(st.load_dataset("urrea-kern-table-2").columns["V_i_V"])


@pytest.fixture(scope="module")
def software():
    servo = bench_servo(st.load_servo("hitec-hs-755hb"))
    return Bench(st.PulseServo(servo)).measure(st.load_dataset("urrea-kern-table-2").columns["V_i_V"])


@pytest.mark.long
def test_emulated_rows_are_as_near_to_table_ii_as_those_of_the_bench_in_software(chain, software):
    columns = st.load_dataset("urrea-kern-table-2").columns
    ours, theirs = (np.abs(np.array(compare(rows, columns))) for rows in (chain, software))
    assert (ours <= theirs.max(axis=0) + np.array([1e-5, 1e-6, 1e-12, 0.0, 0.0])).all()


@pytest.mark.long
def test_emulated_rows_are_those_of_the_bench_in_software(chain, software):
    for ours, theirs in zip(chain, software, strict=True):
        for side in ("from_below", "from_above", "reading"):
            a, b = getattr(ours, side), getattr(theirs, side)
            assert a.output_angle == pytest.approx(b.output_angle, abs=1e-5)
            assert (a.command_count, round(1e6 * a.pulse_width)) == (b.command_count, round(1e6 * b.pulse_width))
            assert abs(a.feedback_count - b.feedback_count) <= 1  # at the edge of a count


def test_the_display_shows_the_readings(chain):
    for row in chain:
        for side, lines in zip((row.from_below, row.from_above), row.displays, strict=True):
            assert lines == display_of(side)


def test_pulses_at_the_pin_are_those_of_the_generator(chain):
    for row in chain:
        edges = np.array([rise for rise, _ in row.pulses])
        np.testing.assert_allclose(np.diff(edges), 16.384e-3, atol=0.0625e-6)
        np.testing.assert_allclose([width for _, width in row.pulses], row.reading.pulse_width, atol=0.0625e-6)
