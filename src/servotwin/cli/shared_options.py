"""What the commands that run a servo ask for in the same words; the defaults stand in each command's signature.

An option whose help differs from command to command (unit, model, load, seed ...) is declared by the command itself.
"""

from pathlib import Path
from typing import Annotated

import typer

COMMAND, PLANT, OUTPUT = "Command (one of)", "Servo and load", "Run and output"  # panels of the help

ServoArgument = Annotated[str, typer.Argument(help="Catalog id, or path of a servo file (.toml).")]
StepOption = Annotated[str | None, typer.Option(
    metavar="BEFORE:AFTER", help="Step at time --at.", rich_help_panel=COMMAND)]
RampOption = Annotated[str | None, typer.Option(
    metavar="BEFORE:AFTER", help="Ramp that starts at --at and takes --over seconds.", rich_help_panel=COMMAND)]
SineOption = Annotated[str | None, typer.Option(
    metavar="MEAN:AMPLITUDE:HZ", help="Sine.", rich_help_panel=COMMAND)]
ChirpOption = Annotated[str | None, typer.Option(
    metavar="MEAN:AMPLITUDE:HZ:HZ", help="Sine whose frequency changes from the first to the second during the run.",
    rich_help_panel=COMMAND)]
PrbsOption = Annotated[str | None, typer.Option(
    metavar="LOW:HIGH:SECONDS", help="Pseudo-random sequence of two values, with the bit time.",
    rich_help_panel=COMMAND)]
ConstantOption = Annotated[str | None, typer.Option(
    metavar="VALUE", help="Constant value.", rich_help_panel=COMMAND)]
PulsesOption = Annotated[Path | None, typer.Option(
    metavar="FILE.csv", help="Individual pulses: columns time_s (rising edge), pulse_width_us.",
    rich_help_panel=COMMAND)]
CommandOption = Annotated[Path | None, typer.Option(
    metavar="FILE.csv", help="Samples: columns time_s and pulse_width_us, command_angle_deg or command_voltage_V.",
    rich_help_panel=COMMAND)]
AtOption = Annotated[float | None, typer.Option(
    metavar="SECONDS", help="Start time of a step or ramp (default 0.1).", rich_help_panel=COMMAND)]
OverOption = Annotated[float | None, typer.Option(
    metavar="SECONDS", help="Duration of a ramp.", rich_help_panel=COMMAND)]
HoldOption = Annotated[str | None, typer.Option(
    metavar="HOW", help="Between samples of --command: previous (default) or linear.",
    rich_help_panel=COMMAND)]
ColumnOption = Annotated[str | None, typer.Option(
    metavar="NAME", help="Column of --command to use, if it has several commands.",
    rich_help_panel=COMMAND)]
DurationOption = Annotated[float, typer.Option(
    metavar="SECONDS", help="Time to simulate.", rich_help_panel=OUTPUT)]
RegisterOption = Annotated[list[str] | None, typer.Option(
    metavar="NAME=VALUE", help="Write a register of a bus servo (Feetech STS, Dynamixel), such as P_Coefficient=16, or "
    "a set: lerobot, lerobot-gripper; repeatable, or with commas.", rich_help_panel=PLANT)]
LogRegisterOption = Annotated[list[str] | None, typer.Option(
    "--register", metavar="NAME=VALUE", help="Registers that the bus servo had (Feetech STS, Dynamixel), such as "
    "P_Coefficient=16, or a set: lerobot, lerobot-gripper; repeatable, or with commas. Of datasets of an SO-100 or "
    "SO-101 lerobot is assumed unless given.", rich_help_panel="Logs and servo")]
SUPPLY_FORM = "VOLTS[:OHMS][:AMPERES]"
SUPPLY_HELP = "usb (5 V, 0.5 A), or a voltage with resistance and limit of current, such as 12V:0.1ohm or 5V:0.5A"
SupplyOption = Annotated[str | None, typer.Option(
    metavar=SUPPLY_FORM, help=f"Supply of the servo: {SUPPLY_HELP} (default: its own).", rich_help_panel=PLANT)]
LogSupplyOption = Annotated[str | None, typer.Option(
    "--supply", metavar=SUPPLY_FORM, help=f"Supply that the servo had: {SUPPLY_HELP} (default: its own); a voltage "
    "that a log has beside it comes before.", rich_help_panel="Logs and servo")]
SchedulerOption = Annotated[str | None, typer.Option(
    metavar="ADDRESS", help="Run on the workers of a dask scheduler, such as tcp://host:8786.", rich_help_panel=OUTPUT)]
_ACCURACY = typer.Option(
    metavar="RADIANS", help="Error that an angle may have where a motion is integrated, from 1e-13 to 1e-4 rad.",
    rich_help_panel=OUTPUT)
AccuracyOption = Annotated[float, _ACCURACY]
UsualAccuracyOption = Annotated[float | None, _ACCURACY]
JsonOption = Annotated[bool, typer.Option(
    "--json", help="Print the summary as JSON, in SI units.", rich_help_panel=OUTPUT)]
