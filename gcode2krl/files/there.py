"""Whether something lies at a path, whatever text the path is made of."""

from collections.abc import Callable
from pathlib import Path


def is_there(path: str | Path, asks: Callable[[Path], bool] = Path.is_file) -> bool:
    """Tell whether a file, or what is asked for, lies at a path.

    A text that no path can have leads nowhere: one of 400 letters, or one with a zero byte.
    """
    try:
        return asks(Path(path))
    except (OSError, ValueError):
        return False
