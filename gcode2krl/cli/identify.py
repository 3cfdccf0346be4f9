"""``gcode2krl identify``: fits the cell to measurements; a file for each kind."""

from importlib import import_module

import click

_WHAT = ("controller", "stiffness", "sensor", "force")


class _Identify(click.Group):
    """Subcommands imported on use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_WHAT)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _WHAT:
            return None
        command: click.Command = import_module(f"gcode2krl.cli.identify_{cmd_name}").command
        return command


@click.command("identify", cls=_Identify)
def command() -> None:
    """Fit the cell to measurements: controller, stiffness, sensor, cutting force."""
