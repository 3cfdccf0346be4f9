"""Where a file is, as a URI below the folder in which a run began: so a pull request finds it."""

import posixpath
import re
from urllib.parse import quote

_DRIVE = re.compile(r"[A-Za-z]:/")


def below_root(path: str, root: str = "") -> str:
    """Return a path with slashes, relative to an absolute folder where it is below it."""
    plain = posixpath.normpath(path.replace("\\", "/"))
    above = posixpath.normpath(root.replace("\\", "/")).rstrip("/") if root else ""
    if root and is_absolute(plain) and plain.startswith(f"{above}/"):
        return plain[len(above) + 1 :]
    return plain


def is_absolute(path: str) -> bool:
    """Tell whether a path with slashes begins at a root or a drive."""
    return path.startswith("/") or _DRIVE.match(path) is not None


def uri(path: str) -> str:
    """Return a path with slashes as a relative reference, or as a ``file:`` URI where it is absolute."""
    if not is_absolute(path):
        return quoted(path)
    drive = "" if path.startswith("/") else "/"
    return f"file://{drive}{quoted(path, safe='/:')}"


def quoted(path: str, safe: str = "/") -> str:
    """Return a path as it stands in a URI; a name that is no UTF-8 keeps its bytes."""
    try:
        return quote(path.encode("utf-8", "surrogateescape"), safe)
    except UnicodeEncodeError:
        return quote(path.encode("utf-8", "replace"), safe)
