"""A group of commands whose modules are imported on use: a help text that lists them needs none of them."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import click


class CommandsOnUse(click.Group):
    """Commands that stand as ``command`` in a module each.

    ``summaries`` has the first paragraph of each command's help by its name, in the order of the list;
    ``module`` is the name of a command's module, with ``{}`` for that of the command.
    """

    def __init__(self, *, summaries: Mapping[str, str], module: str, **settings: Any) -> None:
        super().__init__(**settings)
        self.summaries, self.module = summaries, module

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in their order."""
        return list(self.summaries)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command; None where there is none of that name."""
        if cmd_name not in self.summaries:
            return None
        command: click.Command = import_module(self.module.format(cmd_name.replace("-", "_"))).command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands from their summaries."""
        listed = {name: click.Command(name, help=text) for name, text in self.summaries.items()}
        _InOrder(commands=listed).format_commands(ctx, formatter)


class _InOrder(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)
