"""What the commands that run a servo ask for in the same words; the defaults stand in each command's signature.

An option whose help differs from command to command (unit, model, load, seed ...) is declared by the command itself.
"""

from pathlib import Path
from typing import Annotated

import typer

COMMAND, PLANT, OUTPUT = "Command (one of)", "Servo and load", "Run and output"  # panels of the help

ServoArgument = Annotated[str, typer.Argument(help="Id in the catalog, or path of a servo file (.toml).")]
StepOption = Annotated[str | None, typer.Option(
    metavar="BEFORE:AFTER", help="Step, at --at.", rich_help_panel=COMMAND)]
RampOption = Annotated[str | None, typer.Option(
    metavar="BEFORE:AFTER", help="Ramp from --at on, in --over seconds.", rich_help_panel=COMMAND)]
SineOption = Annotated[str | None, typer.Option(
    metavar="MEAN:AMPLITUDE:HZ", help="Sine.", rich_help_panel=COMMAND)]
ChirpOption = Annotated[str | None, typer.Option(
    metavar="MEAN:AMPLITUDE:HZ:HZ", help="Sine whose frequency goes from one to the other during the run.",
    rich_help_panel=COMMAND)]
PrbsOption = Annotated[str | None, typer.Option(
    metavar="LOW:HIGH:SECONDS", help="Pseudo-random sequence of two values, with the time of a bit.",
    rich_help_panel=COMMAND)]
ConstantOption = Annotated[str | None, typer.Option(
    metavar="VALUE", help="The same all the time.", rich_help_panel=COMMAND)]
PulsesOption = Annotated[Path | None, typer.Option(
    metavar="FILE.csv", help="Pulses one by one: columns time_s (rising edge), pulse_width_us.",
    rich_help_panel=COMMAND)]
CommandOption = Annotated[Path | None, typer.Option(
    metavar="FILE.csv", help="Samples: time_s and pulse_width_us, command_angle_deg or command_voltage_V.",
    rich_help_panel=COMMAND)]
AtOption = Annotated[float | None, typer.Option(
    metavar="SECONDS", help="When a step or ramp begins (default 0.1).", rich_help_panel=COMMAND)]
OverOption = Annotated[float | None, typer.Option(
    metavar="SECONDS", help="How long a ramp takes.", rich_help_panel=COMMAND)]
HoldOption = Annotated[str | None, typer.Option(
    metavar="HOW", help="Between samples of --command: previous (default) or linear.",
    rich_help_panel=COMMAND)]
ColumnOption = Annotated[str | None, typer.Option(
    metavar="NAME", help="Which column of --command, where it has several commands.",
    rich_help_panel=COMMAND)]
DurationOption = Annotated[float, typer.Option(
    metavar="SECONDS", help="Time to simulate.", rich_help_panel=OUTPUT)]
JsonOption = Annotated[bool, typer.Option(
    "--json", help="Print the summary as JSON, in SI.", rich_help_panel=OUTPUT)]
