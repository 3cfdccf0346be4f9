"""Compile the core: every C file under native/ into one library in gcode2krl/compiled/built.

Run by the build backend for an installation, and by hand after an edit of a C file::

    python native/build.py            # for this machine
    python native/build.py --checked  # beside it one that checks every index and what is undefined in C

The compiler is $CC, else cc, clang or gcc, else the one in the package ziglang. On x86-64 there are two
builds, one for any such processor and one for those with AVX2; the loader takes what the processor has, and
both give the same bits, as no operation is contracted or reordered.
"""

import argparse
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
TARGET = HERE.parent / "gcode2krl" / "compiled" / "built"
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")

FLAGS = ["-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
FLAGS += [
    "-fno-sanitize=undefined",
    "-fvisibility=hidden",
    "-Wall",
    "-Wextra",
    "-Werror=implicit-function-declaration",
]
CHECKING = ["-DCHECKED", "-g", "-O1", "-fsanitize=undefined,float-cast-overflow"]
CHECKING += ["-fsanitize-undefined-trap-on-error"]  # no library of its own, for Python to load
IS_X86 = platform.machine().lower() in ("x86_64", "amd64")


def sources_digest(folder: Path = HERE) -> str:
    """Return a digest of all that the core is made from; `gcode2krl.compiled.core` compares it."""
    digest = hashlib.sha256()
    for path in sorted([*folder.rglob("*.c"), *folder.rglob("*.h")]):
        digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()[:16]


def compiler() -> list[str] | None:
    """Return the command of a C compiler, or None if there is none."""
    if named := os.environ.get("CC"):
        return shlex.split(named, posix=os.name != "nt")
    for name in ("cc", "clang", "gcc"):
        if found := shutil.which(name):
            return [found]
    return [sys.executable, "-m", "ziglang", "cc"] if importlib.util.find_spec("ziglang") else None


def build(target: Path = TARGET, *, checked: bool = False) -> list[Path]:
    """Compile the libraries into a folder and return them.

    Raises
    ------
    SystemExit
        With one line, if there is no compiler or it fails.
    """
    command = compiler()
    if command is None:
        raise SystemExit("no C compiler: install one, or the package ziglang, which brings one")
    if checked:
        return [_library(command, CHECKING, target / f"core_checked{SUFFIX}")]
    wide = ["-mcpu=x86_64_v3" if "ziglang" in command else "-march=x86-64-v3"]
    libraries = [_library(command, [], target / f"core{SUFFIX}")]
    if IS_X86:
        libraries.append(_library(command, wide, target / f"core_wide{SUFFIX}"))
    return libraries


def _library(command: list[str], flags: list[str], target: Path) -> Path:
    """Compile all files, as many at once as there are cores, and link them."""
    digest = f'-DCORE_SOURCES="{sources_digest()}"'
    position = [] if sys.platform == "win32" else ["-fPIC"]
    with tempfile.TemporaryDirectory() as folder:
        files = sorted(HERE.rglob("*.c"))
        objects = [Path(folder) / f"{number}.o" for number in range(len(files))]
        compiling = [
            [*command, *FLAGS, *flags, *position, digest, f"-I{HERE}", "-c", str(source), "-o", str(out)]
            for source, out in zip(files, objects, strict=True)
        ]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(_run, compiling))
        fresh = Path(folder) / target.name
        math = [] if sys.platform == "win32" else ["-lm"]
        strip = [] if "-g" in flags or sys.platform == "darwin" else ["-s"]
        _run([*command, "-shared", *strip, *(str(each) for each in objects), *math, "-o", str(fresh)])
        target.parent.mkdir(exist_ok=True)
        target.unlink(missing_ok=True)  # a running process keeps the one that it has loaded
        shutil.move(fresh, target)
    return target


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{shlex.join(command)}\n{done.stderr}")
    if done.stderr:
        print(done.stderr, file=sys.stderr)


def wheel_platform() -> str:
    """Return the platform of a wheel's name: the core needs no particular Python."""
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--checked", action="store_true", help="check every index")
    for made in build(checked=parser.parse_args().checked):
        print(made)
