"""Options as records: a command takes a group of options as one dataclass, whose fields are the options; its help."""

from __future__ import annotations

import copy
import dataclasses
import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from typer.core import TyperCommand
from typer.models import OptionInfo

from servotwin.cli.terminal import emit_help

Command = Callable[..., None]
LEFT_OUT = None  # an option of a record that a command does not have


def with_records(command: Command) -> Command:
    """Return a command whose parameters that are dataclasses stand for the options that are their fields.

    The options stand in the help where the record stands among the parameters. An option that may be repeated is a
    field that is a sequence, and () unless given. A dictionary beside the record has help texts of the command's own,
    by the names of fields; `LEFT_OUT` takes an option away:
    ``Annotated[Plant, {"load": "Hung on all.", "register": LEFT_OUT}]``.

    Examples
    --------
    >>> from servotwin.cli.shared_options import Ending
    >>> def run(*, name: str, ending: Ending) -> None:
    ...     print(name, ending.force)
    >>> made = with_records(run)
    >>> list(inspect.signature(made).parameters)
    ['name', 'force', 'as_json']
    >>> made(name="elbow", force=True, as_json=False)
    elbow True
    """
    hints = get_type_hints(command, include_extras=True)
    options: list[inspect.Parameter] = []
    fields: dict[str, list[inspect.Parameter]] = {}
    records: dict[str, type] = {}
    for name, own in inspect.signature(command).parameters.items():
        hint = hints[name]
        plain, *more = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        texts = next((each for each in more if isinstance(each, dict)), {})
        kind, own_help = (plain, texts) if dataclasses.is_dataclass(plain) and isinstance(plain, type) else (None, {})
        if kind is None:
            options.append(own.replace(annotation=hints[name], kind=inspect.Parameter.KEYWORD_ONLY))
        else:
            records[name], fields[name] = kind, _options(kind, own_help)
            options += fields[name]

    @wraps(command)
    def expanded(**given: Any) -> None:
        for name, kind in records.items():
            values = {each.name: given.pop(each.name) for each in fields[name] if each.name in given}
            given[name] = kind(**{field: tuple(value or ()) if _is_repeated(kind, field) else value
                                  for field, value in values.items()})
        command(**given)

    made: Any = expanded
    del made.__wrapped__  # or its signature is taken for this one's
    made.__signature__ = inspect.Signature(options)
    made.__annotations__ = {each.name: each.annotation for each in options}
    return expanded


def _options(record: type, texts: Mapping[str, str | None]) -> list[inspect.Parameter]:
    hints, made = get_type_hints(record, include_extras=True), []
    unknown = set(texts) - set(hints)
    if unknown:
        raise TypeError(f"{record.__name__} has no option {', '.join(sorted(unknown))}")
    for field in dataclasses.fields(record):
        if field.name in texts and texts[field.name] is LEFT_OUT:
            continue
        hint = hints[field.name]
        if field.name in texts:
            hint = _with_help(hint, texts[field.name])
        default = inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default
        if _is_repeated(record, field.name):
            hint, default = _as_list(hint), None
        made.append(inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hint))
    return made


def _is_repeated(record: type, name: str) -> bool:
    return getattr(record, name, None) == ()


def _as_list(hint: Any) -> Any:
    """Return the hint of a sequence as that of a list, which alone is an option that may be repeated."""
    plain, *more = get_args(hint)
    return Annotated[(list[get_args(plain)[0]], *more)]  # type: ignore[misc]


def _with_help(hint: Any, text: str | None) -> Any:
    plain, *more = get_args(hint)
    changed = [copy.copy(each) for each in more]
    for each in changed:
        if isinstance(each, OptionInfo):
            each.help = text
    return Annotated[(plain, *changed)]


# --- `--help` with what is needed most, `--help-all` with all of it ---------------------------------------------------

_ALL = "--help-all"


def usual(*names: str) -> Callable[[Command], Command]:
    """Return what makes `--help` of a command show these options alone; its `--help-all` shows all of them.

    Parameters
    ----------
    *names : str
        As the options are typed, without dashes.
    """
    def marked(command: Command) -> Command:
        signature = inspect.signature(command)
        more = inspect.Parameter("help_all", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Annotated[
            bool, typer.Option(_ALL, is_eager=True, callback=_show_all, help="Show all options and exit.")])

        @wraps(command)
        def brief(*, help_all: bool = False, **given: Any) -> None:
            command(**given)

        made: Any = brief
        del made.__wrapped__
        made.__signature__ = signature.replace(parameters=[*signature.parameters.values(), more])
        made.__annotations__ = {each.name: each.annotation for each in made.__signature__.parameters.values()}
        made.usual = names
        return brief

    return marked


def _show_all(context: typer.Context, wanted: bool) -> None:
    if wanted:
        context.meta[_ALL] = True
        emit_help(context)
        raise typer.Exit


class Brief(TyperCommand):
    """A command whose `--help` shows what is `usual` of it."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        names = getattr(self.callback, "usual", ())
        shown = {f"--{name}" for name in names} | {"--help", _ALL}
        left_out: list[Any] = [] if not names or _ALL in ctx.meta else [
            each for each in self.get_params(ctx) if each.param_type_name == "option" and not shown & set(each.opts)]
        for option in left_out:
            option.hidden = True
        try:
            super().format_help(ctx, formatter)
        finally:
            for option in left_out:
                option.hidden = False


class Commands(typer.Typer):
    """Commands of one kind, `Brief` ones: all of them have `--help-all`."""

    def command(self, name: str | None = None, **options: Any  # type: ignore[override]
                ) -> Callable[[Command], Command]:
        """Return what adds a command."""
        def add(command: Command) -> Command:
            if not getattr(command, "usual", ()):
                options["context_settings"] = {"help_option_names": ["-h", "--help", _ALL]}
            return typer.Typer.command(self, name, cls=Brief, **options)(command)

        return add
