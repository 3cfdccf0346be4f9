"""Files written together: all or none, never over an input, no leftovers of a killed run."""

import os
import signal
import subprocess
import sys
import time

import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.files import SURELY_LEFT_S, leftovers, write_together

OLD, NEW = {"a.src": b"old a", "a.dat": b"old b"}, {"a.src": b"new a" * 5000, "a.dat": b"new b" * 5000}
WRITER = """
import sys, pathlib
from gcode2krl.files import write_together
folder = pathlib.Path(sys.argv[1])
print("ready", flush=True)
while True:
    for content in (b"new a" * 5000, b"old a" * 5000):
        write_together({folder / name: content for name in ("a.src", "a.dat", "a.csv")})
"""


def put(folder, files):
    for name, content in files.items():
        (folder / name).write_bytes(content)


def names(folder):
    return sorted(file.name for file in folder.iterdir())


def test_all_are_written_and_nothing_else_is_left(tmp_path):
    put(tmp_path, OLD)
    write_together({tmp_path / name: content for name, content in NEW.items()})
    assert {name: (tmp_path / name).read_bytes() for name in names(tmp_path)} == NEW


def test_content_may_write_itself(tmp_path):
    write_together({tmp_path / "a.csv": lambda path: path.write_text("x")})
    assert (tmp_path / "a.csv").read_text() == "x"
    assert names(tmp_path) == ["a.csv"]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError()])
def test_what_fails_leaves_everything_as_it_was(tmp_path, error):
    put(tmp_path, OLD)

    def fail(path):
        raise error

    with pytest.raises(NotUnderstoodError if isinstance(error, OSError) else type(error)):
        write_together({tmp_path / "a.src": NEW["a.src"], tmp_path / "a.dat": fail})
    assert {name: (tmp_path / name).read_bytes() for name in names(tmp_path)} == OLD


def test_a_folder_in_the_place_of_a_file_is_named(tmp_path):
    (tmp_path / "a.dat").mkdir()
    with pytest.raises(NotUnderstoodError, match=r"a\.dat.*folder"):
        write_together({tmp_path / name: content for name, content in NEW.items()})
    assert names(tmp_path) == ["a.dat"]


# --- inputs -----------------------------------------------------------------------------------------------

MEANS = {
    "itself": lambda file, other: None,
    "symbolic link": lambda file, other: other.symlink_to(file),
    "hard link": lambda file, other: other.hardlink_to(file),
}


@pytest.mark.parametrize("means", MEANS)
def test_no_input_is_overwritten_by_whatever_name(tmp_path, means):
    put(tmp_path, OLD)
    output, given = tmp_path / "a.dat", tmp_path / "a.dat" if means == "itself" else tmp_path / "input.txt"
    MEANS[means](output, given)
    outputs = {tmp_path / "a.src": NEW["a.src"], tmp_path / "sub" / ".." / "a.dat": NEW["a.dat"]}
    (tmp_path / "sub").mkdir()
    for inputs in ([given], [tmp_path]):
        with pytest.raises(NotUnderstoodError, match=r"output-is-input"):
            write_together(outputs, inputs)
    assert (tmp_path / "a.src").read_bytes() == OLD["a.src"]
    assert given.read_bytes() == OLD["a.dat"]


def test_a_copy_is_no_input(tmp_path):
    put(tmp_path, OLD)
    (tmp_path / "copy.dat").write_bytes(OLD["a.dat"])
    write_together({tmp_path / "a.dat": b"new"}, [tmp_path / "copy.dat", tmp_path / "nowhere"])
    assert (tmp_path / "a.dat").read_bytes() == b"new"


@pytest.mark.parametrize("second", ["A.SRC", "sub/../a.src", "link/a.src"])
def test_two_outputs_are_not_one_file(tmp_path, second):
    (tmp_path / "sub").mkdir()
    (tmp_path / "link").symlink_to(tmp_path)
    with pytest.raises(NotUnderstoodError, match=r"written twice"):
        write_together({tmp_path / "a.src": b"x", tmp_path / second: b"y"})
    assert names(tmp_path) == ["link", "sub"]


# --- killed runs ------------------------------------------------------------------------------------------


def kill_a_writer(folder, after_s):
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(folder)], stdout=subprocess.PIPE)
    process.stdout.readline()
    time.sleep(after_s)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    return process.pid


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_the_next_run_removes_what_a_killed_one_left(tmp_path):
    left = 0
    for k in range(12):
        kill_a_writer(tmp_path, 0.0013 * k)
        for name in ("a.src", "a.dat", "a.csv"):
            if (tmp_path / name).exists():
                assert len((tmp_path / name).read_bytes()) == 25000, "no file is half written"
        left += any(file.suffix in (".part", ".old") for file in tmp_path.iterdir())
        write_together({tmp_path / name: b"next " * 5000 for name in ("a.src", "a.dat", "a.csv")})
        assert names(tmp_path) == ["a.csv", "a.dat", "a.src"]
    assert left > 0, "no kill hit a run while it wrote"


@pytest.mark.skipif(sys.platform == "win32", reason="kills a process")
def test_a_run_that_lives_keeps_its_files(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    host = next(iter_host(tmp_path))
    theirs = tmp_path / f".a.src.{host}-{process.pid}-abcd1234.part"
    theirs.write_bytes(b"half")
    try:
        assert leftovers(tmp_path / "a.src") == []
        write_together({tmp_path / "a.src": b"x"})
        assert theirs.exists()
    finally:
        process.kill()
        process.wait()
    assert leftovers(tmp_path / "a.src") == [theirs]


def iter_host(folder):
    """Yield the part of a file name that identifies this host."""

    def look(path):
        found.append(path.name)

    found = []
    write_together({folder / "look": look})
    yield found[0].split(".")[2].split("-")[0]


def test_only_what_is_surely_left_and_ours_is_removed(tmp_path):
    host = next(iter_host(tmp_path))
    (tmp_path / "look").unlink(missing_ok=True)
    kept = [
        ".a.src.deadbeef-1-abcd1234.part",  # of another host
        f".a.src.{host}-{os.getpid()}-abcd1234.part",  # our own
        f".b.src.{host}-999999999-abcd1234.part",  # of another target
        "a.src.part",
        ".a.src.part",
        ".a.src.notes.part",
        ".a.src.swp",
    ]
    gone = [f".a.src.{host}-999999999-abcd1234.part", f".a.src.{host}-999999999-abcd1234.old"]
    aged = [".a.src.deadbeef-1-zzzz1234.part", ".a.src.zzzz1234.part"]
    for name in [*kept, *gone, *aged]:
        (tmp_path / name).write_bytes(b"")
    for name in aged:
        past = time.time() - SURELY_LEFT_S - 60.0
        os.utime(tmp_path / name, (past, past))
    write_together({tmp_path / "a.src": b"x"})
    assert names(tmp_path) == sorted([*kept, "a.src"])
