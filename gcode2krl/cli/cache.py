"""``gcode2krl cache``: what a batch has computed before, and the options that say where it is kept."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples

if TYPE_CHECKING:
    from gcode2krl.batch.cache import Cache

_GIGABYTE = 1e9
_FOLDER = click.option(
    "--cache",
    "cache_folder",
    type=click.Path(),
    metavar="FOLDER",
    help="Folder of the cache; default: GCODE2KRL_CACHE, or the user's.",
)


def cache_options(function: Any) -> Any:
    """Add --no-cache, --cache and --cache-size to a command."""
    size = click.option(
        "--cache-size",
        "cache_gb",
        type=click.FloatRange(min=0.0),
        default=2.0,
        show_default=True,
        metavar="GB",
        help="What was used longest ago goes first.",
    )
    none = click.option("--no-cache", is_flag=True, help="Compute everything, keep nothing.")
    return none(_FOLDER(size(function)))


def chosen_cache(folder: str | None, gigabytes: float = 0.0) -> "Cache":
    """Return the cache of a command."""
    from gcode2krl.batch.cache import Cache, default_folder

    return Cache(default_folder() if folder is None else Path(folder), int(gigabytes * _GIGABYTE))


@click.group("cache", epilog=examples("gcode2krl cache show", "gcode2krl cache clear"))
def command() -> None:
    """What a batch has computed before: show, clear."""


@command.command("show", epilog=examples("gcode2krl cache show"))
@_FOLDER
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def show(cache_folder: str | None, as_json: bool) -> None:
    """Print the folder, the number of its entries and their size."""
    cache = chosen_cache(cache_folder)
    sizes = [about.st_size for _, about in cache.entries()]
    console = Console(as_json=as_json)
    if as_json:
        from gcode2krl.result import record_of

        figures = {"folder": str(cache.folder), "entries": len(sizes), "cache_bytes": sum(sizes)}
        console.json(record_of("cache show", figures))
    console.say(f"{cache.folder}: {len(sizes):,} entries, {sum(sizes) / 1e6:,.1f} MB")


@command.command("clear", epilog=examples("gcode2krl cache clear"))
@_FOLDER
def clear(cache_folder: str | None) -> None:
    """Remove all entries; the next batch computes everything."""
    cache = chosen_cache(cache_folder)
    Console().say(f"{cache.folder}: {cache.clear() / 1e6:,.1f} MB removed")
