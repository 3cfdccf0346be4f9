"""What all tests share: the checkout's folders and a way to run the command line in-process."""

import gc
import hashlib
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import pytest

from gcode2krl import load_cell, predict
from gcode2krl.cli.main import _run
from gcode2krl.files.output import Staging

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.nc"))


def pytest_xdist_auto_num_workers(config):
    """The suite, or a folder of it, on all cores; files and single tests here, where they start at once."""
    named = [Path(str(argument).partition("::")[0]) for argument in config.args]
    return None if any(path.is_dir() for path in named) else 0


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Ten thousand tests stay to the end: the collector of garbage need not look at them time and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_configure(config):
    """Several processes run at once, so each needs one thread; nothing written has to survive a power cut."""
    os.fsync = lambda descriptor: None
    if getattr(config.option, "numprocesses", None):
        os.environ.setdefault("GCODE2KRL_THREADS", "1")
        for library in ("OMP", "OPENBLAS", "MKL"):
            os.environ.setdefault(f"{library}_NUM_THREADS", "1")


def draws(count):
    """So many random cases; `GCODE2KRL_DRAWS=10 python -m pytest -m slow` draws ten times as many."""
    return max(1, round(count * float(os.environ.get("GCODE2KRL_DRAWS", "1"))))


def _heed_ctrl_c():
    signal.signal(signal.SIGINT, signal.SIG_DFL)


HEEDS_CTRL_C = _heed_ctrl_c if os.name == "posix" else None
"""``preexec_fn`` of a process that gets a SIGINT: a shell in the background lets its programs ignore it."""


@dataclass(frozen=True)
class Outcome:
    """Result of a run of the command line."""

    code: int
    out: str
    err: str


@pytest.fixture
def run(capfd, tmp_path, monkeypatch):
    """Run ``gcode2krl`` in an empty folder; returns code (which must be ``code``), output and findings."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GCODE2KRL_CACHE", str(tmp_path / "cache"))

    def run_command(*arguments, code=None):
        capfd.readouterr()
        found = _run([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        assert code in (None, found), err
        return Outcome(found, out, err)

    return run_command


_MOST_BYTES_PARSED = 200_000
_PARSED: set[bytes] = set()


@pytest.fixture(autouse=True)
def written_programs_are_krl(monkeypatch):
    """Whatever program a test has gcode2krl write, the grammar of `tests/krl` takes it; each text once."""
    programs: list[dict[str, bytes]] = []
    take_places = Staging.take_places

    def taking(staging):
        take_places(staging)
        sources = [place for place in staging._temporary if place.suffix in (".src", ".dat")]
        has_source = any(place.suffix == ".src" for place in sources)  # a batch may put back a .dat alone
        if has_source and sum(place.stat().st_size for place in sources) <= _MOST_BYTES_PARSED:
            texts = {place.name: place.read_bytes() for place in sources}
            if all(b" by gcode2krl" in text[:400] for text in texts.values()):  # not made up by a test
                programs.append(texts)

    monkeypatch.setattr(Staging, "take_places", taking)
    yield
    for program in programs:
        digest = hashlib.sha1(b"".join(program.values()), usedforsecurity=False).digest()
        if digest not in _PARSED:
            _PARSED.add(digest)
            from tests.krl.language import parse_program  # lark is imported where there is something to parse

            parse_program(program, has_globals=True)


@pytest.fixture(scope="session")
def cell():
    """The default cell."""
    return load_cell()


@pytest.fixture
def part(request, tmp_path):
    """The program ``PART`` of the module, as part.nc in the folder where commands run."""
    file = tmp_path / "part.nc"
    file.write_text(request.module.PART)
    return file


@pytest.fixture(scope="session")
def prediction():
    """The prediction of the test piece under the default cell."""
    return predict(ROOT / "examples" / "test_piece.nc")
