"""TOML from a file that may be anything: bounded in size and depth before it is read."""

import re
import tomllib
from pathlib import Path
from typing import Any

LARGEST_BYTES = 16_000_000
"""Read in 7 s; it holds more than 100,000 findings and events."""
_NAME = r"(?:[\w-]+|\"[^\"\n]*\"|'[^'\n]*')"
_DEEP_KEY = re.compile(rf"(?<![\w-]){_NAME}(?:[ \t]*\.[ \t]*{_NAME}){{32}}")
"""A key of 33 names: the time of a reader grows with the square of their number."""


class NotTomlError(ValueError):
    """The file is not TOML or may not be read; the text says why, without the file's name."""


def read_bounded_toml(file: Path) -> dict[str, Any]:
    """Return the tables of a file; raises `NotTomlError`, or `OSError` where it is unreadable."""
    with file.open("rb") as stream:
        data = stream.read(LARGEST_BYTES + 1)
    if len(data) > LARGEST_BYTES:
        raise NotTomlError(f"larger than {LARGEST_BYTES / 1e6:.0f} MB")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise NotTomlError(f"byte {error.start} is not UTF-8") from None
    if _DEEP_KEY.search(text):
        raise NotTomlError("nested too deeply")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise NotTomlError("nested too deeply") from None
    except (ValueError, OverflowError) as error:  # TOMLDecodeError, and dates and numbers that are none
        raise NotTomlError((str(error).splitlines() or ["not TOML"])[0][:160]) from None
