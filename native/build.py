"""Compile the core: every C file under native/ into libraries in gcode2krl/compiled/built.

Run by the build backend for an installation, and by hand after an edit of a C file or of a constant in a
Python module, of which ``native/constants.py`` makes a header first::

    python native/build.py                                     # for this machine
    python native/build.py --checked                           # beside it one that checks every index
    python native/build.py --target aarch64-macos --into DIR   # for another platform, with ziglang

The compiler is $CC, else cc, clang or gcc where they work, else the one in the package ziglang. For x86-64
there are two builds, one for any such processor and one for those with AVX2; the loader takes what the
processor has, and both give the same bits, as no operation is contracted or reordered.
"""

import argparse
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILT = HERE.parent / "gcode2krl" / "compiled" / "built"
SUFFIXES = {"windows": ".dll", "macos": ".dylib", "linux": ".so"}
TARGETS = ("x86_64-windows-gnu", "x86_64-macos", "aarch64-macos", "x86_64-linux-gnu", "aarch64-linux-gnu")
"""Platforms for which wheels are made, in the compiler's names."""
FLAGS = (
    *("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
    *("-fno-sanitize=undefined", "-fvisibility=hidden", "-Wall", "-Wextra"),
    "-Werror=implicit-function-declaration",
)
CHECKING = (
    *("-DCHECKED", "-g", "-O1", "-fsanitize=undefined,float-cast-overflow"),
    "-fsanitize-undefined-trap-on-error",  # no library of its own, for Python to load
)


@dataclass(frozen=True)
class Machine:
    """What is compiled for."""

    system: str
    """windows, macos or linux."""
    is_x86: bool
    flags: tuple[str, ...] = ()

    @classmethod
    def this(cls) -> "Machine":
        """Return the machine that this Python runs on; on a Mac all that its packages have to run on."""
        system = {"win32": "windows", "darwin": "macos"}.get(sys.platform, "linux")
        is_x86 = platform.machine().lower() in ("x86_64", "amd64")
        if system != "macos":
            return cls(system, is_x86)
        both = ("x86_64", "arm64") if sysconfig.get_platform().endswith("universal2") else ()
        named = os.environ.get("ARCHFLAGS", "").split()
        return cls(system, False, tuple(named) or tuple(word for each in both for word in ("-arch", each)))

    @classmethod
    def named(cls, target: str) -> "Machine":
        """Return one of `TARGETS`; what is built for Linux runs with the C library of 2012 and later."""
        processor, system, *_ = target.split("-")
        oldest = ".2.17" if system == "linux" else ""
        return cls(system, processor == "x86_64" and system != "macos", ("-target", target + oldest))


def compiler() -> list[str] | None:
    """Return the command of a C compiler, or None if there is none.

    On Windows one that is there may build for another processor or C library, so only $CC and ziglang count.
    """
    if named := os.environ.get("CC"):
        return shlex.split(named, posix=os.name != "nt")
    for name in () if sys.platform == "win32" else ("cc", "clang", "gcc"):
        found = shutil.which(name)
        if found and _works(found):
            return [found]
    return ziglang() if importlib.util.find_spec("ziglang") else None


def ziglang() -> list[str]:
    """Return the command of the C compiler that comes as a Python package."""
    return [sys.executable, "-m", "ziglang", "cc"]


def _works(command: str) -> bool:
    """Tell whether a compiler finds the C library's headers and can link."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "try.c"
        source.write_text("#include <math.h>\n#include <stdint.h>\nint64_t one(void) { return 1; }\n")
        line = [command, "-shared", "-fPIC", str(source), "-o", str(source.with_suffix(".so"))]
        return subprocess.run(line, capture_output=True).returncode == 0


def build(
    into: Path = BUILT,
    *,
    command: list[str] | None = None,
    machine: Machine | None = None,
    checked: bool = False,
) -> list[Path]:
    """Compile the libraries into a folder and return them; by default for this machine.

    Raises
    ------
    SystemExit
        With one line, if there is no compiler, or with what it says if it fails.
    """
    command = command or compiler()
    if command is None:
        raise SystemExit("no C compiler: install one, or the package ziglang, which brings one")
    machine = machine or Machine.this()
    digest = _run(
        [sys.executable, str(HERE / "constants.py")]
    ).strip()  # by it the loader knows an older core
    into.mkdir(parents=True, exist_ok=True)
    return [
        _library(
            command,
            machine,
            (*flags, f'-DCORE_SOURCES="{digest}"'),
            into / f"{name}{SUFFIXES[machine.system]}",
        )
        for name, flags in _variants(machine, checked=checked, by_zig="ziglang" in command)
    ]


def _variants(machine: Machine, *, checked: bool, by_zig: bool) -> Iterator[tuple[str, tuple[str, ...]]]:
    if checked:
        yield "core_checked", CHECKING
        return
    yield "core", ()
    if machine.is_x86:
        # without fma: gcc 12 fuses pairs of additions and subtractions although nothing is to be contracted
        yield "core_wide", ("-mcpu=x86_64_v3-fma",) if by_zig else ("-march=x86-64-v3", "-mno-fma")


def _library(command: list[str], machine: Machine, flags: Iterable[str], target: Path) -> Path:
    """Compile all files, as many at once as there are cores, and link them."""
    with tempfile.TemporaryDirectory() as folder:
        files = sorted(HERE.rglob("*.c"))
        objects = [Path(folder) / f"{number}.o" for number in range(len(files))]
        position = () if machine.system == "windows" else ("-fPIC",)
        common = [*command, *machine.flags, *FLAGS, *flags, *position, f"-I{HERE}", "-c"]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            pairs = zip(files, objects, strict=True)
            list(pool.map(lambda pair: _run([*common, str(pair[0]), "-o", str(pair[1])]), pairs))
        fresh = Path(folder) / target.name
        math = () if machine.system == "windows" else ("-lm",)
        strip = ("-s",) if "-g" not in flags and machine.system != "macos" else ()
        linked = (*(str(each) for each in objects), *math, "-o", str(fresh))
        _run([*command, *machine.flags, "-shared", *strip, *linked])
        target.unlink(missing_ok=True)  # a running process keeps the one that it has loaded
        shutil.move(fresh, target)
    return target


def _run(command: list[str]) -> str:
    """Return what a command prints; raises SystemExit with what it says where it fails."""
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{shlex.join(command)}\n{done.stderr}")
    if done.stderr:
        print(done.stderr, file=sys.stderr)
    return done.stdout


def wheel_platform() -> str:
    """Return the platform of a wheel's name: the core needs no particular Python."""
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


def main() -> None:
    """Compile what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--checked", action="store_true", help="check every index")
    parser.add_argument("--target", choices=TARGETS, help="another platform, compiled with ziglang")
    parser.add_argument("--into", type=Path, default=BUILT, help="folder of the libraries")
    options = parser.parse_args()
    if options.target:
        machine, command = Machine.named(options.target), ziglang()
    else:
        machine, command = None, None
    for made in build(options.into, command=command, machine=machine, checked=options.checked):
        print(made)


if __name__ == "__main__":
    main()
