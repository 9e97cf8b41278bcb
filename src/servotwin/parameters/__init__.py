"""Servos by their numbers: parameters with units, origin and spread, the catalog, and published data."""

from servotwin.parameters.catalog import Dataset, catalog_names, dataset_names, load_dataset, load_servo
from servotwin.parameters.groups import (
    GROUPS,
    Electronics,
    Firmware,
    Friction,
    Gear,
    Group,
    Motor,
    Potentiometer,
    Stops,
    Supply,
    Thermal,
)
from servotwin.parameters.output_file import write_file
from servotwin.parameters.registers import (
    REGISTER_FAMILIES,
    dynamixel_ax,
    dynamixel_mx,
    dynamixel_x,
    dynamixel_xl320,
    feetech_sts,
)
from servotwin.parameters.servo import KINDS, ORIGINS, Quantity, Servo, dimension_of, servo_from_values, unit_of
from servotwin.parameters.servo_file import (
    PrintedPoint,
    operating_voltages,
    printed_fact,
    printed_flags,
    printed_points,
    sheet_voltages,
)

__all__ = [
    "GROUPS", "KINDS", "ORIGINS", "REGISTER_FAMILIES", "Dataset", "Electronics", "Firmware", "Friction", "Gear",
    "Group", "Motor", "Potentiometer", "PrintedPoint", "Quantity", "Servo", "Stops", "Supply", "Thermal",
    "catalog_names", "dataset_names", "dimension_of", "dynamixel_ax", "dynamixel_mx", "dynamixel_x", "dynamixel_xl320",
    "feetech_sts",
    "load_dataset", "load_servo", "operating_voltages", "printed_fact", "printed_flags", "printed_points",
    "servo_from_values", "sheet_voltages", "unit_of", "write_file",
]
