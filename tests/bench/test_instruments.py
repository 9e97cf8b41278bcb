"""Instruments that disagree and rows that are off: what a bench table shows of itself, and how rarely it is wrong."""

import math

import numpy as np
import pytest

from servotwin.bench import bench_table, calibrate_table, instrument_pairs


def synthetic(seed, *, gain=0.0, zero=0.0, rows=None, noise=None):
    """A table of two converters and two voltmeters; gain and zero are wrong at the feedback's converter."""
    rng = np.random.default_rng(seed)
    n = rows or int(rng.integers(4, 13))
    reference, bits = float(rng.choice([2.5, 3.3, 5.0])), int(rng.choice([10, 12]))
    spread = rng.uniform(0.0, 1.0) if noise is None else noise
    share = np.sort(rng.uniform(0.15, 0.9, n))
    share[0], share[-1] = 0.15, 0.9
    v_i = reference * share
    v_o = 0.1 + 0.8 * v_i
    whole = np.floor if rng.integers(2) else np.round

    def counts(volts, wrong, shift):
        return whole(2.0**bits / reference * (1.0 + wrong) * volts + shift + rng.normal(0.0, spread, n))

    return {"command_voltage_V": np.round(v_i, 3), "command_count": counts(v_i, 0.0, 0.0),
            "feedback_voltage_V": np.round(v_o, 3), "feedback_count": counts(v_o, gain, zero)}


def disagreeing(table):
    return [pair.second for pair in instrument_pairs(bench_table(table)) if pair.disagrees_in]


@pytest.mark.long(but="up to 1 count")
@pytest.mark.parametrize("noise", [None, 0.0, 3.0], ids=["up to 1 count", "rounding alone", "3 counts"])
def test_instruments_that_agree_are_left_alone(noise):
    # the level 0.005 means 1.5 of 300; counts that are only rounded stay far below it
    false = sum(bool(disagreeing(synthetic(seed, noise=noise))) for seed in range(300))
    assert false <= 3


@pytest.mark.parametrize(("wrong", "least"), [({"gain": 0.05}, 295), ({"gain": -0.05}, 295), ({"zero": 40.0}, 295),
                                              ({"zero": -40.0}, 295)],
                         ids=["gain up", "gain down", "zero up", "zero down"])
def test_injected_errors_are_found(wrong, least):
    found = [disagreeing(synthetic(seed, rows=5 + seed % 6, **wrong)) for seed in range(300)]
    assert sum(bool(one) for one in found) >= least
    if "zero" in wrong:  # which of two gains is the wrong one is not to be known, whose zero it is is
        assert sum(one not in ([], ["ADC_o"]) for one in found) <= 3


def test_one_of_them_says_in_what(table):
    pairs = {seed: instrument_pairs(bench_table(synthetic(seed, rows=8, zero=30.0, noise=0.3))) for seed in range(20)}
    assert all(pair[1].disagrees_in == ("zero",) for pair in pairs.values())
    # the zero was moved by 30 counts, less the half count of a converter that cuts off
    assert all(pair[1].line.intercept == pytest.approx(29.75, abs=5 * pair[1].zero_error + 0.25)
               for pair in pairs.values())


def test_other_references_and_bits_are_no_disagreement():
    volts = np.linspace(0.2, 2.2, 8)
    table = {"command_voltage_V": volts, "command_count": np.round(1024 / 2.5 * volts),
             "feedback_voltage_V": 0.9 * volts, "feedback_count": np.round(4096 / 3.3 * 0.9 * volts)}
    assert disagreeing(table) == []
    table["feedback_count"] = np.round(4096 / 2.5 * 0.9 * volts)
    assert disagreeing(table) == []
    table["feedback_count"] = np.round(4096 / 2.5 * 1.04 * 0.9 * volts)
    assert disagreeing(table) == ["ADC_o"]


def test_a_reference_that_sagged_is_seen_at_one_converter_and_shared_by_two():
    v_o = np.linspace(0.2, 2.2, 6)  # round values, as a person sets them
    v_i = 0.8 * v_o + 0.1
    one = {"output_angle_deg": 80.0 * v_o, "feedback_voltage_V": v_o, "feedback_count": np.round(1024 / 4.8 * v_o)}
    assert disagreeing(one) == ["ADC_o"]
    both = {**one, "command_voltage_V": v_i, "command_count": np.round(1024 / 4.8 * v_i)}
    assert disagreeing(both) == []


def test_round_settings_are_no_steps_of_a_generator():
    from servotwin.bench.table_rows import generator_step

    def step(*widths):
        return generator_step(bench_table({"t_a_us": widths, "q_deg": range(len(widths))}).of("pulse_width")[0])

    assert step(1000, 1250, 1500, 2000) is None
    assert step(1001, 1252, 1500, 1999) is None
    assert step(646, 1078, 1526, 1974) == 16.0
    assert step(1000.5, 1100.5, 1204.5, 1300.5) == 4.0


def test_a_second_voltmeter_and_an_unknown_column_are_recognised(table):
    more = {**table, "V_o_2_mV": 1e3 * table["V_o_V"] + 30.0, "meter_V": np.round(1.03 * table["V_o_V"], 3),
            "frame": [1.0, 2.0, 3.0, 4.0, 5.0], "who": ["me"] * 5}
    found = calibrate_table(more)
    wrong = {pair.second: pair.disagrees_in for pair in found.instruments}
    assert wrong == {"ADC_i": (), "V_o 2": ("zero",), "ADC_o": ("zero", "gain"), "meter_V": ("gain",)}
    assert found.table.ignored == ("meter_V", "frame", "who")
    assert "meter_V, frame, who" in found.findings()[-1]


def test_columns_that_do_not_read_one_thing_are_told_apart(table):
    shuffled = {**table, "ADC_o": table["ADC_o"][[1, 3, 0, 4, 2]]}
    pair = calibrate_table(shuffled).instruments[1]
    assert not pair.same
    assert not pair.disagrees_in
    assert "do not read one thing" in pair.words


def test_one_slip_does_not_hide_the_disagreement(table):
    slip = {**table, "ADC_o": table["ADC_o"].copy()}
    slip["ADC_o"][1] = 530.0
    found = calibrate_table(slip)
    assert found.instruments[1].without == 1
    assert found.instruments[1].disagrees_in == ("zero", "gain")
    assert [row.row for row in found.rows if row.certain] == [1]


# --- rows

def test_a_slip_in_one_column_is_found_and_the_column_named(table):
    slip = {**table, "t_a_us": table["t_a_us"].copy()}
    slip["t_a_us"][1] = 1780.0
    row, = (one for one in calibrate_table(slip).rows if one.certain)
    assert (row.row, row.column) == (1, "t_a")
    assert row.better == pytest.approx(1078.0, abs=10.0)
    assert row.p_value < 0.05


@pytest.mark.long
def test_tables_without_errors_rarely_have_rows_that_are_off():
    certain = hints = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(5, 10))
        t_a = 16.0 * np.sort(rng.choice(np.arange(35, 155), n, replace=False)) + 6.0
        v_o = 0.12 + 7.356e-4 * t_a + rng.normal(0.0, 3e-3, n)
        v_i = (t_a + 21.5 + rng.uniform(-8.0, 8.0, n)) / 1093.0
        rows = calibrate_table({"t_a_us": t_a, "V_o_V": np.round(v_o, 3), "V_i_V": np.round(v_i, 3),
                                "q_deg": 0.1 * t_a - 64.0 + rng.normal(0.0, 0.4, n)}).rows
        certain += any(row.certain for row in rows)
        hints += any(not row.certain for row in rows)
    assert certain <= 20  # level 0.05: more than 20 of 200 by chance in 0.1 %
    assert hints <= 6


def test_a_pulse_width_of_another_frame_is_found():
    found = 0
    for seed in range(50):
        rng = np.random.default_rng(seed)
        t_a = 16.0 * np.sort(rng.choice(np.arange(35, 155), 8, replace=False)) + 6.0
        v_o = 0.12 + 7.356e-4 * t_a + rng.normal(0.0, 1e-3, 8)
        off = int(rng.integers(8))
        q = 0.1 * t_a - 64.0 + rng.normal(0.0, 0.1, 8)
        t_a[off] -= 16.0
        rows = calibrate_table({"t_a_us": t_a, "V_o_V": np.round(v_o, 3), "q_deg": q}).rows
        found += any((row.row, row.steps, row.column) == (off, 1, "t_a") for row in rows)
    assert found >= 45


def test_numbers_without_noise_give_no_findings():
    t_a = np.linspace(600.0, 2400.0, 7)
    found = calibrate_table({"t_a_us": t_a, "V_o_V": 0.1 + 7e-4 * t_a, "q_deg": 0.1 * t_a - 60.0})
    assert found.curved == ()
    assert found.rows == ()
    assert found.parameters["electronics.one_shot_slope"].value == pytest.approx(1.0 / 700.0, rel=1e-12)


# --- rounding

@pytest.mark.parametrize("gain", [100.0, 200.0, 500.0])
def test_points_on_a_line_are_known_to_the_rounding_of_both_columns(gain):
    """second = gain · first without noise: (r₂² + gain² r₁²)/12 is the variance of each point."""
    volts = np.array([0.5, 1.0, 1.5, 2.0, 2.5, 3.02])  # read to 0.01 V; counts to 1
    (pair,) = instrument_pairs(bench_table({"feedback_voltage_V": volts, "feedback_count": gain * volts}))
    variance = (1.0 + (0.01 * gain) ** 2) / 12.0
    spread = float(np.sum((volts - volts.mean()) ** 2))
    assert pair.line.slope == pytest.approx(gain, rel=1e-12)
    assert pair.gain_error == pytest.approx(math.sqrt(variance / spread), rel=1e-6)
    assert pair.zero_error == pytest.approx(math.sqrt(variance * (1.0 / 6.0 + volts.mean() ** 2 / spread)), rel=1e-6)
