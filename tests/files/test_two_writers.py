"""Two processes that write the same files: the second is told, and nothing of it is mixed in."""

import subprocess
import sys
from pathlib import Path

import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.files import Staging, watched, write_together

WRITER = """
import sys
from pathlib import Path
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.files import watched, write_together
folder, word = Path(sys.argv[1]), sys.argv[2]
places = [folder / name for name in ("a.src", "a.dat", "a.pilot.csv")]
with watched(places):
    print("begun", flush=True)
    sys.stdin.readline()
    try:
        write_together({place: word.encode() for place in places})
    except NotUnderstoodError as error:
        sys.exit(f"{error.issues[0].code} {error.exit_code}")
"""


def begin(folder, word):
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(folder), word],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "begun\n"
    return process


@pytest.mark.parametrize("before", [None, b"old"])
def test_of_many_writers_at_the_same_time_exactly_the_first_wins(tmp_path, before):
    if before is not None:
        write_together({tmp_path / "a.src": before, tmp_path / "a.dat": before})
    words = [f"word {k}" for k in range(4)]
    processes = {word: begin(tmp_path, word) for word in words}
    for process in processes.values():  # all at once
        process.stdin.write("\n")
        process.stdin.flush()
    ended = {
        word: (process.communicate()[1].strip(), process.returncode) for word, process in processes.items()
    }
    winners = [word for word, (_, code) in ended.items() if code == 0]
    assert len(winners) == 1, ended
    assert {text for text, code in ended.values() if code} == {"output-changed 2"}
    contents = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert contents == dict.fromkeys(("a.src", "a.dat", "a.pilot.csv"), winners[0])


def test_what_was_there_before_is_replaced_again_and_again(tmp_path):
    place = tmp_path / "a.src"
    for content in (b"1", b"22", b"22"):
        write_together({place: content})
    with watched([place]):
        write_together({place: b"3"})
        write_together({place: b"44"})  # its own
    assert place.read_bytes() == b"44"


def test_a_file_that_another_wrote_while_ours_were_staged(tmp_path):
    place = tmp_path / "a.src"
    with Staging() as staging:
        staging.write(place, b"ours")
        place.write_bytes(b"theirs, longer")
        with pytest.raises(NotUnderstoodError, match="another process has written"):
            staging.take_places()
    assert place.read_bytes() == b"theirs, longer"
    assert [path.name for path in tmp_path.iterdir()] == ["a.src"]


def test_any_new_file_in_a_watched_folder(tmp_path):
    (tmp_path / "parts").mkdir()
    with watched(folder=tmp_path):
        write_together({tmp_path / "parts" / "mine.src": b"1"})
        write_together({tmp_path / "parts" / "mine.src": b"22"})
        (tmp_path / "parts" / "other.src").write_bytes(b"theirs")
        with pytest.raises(NotUnderstoodError, match="output-changed"):
            write_together({tmp_path / "parts" / "other.src": b"ours"})
    write_together({tmp_path / "parts" / "other.src": b"later"})


def test_a_marker_of_a_killed_run_holds_nobody_up(tmp_path):
    host = _host(tmp_path)
    marker = tmp_path / ".gcode2krl.taking"
    marker.write_text(f"{host}-999999999", encoding="ascii")
    write_together({tmp_path / "a.src": b"x"})
    assert [path.name for path in tmp_path.iterdir()] == ["a.src"]


def _host(folder: Path) -> str:
    names = []
    write_together({folder / "a.src": lambda path: names.append(path.name) or path.write_bytes(b"")})
    return names[0].split(".")[3].split("-")[0]


def test_two_translations_to_one_program(tmp_path):
    """The first begins, the second ends: the first must not replace what it has written."""
    part = "G21 G90\nT1 M6\nS8000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG1 Z-1 F600\nG1 X40\nG0 Z20\nM5\nM30\n"
    comment = "(" + 60 * "x" + ")\n"
    words = [sys.executable, "-m", "gcode2krl", "-", "-o", str(tmp_path / "part.src")]
    first = subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    first.stdin.write(comment * 8000)  # more than a pipe holds: the part is being read when this returns
    first.stdin.flush()
    second = subprocess.run(words, input=part, capture_output=True, text=True)
    assert second.returncode == 0, second.stderr
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    told = first.communicate(part.replace("X40", "X50"))[1]
    assert first.returncode == 2, told
    assert "[output-changed]" in told
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
