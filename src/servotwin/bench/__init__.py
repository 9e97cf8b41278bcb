"""The bench of the paper as a program: from a command voltage to the seven readings of its display.

V_i → 10-bit converter → pulse generator (16 µs steps, a frame of 16.384 ms) → servo → potentiometer → 10-bit
converter → V_i, ADC_i, V_o, ADC_o, f, q, t_a.
"""

from servotwin.bench.bench import (
    FEEDBACK_CONVERTER,
    INPUT_CONVERTER,
    Bench,
    BenchRun,
    Comparison,
    Converter,
    ModelShares,
    Reading,
    Shares,
    TableRow,
    bench_servo,
    compare,
    measured_shares,
    model_shares,
)
from servotwin.bench.control_supply import ControlSupply, run_on_one_supply
from servotwin.bench.generator import Interval, PulseGenerator, command_voltage_interval, zero_offset_interval
from servotwin.bench.load_calibration import LoadCalibration, calibrate_loads
from servotwin.bench.load_columns import Lifts, LoadTable, is_load_table, is_pattern, lifts, load_table
from servotwin.bench.standing import Standing, standing
from servotwin.bench.table_columns import (
    BenchTable,
    CurvatureTest,
    LineFit,
    TableColumn,
    TableFit,
    bench_table,
    curvature_test,
    fit_line,
    table_fits,
)
from servotwin.bench.table_rows import (
    InstrumentPair,
    RowFinding,
    TableCalibration,
    calibrate_table,
    instrument_pairs,
    row_findings,
)

__all__ = [
    "FEEDBACK_CONVERTER",
    "INPUT_CONVERTER",
    "Bench",
    "BenchRun",
    "BenchTable",
    "Comparison",
    "ControlSupply",
    "Converter",
    "CurvatureTest",
    "InstrumentPair",
    "Interval",
    "Lifts",
    "LineFit",
    "LoadCalibration",
    "LoadTable",
    "ModelShares",
    "PulseGenerator",
    "Reading",
    "RowFinding",
    "Shares",
    "Standing",
    "TableCalibration",
    "TableColumn",
    "TableFit",
    "TableRow",
    "bench_servo",
    "bench_table",
    "calibrate_loads",
    "calibrate_table",
    "command_voltage_interval",
    "compare",
    "curvature_test",
    "fit_line",
    "instrument_pairs",
    "is_load_table",
    "is_pattern",
    "lifts",
    "load_table",
    "measured_shares",
    "model_shares",
    "row_findings",
    "run_on_one_supply",
    "standing",
    "table_fits",
    "zero_offset_interval",
]
