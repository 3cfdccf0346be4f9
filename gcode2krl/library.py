"""The model library: finds and reads the TOML files of ``models/``, from a checkout and from a wheel."""

import difflib
import tomllib
from pathlib import Path
from typing import Any

from gcode2krl.errors import input_error

KINDS = ("robots", "controllers", "tools", "materials", "cells")


def models_folder() -> Path:
    """Return the folder ``models/``: inside the installed package, else beside it in a checkout."""
    package = Path(__file__).resolve().parent
    inside = package / "models"
    return inside if inside.is_dir() else package.parent / "models"


def names(kind: str) -> dict[str, Path]:
    """Return model name → file for one kind (one of `KINDS`)."""
    files = sorted((models_folder() / kind).glob("*.toml"))
    return {str(read_toml(file).get("model", file.stem)): file for file in files}


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; raises `NotUnderstoodError` naming the file and line where it cannot."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(path)) from None
    except UnicodeDecodeError as error:
        raise input_error("not-utf8", f"byte {error.start} is not UTF-8", source=str(path)) from None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise input_error(
            "not-toml", str(error), "see docs/cell.md for the format", source=str(path)
        ) from None


def read_model(kind: str, model: str, beside: Path | None = None) -> dict[str, Any]:
    """Read one model by its name, or by a path ending in ``.toml`` relative to the file that names it."""
    if model.endswith(".toml"):
        return read_toml((beside or Path()) / model)
    known = names(kind)
    by_folded_name = {_fold(name): file for name, file in known.items()}
    file = by_folded_name.get(_fold(model))
    if file is None:
        near = difflib.get_close_matches(_fold(model), by_folded_name, n=1, cutoff=0.0)
        remedy = (
            f"did you mean {read_toml(by_folded_name[near[0]])['model']!r}?" if near else "see the library"
        )
        raise input_error(
            "model-unknown", f"{kind[:-1]}.model: found {model!r}, allowed: {', '.join(known)}", remedy
        )
    return read_toml(file)


def merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Return ``base`` with ``over`` laid on top, table by table."""
    merged = dict(base)
    for key, value in over.items():
        below = merged.get(key)
        both_tables = isinstance(below, dict) and isinstance(value, dict)
        merged[key] = merge(below, value) if both_tables and isinstance(below, dict) else value
    return merged


def _fold(name: str) -> str:
    return "".join(name.split()).casefold()
