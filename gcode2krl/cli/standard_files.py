"""Standard input, output and error where they are closed, full, or know no Unicode."""

import contextlib
import os
import sys

import click

from gcode2krl.errors import NotUnderstoodError, input_error


def reserve_standard_files() -> None:
    """Keep closed standard files' numbers from files we open; replace characters that cannot be printed."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def write_bytes(content: bytes) -> None:
    """Write to standard output; raises `NotUnderstoodError` where that fails."""
    if sys.stdout is None:
        raise closed("standard output")
    try:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise input_error(
            "output-unwritable", f"cannot write: {error.strerror}", source="standard output"
        ) from None


def closed(name: str) -> NotUnderstoodError:
    """Return the error for a standard file that is closed."""
    return input_error("output-unwritable", f"{name} is closed", "name a file", source=name)


def tell(text: str) -> None:
    """Print a line on standard error; where that is not possible, only the exit code tells."""
    with contextlib.suppress(OSError):
        click.echo(text, err=True)


def flushed() -> bool:
    """Flush standard output and error; return whether all was written, and prevent a second attempt."""
    all_written = True
    for stream in (sys.stdout, sys.stderr):
        if stream is None:
            continue
        try:
            stream.flush()
        except OSError as error:
            if stream is sys.stdout:
                all_written = False
                if not isinstance(error, BrokenPipeError):
                    tell(f"error: standard output: cannot write: {error.strerror}")
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return all_written
