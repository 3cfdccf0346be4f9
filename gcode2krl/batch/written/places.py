"""Where a file is, as a URI below the folder in which a run began: so a pull request finds it."""

import posixpath
import re
from dataclasses import dataclass
from urllib.parse import quote

_DRIVE = re.compile(r"[A-Za-z]:/")


@dataclass(frozen=True, slots=True)
class Places:
    """Folders with slashes: that of the parts as it was named, and the absolute one of the run."""

    folder: str = "."
    root: str = ""

    def of_part(self, name: str, source: str = "") -> str:
        """Return the path of a part, as its record names the file or else by its name."""
        if source and self.folder == ".":
            return self.below_root(source)
        return self.below_root(posixpath.join(self.folder.replace("\\", "/"), name))

    def below_root(self, path: str) -> str:
        """Return a path relative to the root, absolute where it is not below it."""
        plain = posixpath.normpath(path.replace("\\", "/"))
        root = posixpath.normpath(self.root.replace("\\", "/")) if self.root else ""
        if root and is_absolute(plain) and plain.startswith(f"{root.rstrip('/')}/"):
            return plain[len(root.rstrip("/")) + 1 :]
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
