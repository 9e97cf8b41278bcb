import pytest

from servotwin.bench import PulseGenerator
from servotwin.errors import InputError


def test_the_five_widths_of_the_table(table):
    generator = PulseGenerator()
    made = [1e6 * generator.width(int(n)) for n in table["ADC_i"]]
    assert made == pytest.approx(table["t_a_us"].tolist(), abs=1e-9)
    assert [generator.steps(int(n)) for n in table["ADC_i"]] == [40, 67, 95, 123, 152]


def test_frame():
    generator = PulseGenerator()
    assert generator.frame_period == pytest.approx(16.384e-3, rel=1e-15)
    assert generator.pulse_rate == pytest.approx(61.03515625, rel=1e-12)


def test_width_and_counts_are_inverse():
    generator = PulseGenerator()
    for count in range(7, 1024):
        first, last = generator.counts(generator.width(count))
        assert first <= count <= last
        assert last - first == 5 or count < 13


def test_low_counts_give_the_shortest_pulse():
    generator = PulseGenerator()
    assert generator.width(0) == generator.width(7) == generator.base > 0.0


def test_bad_values_are_refused():
    for bad in ({"step": 0.0}, {"base": -1e-6}, {"counts_per_step": 0}, {"steps_per_frame": True}):
        with pytest.raises(InputError):
            PulseGenerator(**bad)
    with pytest.raises(InputError):
        PulseGenerator().counts(1530e-6)
