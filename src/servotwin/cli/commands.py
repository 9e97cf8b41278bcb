"""The commands: what `servotwin --help` lists."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from servotwin import __version__, plugins
from servotwin.cli.bench import bench
from servotwin.cli.catalog import catalog
from servotwin.cli.curves import curves
from servotwin.cli.doctor import doctor
from servotwin.cli.export import export
from servotwin.cli.fit import fit
from servotwin.cli.linear import linear
from servotwin.cli.log import EPILOG as LOG_EPILOG
from servotwin.cli.log import HELP as LOG_HELP
from servotwin.cli.log import log
from servotwin.cli.option_records import Commands
from servotwin.cli.paper_command import paper
from servotwin.cli.robot import robot
from servotwin.cli.simulate import simulate
from servotwin.cli.sweep import sweep
from servotwin.cli.terminal import emit, emit_help
from servotwin.cli.validate import validate
from servotwin.cli.web import web
from servotwin.cli.wire import wire

app = Commands(
    name="servotwin", add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Example: servotwin simulate hitec-hs-755hb --step 0:180 --plot run.png",
    help="The digital twin of an RC servo: from a pulse in microseconds to the torque at the horn.")


def _version(wanted: bool) -> None:
    if wanted:
        emit(f"servotwin {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def servotwin(
    context: typer.Context,
    version: Annotated[bool, typer.Option(
        "--version", is_eager=True, callback=_version, help="Print the version and exit.")] = False,
) -> None:
    """Show the help where no command is given."""
    if context.invoked_subcommand is None:
        emit_help(context)


app.command("paper", help="Reproduce the paper's figures and tables in a report.",
            epilog="Example: servotwin paper --out paper-report --force")(paper)
app.command("simulate", help="Simulate one servo under one command and one load.",
            epilog="Example: servotwin simulate hitec-hs-755hb --step 0:180 --plot run.png\n\n"
                   "Example: servotwin simulate towerpro-sg90 --step 0:60 --supply usb\n\n"
                   "Example: servotwin simulate my-servo.toml --sine 1500:200:2 --unit us --out run.csv")(simulate)
app.command("curves", help="Compute the data sheets of servos: torque, speed, current, holding, lifting, warming.",
            epilog="Example: servotwin curves towerpro-mg996r --voltage 4.8,6 --out mg996r.html\n\n"
                   "Example: servotwin curves towerpro-mg996r hitec-hs-422 --voltage 5 --lift 0.5kg --arm 10cm\n\n"
                   "Example: servotwin curves feetech-sts3215-12v --register P_Coefficient=16 --quick --loop loop.png"
            )(curves)
app.command("linear", help="Show where a servo is linear: poles, margins, Bode plots by amplitude; or find its gain.",
            epilog="Example: servotwin linear hitec-hs-755hb --load inertia=1e-3 --out hs755.html\n\n"
                   "Example: servotwin linear feetech-sts3215-12v --load inertia=5e-3 --tune --overshoot 10%")(linear)
app.command("sweep", help="Draw random parameters for a servo, simulate all, and show which of them matter.",
            epilog="Example: servotwin sweep hitec-hs-755hb --step 0:60 --vary motor.torque_constant=normal:10% "
                   "--vary electronics.deadband=uniform:4us..8us --lanes 10000 --out study --plot")(sweep)
app.command("fit", help="Find the parameters of a servo, with intervals, from its logs or a bench table.",
            epilog="Example: servotwin fit runs/ --servo hitec-hs-755hb --free output_inertia,output_torque_constant "
                   "--out my-servo.toml --report fit.html\n\n"
                   "Example: servotwin fit --table bench.csv --out my-servo.toml\n\n"
                   "Example: servotwin fit --advise --servo hitec-hs-755hb")(fit)
app.command("validate", help="Compare a servo with logs, and say how far it is off.",
            epilog="Example: servotwin validate my-servo.toml new-runs/ --max-error 3deg --report check.html")(validate)
app.command("log", help=LOG_HELP, epilog=LOG_EPILOG)(log)
app.command("doctor", help="Say why a servo buzzes, sags, overshoots, gets warm, trips or does not move; alone: look "
            "at this installation.",
            epilog="Example: servotwin doctor hitec-hs-422 --load arm=0.3kg:10cm\n\n"
                   "Example: servotwin doctor my-servo.toml run.csv\n\n"
                   "Example: servotwin doctor")(doctor)
app.command("web", help="Open the bench in a browser: turn a servo, and watch its pulses, currents and angles.",
            epilog="Example: servotwin web hitec-hs-755hb\n\n"
                   "Example: servotwin web --lesson deadband\n\n"
                   "Example: servotwin web --host 0.0.0.0 --class")(web)
app.command("wire", help="Serve servos that are not there at a serial port, where programs for real ones find them.",
            epilog="Example: servotwin wire so101 --link /tmp/so101 --keep so101.json\n\n"
                   "Example: servotwin wire --servo 1=feetech-sts3215-12v --servo 2=feetech-sts3250 --tcp 5000\n\n"
                   "Example: servotwin wire koch --link /tmp/koch --faults faults.toml")(wire)
app.add_typer(catalog, name="catalog")
app.add_typer(robot, name="robot")
app.add_typer(export, name="export")
app.add_typer(bench, name="bench")


def _checked(command: Any) -> Any:
    """Return the command of a plug-in, if one can be made of it."""
    alone = command
    if not isinstance(command, typer.Typer):
        alone = Commands()
        alone.command("alone")(command)
    typer.main.get_command(alone)
    return command


_OWN = {str(each.name) for each in app.registered_commands} | {str(each.name) for each in app.registered_groups}
for name, command in plugins.loaded("commands", _OWN, use=_checked).items():
    if isinstance(command, typer.Typer):
        app.add_typer(command, name=name)
    else:
        app.command(name)(command)
