"""Table of the commands, and the group that imports a command when it is called or its help is requested."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup

if TYPE_CHECKING:
    from typer._click import Command, Context, HelpFormatter, Parameter

COMMANDS: dict[str, tuple[str, str]] = {
    "demo": ("Start", "demo.demo"),
    "rig": ("Start", "demo.rig"),
    "new structure": ("Start", "new.structure"),
    "new external": ("Start", "new.external"),
    "new site": ("Start", "new.site"),
    "import": ("Data", "data.importing.import_"),
    "structure": ("Data", "data.structure.structure"),
    "identify": ("Data", "data.identify.identify"),
    "diagnose": ("Data", "data.diagnose.diagnose"),
    "response": ("Data", "data.response.response"),
    "bodies": ("Data", "data.bodies"),
    "report": ("Data", "data.report"),
    "view": ("Data", "data.view"),
    "log info": ("Logs", "logs.info"),
    "log export": ("Logs", "logs.export"),
    "log expand": ("Logs", "logs.expand"),
    "repair": ("Logs", "logs.repair"),
    "replay": ("Logs", "logs.replay"),
    "reanalyse": ("Logs", "logs.reanalyse"),
    "devices": ("Site", "site.devices"),
    "settings": ("Site", "site.settings"),
    "check": ("Site", "site.check"),
    "run": ("Site", "site.run"),
    "prove": ("Site", "site.prove"),
    "health": ("Operation", "operation.health"),
    "history": ("Operation", "operation.history"),
    "fleet": ("Operation", "operation.fleet"),
    "acknowledge": ("Operation", "operation.acknowledge"),
    "accept": ("Operation", "operation.accept"),
    "install-service": ("Operation", "operation.install_service"),
}
"""Section of the help, and module in `monitor.cli`, of each command. Its function is named as the module."""

GROUPS = {"log": "Inspect and export logs.", "new": "Write commented files to begin with."}


class CommandGroup(TyperGroup):
    """Commands of the table, or those of the table that begin with the name of the group."""

    def __init__(self, *, name: str | None = None, **attributes: Any) -> None:  # noqa: ANN401 - as typer has them
        super().__init__(name=name, **attributes)
        self._prefix = f"{name} " if name else ""
        self._paths = [path for path in COMMANDS if path.startswith(self._prefix)]
        names: dict[str, Any] = dict.fromkeys(p.removeprefix(self._prefix).partition(" ")[0] for p in self._paths)
        self.commands = names

    def get_params(self, ctx: Context) -> list[Parameter]:
        """Return the options, all flags; an absent one is False: typer imports pydantic to convert None."""
        found = super().get_params(ctx)
        for parameter in found:
            parameter.default = False if parameter.default is None else parameter.default
        return found

    def get_command(self, ctx: Context, cmd_name: str) -> Command | None:
        """Return a command or a group, None if there is none of this name."""
        if cmd_name not in self.commands:
            return None
        if cmd_name in GROUPS:
            return CommandGroup(
                name=cmd_name, help=GROUPS[cmd_name], no_args_is_help=True, rich_markup_mode=self.rich_markup_mode
            )
        return command(self._prefix + cmd_name)

    def resolve_command(self, ctx: Context, args: list[str]) -> tuple[str | None, Command | None, list[str]]:
        """Return the command named first; the error of an unknown one names similar commands of all groups."""
        name = args[0]
        if name not in self.commands and not name.startswith("-") and not ctx.resilient_parsing:
            paths = {path.rpartition(" ")[2]: path for path in COMMANDS} | {group: group for group in GROUPS}
            near = [name] if name in paths else difflib.get_close_matches(name, paths)
            similar = ", ".join(f"'modalwatch {paths[word]}'" for word in near)
            ctx.fail(f"No such command {name!r}." + f" Did you mean {similar}?" * bool(near))
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write the commands by section, a line each."""
        sections: dict[str, list[tuple[str, str]]] = {}
        width = max(map(len, self._paths))
        for path in self._paths:
            first_line, *_ = (inspect.getdoc(command_function(path)) or "").splitlines()
            sections.setdefault(COMMANDS[path][0], []).append((path.ljust(width), first_line))
        for section, rows in sections.items():
            with formatter.section(section):
                formatter.write_dl(rows)


class _Command(TyperCommand):
    """Command with an example at the end of its help, and arguments without the types of Python."""

    def format_options(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write arguments and options; typer adds ` <path>`, ` <list[Path]>` to the name of an argument."""
        arguments, options = list[tuple[str, str]](), list[tuple[str, str]]()
        for parameter in self.get_params(ctx):
            name, text = parameter.get_help_record(ctx) or ("", "")
            if name and isinstance(parameter, TyperArgument):
                arguments.append((name.partition(" <")[0], text))
            elif name:
                options.append((name, text))
        for title, rows in (("Arguments", arguments), ("Options", options)):
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def format_epilog(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write the example, each command line unbroken."""
        with formatter.section("Example"):
            for line in (self.epilog or "").splitlines():
                formatter.write(f"{'':>{formatter.current_indent}}{line}\n")


def command_function(path: str) -> Callable[..., int]:
    """Import the function of a command."""
    module = import_module(f"monitor.cli.{COMMANDS[path][1]}")
    function: Callable[..., int] = getattr(module, module.__name__.rpartition(".")[2])
    return function


def command(path: str) -> TyperCommand:
    """Return a command; the example at the end of its docstring is written at the end of its help."""
    function = command_function(path)
    text, _, example = (inspect.getdoc(function) or "").partition("\n\nExample:\n")
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    app.command(path.rpartition(" ")[2], cls=_Command, help=text, epilog=example)(function)
    built = typer.main.get_command(app)
    assert isinstance(built, TyperCommand)
    return built
