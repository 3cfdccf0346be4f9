"""The map of the package on a small one that is built here: every figure is counted by hand."""

import ast
import sys
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "docs"))

graph = import_module("import_graph")
figures = import_module("import_graph_figures")
reading = import_module("import_graph_reading")

FILES = {
    "__init__.py": '"""House."""\n',
    "roof.py": "import house.walls.brick\nfrom house.walls import mortar, WIDTH\n\n\ndef roof():\n    pass\n",
    "walls/__init__.py": "WIDTH = 3\n",
    "walls/brick.py": (
        "from typing import TYPE_CHECKING\n"
        "from ..ground import soil\n"
        "if TYPE_CHECKING:\n"
        "    from house.walls.mortar import Mortar\n"
        "\n\n"
        "def lay():\n"
        "    from . import mortar\n"
        "    return mortar\n"
    ),
    "walls/mortar.py": "from house.walls.brick import lay\n\n\nclass Mortar:\n    '''Holds.'''\n",
    "ground.py": (
        "import os\n"
        "from importlib import import_module\n"
        "soil, _DEPTH_mm = 1, 2\n"
        "\n\n"
        "def deep():\n"
        "    return import_module('house.walls'), lambda: import_module('house.cellar.tap')\n"
    ),
    "cellar/__init__.py": "",
    "cellar/tap.py": "",
}


@pytest.fixture
def house(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        file = tmp_path / "house" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return tmp_path / "house"


def test_an_import_is_a_pair_of_modules_at_the_earliest_time(house: Path) -> None:
    found = {
        (each.importer, each.imported): each.when for each in reading.imports_of(reading.modules_of(house))
    }
    assert found == {
        ("house.roof", "house.walls.brick"): "import",
        ("house.roof", "house.walls.mortar"): "import",
        ("house.roof", "house.walls"): "import",
        ("house.walls.brick", "house.ground"): "import",
        ("house.walls.brick", "house.walls.mortar"): "function",
        ("house.walls.mortar", "house.walls.brick"): "import",
        ("house.ground", "house.walls"): "function",
        ("house.ground", "house.cellar.tap"): "function",
    }


def test_rooms_arrows_and_cycles(house: Path) -> None:
    of_house = graph.map_of(house)
    assert of_house.rooms == ["__init__", "cellar", "ground", "roof", "walls"]
    arrows = {ends: graph.count_text(count) for ends, count in of_house.arrows.items()}
    assert arrows == {
        ("ground", "cellar"): "+1f",
        ("ground", "walls"): "+1f",
        ("roof", "walls"): "3",
        ("walls", "ground"): "1",
    }
    assert of_house.floors == {"__init__": 0, "cellar": 0, "ground": 1, "walls": 1, "roof": 2}
    text = graph.report(of_house)
    assert "8 files in 5 rooms, 8 imports between files: 5 at import, 3 in functions, 0 for types" in text
    assert "cycles between rooms, when imported or run: 1\n  ground -> walls -> ground\n" in text
    assert (
        "cycles between modules, when imported or run: 1\n  house.walls.brick -> house.walls.mortar" in text
    )


def test_types_alone_close_a_cycle_of_their_own(house: Path) -> None:
    brick = house / "walls" / "brick.py"
    brick.write_text(FILES["walls/brick.py"].replace("    from . import mortar\n", "    mortar = 1\n"))
    text = graph.report(graph.map_of(house))
    assert "cycles between modules, when imported or run: 0" in text
    assert "cycles between modules, types included: 1" in text


def test_a_room_by_itself(house: Path) -> None:
    walls = graph.map_of(house, "walls")
    assert walls.rooms == ["__init__", "brick", "mortar"]
    assert set(walls.arrows) == {("brick", "mortar"), ("mortar", "brick")}
    assert "imports of other rooms: 1\n  ground 1" in graph.report(walls)
    with pytest.raises(ValueError, match="no room 'attic': name one of cellar, walls"):
        graph.map_of(house, "attic")


def test_cycles_and_floors_of_a_graph() -> None:
    known = {"a": {"b"}, "b": {"c", "a"}, "c": {"a"}, "d": {"c", "e"}, "e": set(), "f": {"g"}, "g": {"f"}}
    assert reading.cycles(known) == [["a", "b", "c"], ["f", "g"]]
    assert reading.loops(known, ["a", "b", "c"]) == [["a", "b"], ["a", "b", "c"]]
    assert reading.floors(known) == {"a": 0, "b": 0, "c": 0, "e": 0, "d": 1, "f": 0, "g": 0}
    # what is left on the stack by a finished branch is no way back
    assert reading.cycles({"a": {"b", "c"}, "b": {"d"}, "c": {"d"}, "d": set()}) == []


FIGURES = '''"""What this module
is."""

from numpy.typing import NDArray

LONGEST_mm, _MOST = 2.0, 3  # two
Floats = NDArray[float]
"""An array."""
lower = 1
T = 2


class Walls:
    """A class."""

    HEIGHT = 4

    def figures(self):
        """One line."""
        return 1  # fmt: skip


def figures():
    def inner():
        pass

    # only a comment
    return inner
'''


def test_figures_of_a_file() -> None:
    assert figures.figures(FIGURES, ast.parse(FIGURES), "house.figures") == figures.Figures(
        files=1, lines=28, code_lines=13, functions=3, classes=1, constants=2,
        fmt_skips=1, module_named=1, array_names=1,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("pass", 1),
        ("if a:\n  pass\nelif b:\n  pass\nelse:\n  pass", 3),
        ("return a if b else c", 2),
        ("return a and b and c or d", 4),
        ("for i in a:\n  while i:\n    pass\nelse:\n  pass", 4),
        ("try:\n  pass\nexcept A:\n  pass\nexcept B:\n  pass\nelse:\n  pass\nfinally:\n  pass", 4),
        ("return [i for i in a if i if b for j in i]", 5),
        ("match a:\n  case 1:\n    pass\n  case 2:\n    pass\n  case _:\n    pass", 3),
        ("match a:\n  case 1:\n    pass\n  case x if b:\n    pass", 3),
        ("assert a", 2),
        ("def g():\n  if a:\n    pass\nreturn lambda: 1", 3),
        ("with a:\n  return b", 1),
    ],
)
def test_complexity(body: str, expected: int) -> None:
    indented = "\n".join(f"  {line}" for line in body.split("\n"))
    [found] = figures.complexities(ast.parse(f"class C:\n def f(self):\n{indented}"))
    assert (found.name, found.line, found.complexity) == ("C.f", 2, expected)


def test_complex_functions_are_named(house: Path) -> None:
    branches = "\n".join(f"    if {i}:\n        pass" for i in range(15))
    (house / "ground.py").write_text(f"def deep():\n{branches}\n\n\ndef flat():\n    pass\n")
    text = graph.report(graph.map_of(house))
    assert "functions with a complexity above 15: 1\n   16  house.ground.deep (line 1)" in text
    assert [line.split()[-1] for line in text.splitlines() if line.startswith(("  ground ", "  all "))] == [
        "1",
        "1",
    ]


@pytest.mark.parametrize("ending", [".dot", ".svg", ".png"])
def test_pictures(house: Path, ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / f"graph{ending}"
    assert graph.main(["--package", str(house), "-o", str(file)]) == 0
    assert "arrows between rooms: 4" in capsys.readouterr().out
    content = file.read_bytes()
    if ending == ".dot":
        assert b'"roof" -> "walls" [label = "3"];' in content
        assert b'"ground" -> "cellar" [label = "+1f", style = dashed];' in content
    elif ending == ".svg":
        assert b"<!-- roof -->" in content
        assert content.count(b"<!-- house") == 1
    else:
        assert content.startswith(b"\x89PNG")


def test_no_package(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert graph.main(["--package", str(tmp_path)]) == 2
    assert "no __init__.py" in capsys.readouterr().err


@pytest.mark.slow
def test_the_package_itself_has_no_cycles() -> None:
    text = graph.report(graph.map_of(graph.PACKAGE))
    assert "cycles between rooms, types included: 0" in text
    assert "cycles between modules, when imported or run: 0" in text
