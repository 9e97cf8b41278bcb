import math

import numpy as np
import pytest

from servotwin.bench import (
    FEEDBACK_CONVERTER,
    INPUT_CONVERTER,
    Converter,
    PulseGenerator,
    command_voltage_interval,
    zero_offset_interval,
)
from servotwin.errors import InputError


def test_count_cuts_and_clamps():
    converter = Converter(bits=10, reference=2.5)
    assert [converter.count(v) for v in (-1.0, 0.0, 1.25, 2.4999, 2.5, 9.0)] == [0, 0, 512, 1023, 1023, 1023]
    assert Converter(bits=10, reference=2.5, offset=0.5).count(1.25 + 0.6 / 409.6) == 513


@pytest.mark.parametrize("bad", [{"bits": 0}, {"bits": 25}, {"bits": True}, {"bits": 10.0}, {"reference": 0.0},
                                 {"reference": math.nan}, {"offset": math.inf}])
def test_a_bad_converter_is_refused(bad):
    with pytest.raises(InputError):
        Converter(**bad)


def test_a_voltage_that_is_no_number_is_refused():
    with pytest.raises(InputError):
        INPUT_CONVERTER.count(math.nan)


def test_the_interval_of_zero_offsets_is_exactly_that(table):
    volts, widths = table["V_i_V"].tolist(), [1e-6 * t for t in table["t_a_us"].tolist()]
    interval = zero_offset_interval(volts, widths)
    assert interval == pytest.approx((-0.9616, -0.68), abs=1e-9)
    generator = PulseGenerator()
    for offset, fits in ((interval.lower - 1e-6, False), (interval.lower + 1e-6, True), (interval.middle, True),
                         (interval.upper - 1e-6, True), (interval.upper + 1e-6, False), (0.0, False)):
        converter = Converter(bits=10, reference=2.5, offset=offset)
        made = [generator.width(converter.count(v)) for v in volts]
        assert np.allclose(made, widths, rtol=0.0, atol=1e-9) == fits


def test_the_converter_of_the_bench_lies_in_the_middle(table):
    volts, widths = table["V_i_V"].tolist(), [1e-6 * t for t in table["t_a_us"].tolist()]
    assert INPUT_CONVERTER.offset == pytest.approx(zero_offset_interval(volts, widths).middle, abs=2e-3)
    assert INPUT_CONVERTER.gain == 409.6


def test_without_an_offset_the_middle_row_gets_one_step_more():
    count = Converter(bits=10, reference=2.5).count(1.425)
    assert count == 583
    assert PulseGenerator().width(count) == pytest.approx(1542e-6, abs=1e-12)
    low, high = command_voltage_interval(582)
    assert low < high < 1.425


def test_no_offset_explains_all_five_counts(table):
    volts, counts = table["V_i_V"].tolist(), [int(n) for n in table["ADC_i"].tolist()]
    for offset in np.arange(-3.0, 3.0, 0.01):
        converter = Converter(bits=10, reference=2.5, offset=float(offset))
        assert [converter.count(v) for v in volts] != counts


def test_the_feedback_converter_is_the_fitted_line(table, fits):
    line = fits["ADC_o(V_o)"].line
    assert (FEEDBACK_CONVERTER.gain, FEEDBACK_CONVERTER.offset - 0.5) == pytest.approx(
        (line.slope, line.intercept), abs=1e-2)
    for volt, count in zip(table["V_o_V"], table["ADC_o"], strict=True):
        assert abs(FEEDBACK_CONVERTER.count(float(volt)) - count) <= 1


def test_interval_refuses_what_does_not_fit():
    with pytest.raises(InputError):
        zero_offset_interval([1.0, 2.0], [1526e-6])
    with pytest.raises(InputError):
        zero_offset_interval([1.0], [1530e-6])
    assert zero_offset_interval([1.0, 1.0], [646e-6, 1526e-6]).empty
