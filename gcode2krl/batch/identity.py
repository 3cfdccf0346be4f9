"""What a result depends on: the bytes of the part, the cell, the options, and the program itself."""

import hashlib
import json
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from gcode2krl.cell.library import models_folder
from gcode2krl.compiled.core import core_digest
from gcode2krl.version import __version__

_FORMAT = 1
"""Of an entry of the cache; a change of it lets all earlier entries go."""
_RECKONING = ("numpy", "scipy", "trimesh", "manifold3d")
"""Packages whose versions may decide over the last digit."""
_MADE = frozenset(["__pycache__", "built"])
"""Folders of what is made from the sources."""


@cache
def program_digest() -> str:
    """Return what tells one state of this program from another: version, files, core, packages, processor.

    The version alone would not do in a source tree, where the files change below it.
    """
    digest = hashlib.sha256(f"{__version__} {core_digest()} {platform.machine()}".encode())
    for name in _RECKONING:
        digest.update(f"{name} {_version_of(name)}\n".encode())
    package = Path(__file__).resolve().parents[1]
    for folder in (package, models_folder()):
        for file in sorted(folder.rglob("*")):
            if file.is_file() and not _MADE.intersection(file.parts):
                digest.update(file.relative_to(folder).as_posix().encode() + b"\0")
                digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def key_of(input_sha256: str, cell_sha256: str, settings: Mapping[str, Any]) -> str:
    """Return the name of an entry; ``settings`` are the options and names that its files depend on."""
    stated = {
        "format": _FORMAT,
        "program": program_digest(),
        "input": input_sha256,
        "cell": cell_sha256,
        "settings": dict(settings),
    }
    return hashlib.sha256(json.dumps(stated, sort_keys=True, default=str).encode()).hexdigest()


def _version_of(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
