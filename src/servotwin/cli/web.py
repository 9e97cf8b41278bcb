"""`servotwin web`: the bench in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import usual, with_records
from servotwin.cli.terminal import emit, emit_json
from servotwin.errors import InputError

if TYPE_CHECKING:
    from servotwin.web.live import Scene
    from servotwin.web.server.serve import Links

_MOST_PORT = 65535


@usual("port", "host", "class", "lesson", "scene", "export")
@with_records
def web(
    *,
    servo: Annotated[str | None, typer.Argument(
        metavar="[SERVO]", help="Catalog id, or path of a servo file (.toml); the paper's servo, pulses beside their "
        "mean, unless given.")] = None,
    port: Annotated[int, typer.Option(metavar="PORT", help="Where to listen; 0 for any that is free.")] = 8000,
    host: Annotated[str, typer.Option(
        metavar="ADDRESS", help="Address to listen at; others can reach the page only if you give one, such as "
        "0.0.0.0.")] = "127.0.0.1",
    classroom: Annotated[bool, typer.Option(
        "--class", help="One bench that the teacher steers and up to 40 watch, with a code. Wants --host.")] = False,
    scene: Annotated[Path | None, typer.Option(
        metavar="FILE.toml", help="A bench that was saved on the page.")] = None,
    lesson: Annotated[str | None, typer.Option(metavar="NAME", help="Begin with a lesson, such as deadband.")] = None,
    export: Annotated[Path | None, typer.Option(
        metavar="FILE.html", help="Write the bench as one file instead, which computes in any browser, without a "
        "server or a network. Wants clang and lld, or the package ziglang.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that exists.")] = False,
    browser: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = True,
    as_json: shared.JsonOption = False,
) -> None:
    """Serve the page until Ctrl-C, or write it as one file."""
    shown = _first(servo, scene, lesson)
    if export is not None:
        _export(shown, export, force=force, as_json=as_json)
        return
    from servotwin.web.server.serve import serve

    _check(port, host, classroom=classroom)

    def ready(links: Links) -> None:
        if as_json:
            emit_json(links._asdict())
        else:
            emit(f"the bench is at {links.page}  (Ctrl-C ends it)" if links.teacher is None else
                 f"you teach at {links.teacher}\nothers watch at {links.page} with the code {links.code}")
        if browser and not as_json:
            _open(links.teacher or links.page)

    serve(shown, host=host, port=port, classroom=classroom, ready=ready)


def _export(first: Scene, path: Path, *, force: bool, as_json: bool) -> None:
    """Write the bench as one file."""
    from servotwin.cli.output_files import Target, check_targets, staged
    from servotwin.web.alone.page import page, sizes

    target = Target(option="--export", path=path, endings=(".html", ".htm"))
    check_targets([target], force=force)
    text = page(first)
    with staged([target], force=force) as (draft,):
        draft.write_text(text, encoding="utf-8")
    if as_json:
        emit_json({"file": str(path), "bytes": sizes(text)})
    else:
        size = sizes(text)["page"] / 1000
        emit(f"the bench is in {path}, {size:.0f} kB: open it in a browser, or put it on any server")


def _check(port: int, host: str, *, classroom: bool) -> None:
    if not 0 <= port <= _MOST_PORT:
        raise InputError("--port", got=port, allowed=f"0 to {_MOST_PORT}")
    if classroom and host in ("127.0.0.1", "localhost", "::1"):
        raise InputError("--class", got=f"--host {host}",
                         allowed="--host with an address that others reach, such as 0.0.0.0")


def _first(servo: str | None, scene: Path | None, lesson: str | None) -> Scene:
    """Return the bench that the page begins with."""
    from servotwin.parameters.catalog import catalog_names, load_servo
    from servotwin.parameters.servo_file import servo_text
    from servotwin.web.live import Scene, SceneServo, read_scene

    given = [name for name, value in (("SERVO", servo), ("--scene", scene), ("--lesson", lesson)) if value is not None]
    if len(given) > 1:
        raise InputError(" and ".join(given), allowed="one of them")
    if lesson is not None:
        from servotwin.web.lessons.lessons import lesson as named

        return named(lesson).scene
    if scene is not None:
        try:
            return read_scene(scene.read_text("utf-8"))
        except UnicodeDecodeError:
            raise InputError(f"{scene}", got="no UTF-8 text", allowed="a bench that was saved on the page") from None
    if servo is None:
        from servotwin.web.server.serve import first_scene

        return first_scene()
    if servo in catalog_names():
        found = Scene(servos=(SceneServo(id=servo),))
    else:
        found = Scene(servos=(SceneServo(file=servo_text(load_servo(servo))),))
    found.servos[0].built()
    return found


def _open(link: str) -> None:
    import os
    import sys
    import webbrowser

    if sys.platform in ("darwin", "win32") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(link)
