"""Every run-time dependency is imported by the package, or pyproject.toml says what it is there for."""

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import gcode2krl
from tests.conftest import ROOT

PACKAGE = Path(gcode2krl.__file__).parent
IMPORTED_AS = {"tomli-w": "tomli_w", "arro3-core": "arro3"}

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


def test_a_3mf_is_read_with_its_extra(tmp_path):
    """What lxml and networkx are there for; without them one line says so, and STL and PLY need neither."""
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
        "import sys; from gcode2krl.cli.main import main\n"
        "sys.modules.update(dict.fromkeys(sys.argv[3:]))\n"
        "main(['predict', sys.argv[1], '--nominal', sys.argv[2], '-o', 'out'])\n"
    )
    (tmp_path / "part.nc").write_text(
        "G21 G90\nT1 M6\nS8000 M3\nG0 X0 Y0 Z20\nG1 Z-1 F500\nG1 X20\nG0 Z20\nM30\n"
    )

    def read(*hidden):
        command = [sys.executable, "-c", program, "part.nc", file.name, *hidden]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=tmp_path)

    done = read()
    assert done.returncode in (0, 1), done.stderr
    assert "extra-missing" not in done.stderr
    for name in ("lxml", "networkx"):
        done = read(name)
        assert done.returncode == 2
        (line,) = done.stderr.splitlines()
        assert line.startswith(
            "stock.3mf: error: a 3MF file needs packages that are not installed: the extra 3mf"
        )
        assert 'python -m pip install "lxml>=5" "networkx>=3"' in line
