"""Every run-time dependency is imported by the package, or pyproject.toml says what it is there for."""

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import gcode2krl
from tests.conftest import ROOT

PACKAGE = Path(gcode2krl.__file__).parent
IMPORTED_AS = {"tomli-w": "tomli_w"}

TRIANGLES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
POINTS = ((0, 0, 0), (30, 0, 0), (0, 30, 0), (0, 0, 30))


def imported():
    """Return the packages that a module of ours imports, wherever in it."""
    names = set()
    for file in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                names.add(node.module.split(".")[0])
    return names


def test_a_dependency_is_imported_or_has_a_reason():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    stated = [re.split(r"[><=!~\[; ]", each)[0] for each in tomllib.loads(text)["project"]["dependencies"]]
    used = imported()
    unused = [name for name in stated if IMPORTED_AS.get(name, name) not in used]
    with_reason = [name for name in stated if re.search(rf'"{name}[^"]*", # not imported here: \w', text)]
    assert unused == with_reason


@pytest.mark.slow
def test_a_3mf_is_read_with_lxml_and_networkx(tmp_path):
    """What those two are there for; STL and PLY need neither."""
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in POINTS)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in TRIANGLES)
    model = (
        '<?xml version="1.0"?><model unit="millimeter" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        f'<object id="1" type="model"><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object></resources>"
        '<build><item objectid="1"/></build></model>'
    )
    file = tmp_path / "stock.3mf"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
        archive.writestr("[Content_Types].xml", "<Types/>")
    program = (
        "import sys; from pathlib import Path; from gcode2krl.cutting.raw_part import load_mesh\n"
        "hidden = sys.argv[2:]\n"
        "class Hide:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in hidden: raise ModuleNotFoundError(name)\n"
        "sys.meta_path.insert(0, Hide())\n"
        "print(len(load_mesh(Path(sys.argv[1])).faces))\n"
    )

    def read(*hidden):
        command = [sys.executable, "-c", program, str(file), *hidden]
        return subprocess.run(command, capture_output=True, text=True, timeout=120)

    assert read().stdout.strip() == "4"
    for name in ("lxml", "networkx"):
        assert f"NotUnderstoodError: {file}: error: not a mesh: {name}" in read(name).stderr
