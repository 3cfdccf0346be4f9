"""Write ``rs274.json``: where LinuxCNC's ``rs274`` leads the programs of this folder that are LinuxCNC's.

    python tests/reference/posts/make.py            # or: make.py /path/to/rs274

A program that ``rs274`` refuses has its message instead of its moves. The interpreter and its canonical calls
are those of ``tests/reference/rs274/make.py``.
"""

import importlib.util
import json
import shutil
import sys
import tempfile
import tomllib
from pathlib import Path
from types import ModuleType

HERE = Path(__file__).resolve().parent


def _maker() -> ModuleType:
    """Return the module that runs ``rs274``; its file has the name of this one."""
    spec = importlib.util.spec_from_file_location("rs274_make", HERE.parent / "rs274" / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.HERE = HERE  # type: ignore[attr-defined]  # its tool table is that of this folder
    return module


def main() -> None:
    """Write ``rs274.json``."""
    binary = sys.argv[1] if len(sys.argv) > 1 else shutil.which("rs274")
    if not binary:
        sys.exit("rs274 not found: apt-get install linuxcnc-uspace")
    maker = _maker()
    posts = tomllib.loads((HERE / "posts.toml").read_text(encoding="utf-8"))["post"]
    said = {}
    with tempfile.TemporaryDirectory() as folder:
        rs274 = maker.Interpreter(Path(binary), Path(folder))
        for post in posts:
            if post.get("dialect", "linuxcnc") != "linuxcnc":
                continue
            calls, message = rs274.run((HERE / post["file"]).read_bytes(), "", False)
            canon = maker.Canon()
            for name, args in calls:
                canon.take(name, args)
            said[post["file"]] = message or [[move["kind"], *move["end"]] for move in canon.moves]
    lines = [f" {json.dumps(name)}: {json.dumps(moves)}" for name, moves in said.items()]
    (HERE / "rs274.json").write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="ascii")
    for name, moves in said.items():
        print(f"{name}: {moves if isinstance(moves, str) else f'{len(moves)} moves'}")


if __name__ == "__main__":
    main()
