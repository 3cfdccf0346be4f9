"""The map of the code names what exists: files, functions in them, modules and their names."""

import ast
import importlib
import re
from functools import cache

from gcode2krl import load_cell
from gcode2krl.effects import library, parse
from tests.conftest import ROOT

DOCUMENTS = [ROOT / "docs" / "code.md", ROOT / "CONTRIBUTING.md"]
PACKAGE = ROOT / "gcode2krl"
OF_A_USER = "my_effects/"
"""Folder of files that the documents tell a reader to write."""


def found_in(pattern):
    """Yield the document's name and each match of a pattern in it, once."""
    for document in DOCUMENTS:
        for match in dict.fromkeys(re.findall(pattern, document.read_text(encoding="utf-8"))):
            yield document.name, match


def place_of(file):
    """Return where a file stands: below the package, or below the repository."""
    places = [PACKAGE / file, ROOT / file]
    return next((place for place in places if place.is_file()), None)


@cache
def names_in(path):
    """Return the functions, classes, methods and assigned names of a file, of one in C its functions."""
    names = set()
    if path.suffix in (".c", ".h"):
        return set(re.findall(r"^\w[\w *]*?(\w+)\(", path.read_text(encoding="utf-8"), re.M))
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)}
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names.add(node.name)
        if isinstance(node, ast.Assign):
            names |= {
                each.id for target in node.targets for each in ast.walk(target) if isinstance(each, ast.Name)
            }
    return names


def resolved(dotted):
    """Return whether ``package.module.name`` can be imported or is a name of what can."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        try:
            value = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            value = getattr(value, part, None)
        return value is not None
    return False


FILES = [case for case in found_in(r"[\w./-]+\.(?:py|[ch])\b") if not case[1].startswith(OF_A_USER)]
NAMED = list(found_in(r"([\w./-]+\.(?:py|[ch])):([A-Za-z_][\w.]*)"))
DOTTED = list(found_in(r"`(gcode2krl(?:\.\w+)+)`"))
FOLDERS = list(found_in(r"`([\w./-]+/)`"))


def test_what_is_named_exists():
    """Files, names in their files, dotted names, folders."""
    assert min(len(FILES), len(NAMED)) > 80
    missing = [case for case in FILES if not place_of(case[1])]
    for document, (file, name) in NAMED:
        if place_of(file) is None or name.rstrip(".") not in names_in(place_of(file)):
            missing.append((document, f"{file}:{name}"))
    missing += [case for case in DOTTED if not resolved(case[1])]
    made = (OF_A_USER, "prediction/", "run", "site/")  # by a user, by a command
    for document, folder in FOLDERS:
        if not (folder.startswith(made) or (PACKAGE / folder).is_dir() or (ROOT / folder).is_dir()):
            missing.append((document, folder))
    assert missing == []


def test_every_room_is_in_the_table():
    """A room that nobody described is one that nobody finds."""
    text = DOCUMENTS[0].read_text(encoding="utf-8")
    rooms = {f"{place.name}/" for place in PACKAGE.iterdir() if (place / "__init__.py").is_file()}
    rooms |= {place.name for place in PACKAGE.glob("*.py") if not place.name.startswith("__")}
    gap = {f"gap/{place.name}/" for place in (PACKAGE / "gap").iterdir() if (place / "__init__.py").is_file()}
    rows = "".join(line for line in text.splitlines() if line.startswith("| `"))
    assert len(rooms) > 20
    assert len(gap) > 3
    assert {room for room in rooms | gap if f"`{room}`" not in rows} == set()


def test_the_effect_of_the_guide_can_be_used_as_it_stands(tmp_path):
    text = DOCUMENTS[1].read_text(encoding="utf-8")
    (source,) = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    (tmp_path / "bearing_ripple.py").write_text(source, encoding="utf-8")
    (words,) = re.findall(r"--effect (bearing_ripple\S+)", text)
    applied = parse(words, library([tmp_path]), load_cell())
    assert (applied.target, applied["ripple_deg"]) == ("A2", 0.01)
