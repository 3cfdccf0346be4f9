"""A comment is nothing wherever it may stand; where it may not, its line is refused."""

import io
import random
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import Gcode2KrlError, load_cell
from gcode2krl.gcode import read_stream
from tests.conftest import draws

ROOT = Path(__file__).parents[2]
RS274, POSTS = ROOT / "tests" / "reference" / "rs274", ROOT / "tests" / "reference" / "posts"
TABLE = tomllib.loads((POSTS / "posts.toml").read_text(encoding="utf-8"))["post"]
DIALECTS = {post["file"]: post.get("dialect", "linuxcnc") for post in TABLE}
COMMENT, TAIL = "(c [5] x9)", ";c (d [5] x9"
BLANKS = " \t\r"
WORDS = re.compile(r"(?:\([^()]*\)|[A-Z][ \t]*[-+]?[\d.]+|[ \t\r])*(?:;.*)?")
HEAD = "/0123456789nN" + BLANKS
OTHER_TEXTS = (" ", "\t", ";", "(MSG,a)", "(DEBUG,#5)", "(AXIS,hide)", "(", ")", "(a(b)", "()")
MOST_LINES = 500
LONGEST = 200  # characters of a line that a comment is put into: LinuxCNC reads 252
COMPUTING = {
    "fanuc": """O0001 (MAIN)
G21 G90 G17 G94
#1=2 (TWO)
#2=#1*[3+1]
N10 G0 X#2 Y[#1+#2]
IF [#1 GT 5] GOTO 20
#1=#1+1
GOTO 10
N20 IF [#1 EQ 6] THEN #3=ABS[-3]
#4=0
WHILE [#4 LT 2] DO1
#4=#4+1
G1 Z#3 F[100*#4]
END1
G65 P9010 A12. B#2
M98 P20 L2
M30
O9010
G1 X#1 Y#2
M99
O0020
G91 G1 Z0.
G90
M99
""",
    "sinumerik": """G21 G90 G17 G94 G71
R1=2 R2=4*2
AA: G0 X=R1 Y=R2
R1=R1+1
IF R1<13 GOTOB AA
G1 X=AC(12) Z=3 F=500
M30
""".replace("G21 ", ""),
}
COLUMNS = (
    *("position_mm", "feed_mm_s", "rapid", "source_line", "arc", "tool", "dwell_s"),
    *("known", "axis", "events"),
)


class Program:
    """A reference program: its lines, and how it is read."""

    def __init__(self, path, dialect=""):
        self.path = path
        self.dialect = dialect or (DIALECTS.get(path.name) if path.parent == POSTS else None) or "linuxcnc"
        self.lines = path.read_text(encoding="latin-1").split("\n")[:MOST_LINES]
        toml = path.with_suffix(".toml")
        five_axes = path.parent.parent == ROOT / "examples" and (path.parent / "cell.toml").exists()
        cell_file = path.parent / "cell.toml" if five_axes else toml
        self.cell = load_cell(cell_file) if cell_file.exists() else None
        self.original = self.outcome(self.lines)

    def read(self, lines):
        """Return the Toolpath of changed lines."""
        stream = io.BytesIO("\n".join(lines).encode("latin-1"))
        tools = None if self.cell else RS274 / "tool.tbl"
        options = {"dialect": self.dialect, "tools": tools, "folders": (self.path.parent,)}
        return read_stream(stream, self.path.name, self.cell, **options)

    def outcome(self, lines):
        """Return what is read, by name of its column; or the code and the line of the first error."""
        try:
            toolpath = self.read(lines)
        except Gcode2KrlError as error:
            return next((i.code, i.line) for i in error.issues if i.severity == "error")
        return {name: getattr(toolpath, name) for name in COLUMNS}

    def difference(self, lines):
        """Return what is read otherwise than in the original program: a column, or the error."""
        outcome = self.outcome(lines)
        if isinstance(outcome, tuple) or isinstance(self.original, tuple):
            return "" if outcome == self.original else outcome
        return next((name for name in COLUMNS if not same(outcome[name], self.original[name])), "")

    def with_line(self, number, line):
        return [*self.lines[:number], line, *self.lines[number + 1 :]]


def same(a, b):
    return np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b


def programs():
    """Return all reference programs that can be read."""
    folders = ("programs", "programs_macro", "programs_offsets")
    paths = [path for folder in folders for path in sorted((RS274 / folder).iterdir())]
    paths += [POSTS / name for name in sorted(DIALECTS)]
    paths += sorted((ROOT / "examples").glob("*.nc")) + sorted((ROOT / "examples").glob("*/*.nc"))
    paths += sorted((ROOT / "tests" / "golden" / "programs").glob("*.nc"))
    read = [Program(path) for path in paths]
    return [program for program in read if not isinstance(program.original, tuple)]


# --- where a comment may stand: the grammar of LinuxCNC ---------------------------------------------------

BLANK = r"[ \t\r]*"
EXPRESSION = r"\[[^][]*\]"
for _ in range(4):  # so deep are brackets in each other
    EXPRESSION = rf"\[(?:[^][]|{EXPRESSION})*\]"
NUMBER = r"[\d.+-](?:[\d.+ \t\r-]*[\d.+-])?"
FUNCTION = rf"[a-z](?:[a-z \t\r]*[a-z])?{BLANK}{EXPRESSION}(?:{BLANK}/{BLANK}{EXPRESSION})?"
VALUE = rf"[-+# \t\r]*(?:<[^>]*>|{EXPRESSION}|{FUNCTION}|{NUMBER})"
BEFORE_BLOCK = re.compile(rf"(?:{BLANK}/)?(?:{BLANK}n{BLANK}{NUMBER})?", re.IGNORECASE)
O_WORD = re.compile(rf"{BLANK}o{VALUE}(?:{BLANK}([a-z](?:[a-z \t\r]*[a-z])?))?", re.IGNORECASE)
ARGUMENT = re.compile(BLANK + EXPRESSION, re.IGNORECASE)
WORD = re.compile(rf"%|#{VALUE}{BLANK}={BLANK}{VALUE}|.{VALUE}", re.IGNORECASE)


def behind_gap(line, at, places):
    """Add the columns of a gap, in which comments may stand; return where it ends."""
    while True:
        end = re.compile(BLANK).match(line, at).end()
        places.update(range(at, end + 1))
        if line[end : end + 1] != "(":
            return end
        at = line.index(")", end) + 1


def gaps_of(line):
    """Return the columns of a line of LinuxCNC's G-code at which its interpreter takes a comment."""
    places, at = set(), BEFORE_BLOCK.match(line).end()
    if o_word := O_WORD.match(line, at):
        at, is_call = o_word.end(), o_word[1] and "".join(o_word[1].split()).lower() == "call"
        while argument := ARGUMENT.match(line, behind_gap(line, at, places) if is_call else at):
            at = argument.end()
    at = behind_gap(line, at, places)
    while not o_word and line[at : at + 1] != ";" and (word := WORD.match(line, at)):
        at = behind_gap(line, word.end(), places)
    return places


def places_in(program, line):
    """Return the columns at which a comment is nothing: on other controls those between plain words."""
    words = WORDS.fullmatch(line) is not None and not is_o_line(line)
    if program.dialect == "linuxcnc" or (words and program.dialect != "sinumerik"):
        return gaps_of(line)
    return set()


def outside_comments(line):
    """Return the columns of a line that are in no comment."""
    columns, inside = [], False
    for column, character in enumerate(line):
        if not inside:
            columns.append(column)
            if character == ";":
                return columns
        inside = character == "(" or (inside and character != ")")
    return [*columns, len(line)] if not inside else columns


def with_text(line, column, text):
    return line[:column] + text + line[column:]


def lines_of_code(program):
    for number, line in enumerate(program.lines):
        is_statement = program.dialect == "sinumerik" and ("(" in line or '"' in line)
        if line.strip(BLANKS) and "%" not in line and len(line) < LONGEST and not is_statement:
            yield number, line


def is_o_line(line):
    return line.upper().lstrip(HEAD).startswith(("O", "END"))


def is_read_as_block(program):
    """LinuxCNC finds M98 and M99 only where no comment stands before them; here they are found there too."""
    return not any(word in "".join(program.lines).upper() for word in ("M98", "M99"))


# --- the properties ---------------------------------------------------------------------------------------


def check_all_lines_at_once(program):
    """The k-th place of every line gets its comment in one program; so does every end its `;`."""
    places = {number: sorted(places_in(program, line)) for number, line in lines_of_code(program)}
    count = 0
    for k in range(max(map(len, places.values()), default=0)):
        lines = list(program.lines)
        for number, columns in places.items():
            if k < len(columns):
                lines[number] = with_text(lines[number], columns[k], COMMENT)
                count += 1
        assert program.difference(lines) == "", (program.path.name, k)
    lines = list(program.lines)
    for number, line in lines_of_code(program):
        lines[number] = line.rstrip(BLANKS) + ("" if ";" in line else TAIL)
        count += 1
    assert program.difference(lines) == "", program.path.name
    return count


def check_each_place(program, number, line):
    """Put a comment at every character of a line: it changes nothing, or its line is refused."""
    count, is_run = 0, None
    places = places_in(program, line)
    for column in outside_comments(line):
        changed = with_text(line, column, COMMENT)
        difference = program.difference(program.with_line(number, changed))
        where = (program.path.name, number + 1, changed, difference)
        count += 1
        if column in places:
            assert difference == "", where
            continue
        if difference == "" and program.dialect == "linuxcnc":
            if is_run is None:
                wrong = line.partition("(")[0].partition(";")[0] + "]"
                is_run = program.difference(program.with_line(number, wrong)) != ""
            assert not is_run or not is_read_as_block(program), where
        elif difference != "":
            assert isinstance(difference, tuple), where
            # the end of a loop, or a label, that is none is missed where the loop begins, or the jump stands
            stands_first = is_o_line(line) or not line[:column].strip(HEAD)
            assert difference[1] == number + 1 or stands_first, where
    return count


@pytest.fixture(scope="module")
def reference_programs():
    return programs()


@pytest.mark.slow
def test_comments_in_all_lines_of_all_programs_change_nothing(reference_programs):
    assert sum(map(check_all_lines_at_once, reference_programs)) > 20_000


def test_no_reference_program_is_told_of_arguments_that_fit(reference_programs):
    told = [
        program.path.name
        for program in reference_programs
        for issue in program.read(program.lines).issues
        if issue.code == "argument-count"
    ]
    assert told == ["sub_in_file.nc", "subs.nc", "subs.nc"]  # LinuxCNC's zeros are tried out there


def test_a_comment_anywhere_changes_nothing_or_is_refused_sampled(reference_programs):
    rng = random.Random(5)
    computing = [program for program in reference_programs if "#" in "".join(program.lines)]
    for program in rng.sample(reference_programs, 25) + computing[::3]:
        for number, line in rng.sample(list(lines_of_code(program)), 2):
            check_each_place(program, number, line)


@pytest.mark.parametrize(("dialect", "text"), COMPUTING.items())
def test_a_comment_anywhere_in_the_programs_of_other_controls(dialect, text, tmp_path):
    path = tmp_path / "part.nc"
    path.write_text(text, encoding="ascii")
    program = Program(path, dialect)
    assert program.original["position_mm"][-1].tolist() == [12.0, 8.0, 3.0]
    check_all_lines_at_once(program)
    for number, line in lines_of_code(program):
        check_each_place(program, number, line)


@pytest.mark.parametrize(
    ("dialect", "line", "is_read"),
    [
        ("fanuc", "G0 X5.; Y6.", False),
        ("fanuc", "G0 X5. ;(a) N20 Y6.", False),
        ("fanuc", "G0 X5.; to the corner (a)", True),
        ("fanuc", "; G0 Y6.\nG0 X5.", True),
        ("grbl", "G0 X5 ; Y6", True),
        ("sinumerik", "G0 X5 (a)", False),
        ("sinumerik", "R1=5 (a)\nG0 X=R1", False),
        ("sinumerik", "G0 X5 ; (a) Y6", True),
    ],
)
def test_what_is_a_comment_says_the_control(dialect, line, is_read, tmp_path):
    path = tmp_path / "part.nc"
    path.write_text(f"G90 G17 G94\n{line}\nM30\n", encoding="ascii")
    outcome = Program(path, dialect).original
    assert outcome["position_mm"][-1].tolist() == [5.0, 0.0, 0.0] if is_read else outcome[1] == 2


@pytest.mark.slow
def test_a_comment_anywhere_changes_nothing_or_is_refused(reference_programs, capsys):
    places = [(program, *line) for program in reference_programs for line in lines_of_code(program)]
    sample = random.Random(6).sample(places, min(len(places), draws(len(places) // 12)))
    count = sum(check_each_place(*place) for place in sample)
    with capsys.disabled():
        print(
            f"\n{count} comments in {len(sample)} lines of {len(reference_programs)} programs: 0 differences"
        )
    assert count > 3_000


# --- beside LinuxCNC itself -------------------------------------------------------------------------------


def why_refused_here_alone(line, code):
    """Return why a line that LinuxCNC reads may be refused, empty where there is no reason."""
    if "<" in line:
        return "LinuxCNC takes the comment into a name"
    return "LinuxCNC passes over O-lines that make no sense" if code == "o-word" else ""


def check_beside(program, number, changed, beside, compare):
    """Let both read a program with a changed line; return whether it is read."""
    lines = program.with_line(number, changed)
    theirs = beside.read("\n".join(lines).encode("latin-1"))
    where = (program.path.name, number + 1, changed, theirs.refused)
    try:
        toolpath = program.read(lines)
    except Gcode2KrlError as error:
        first = next(issue for issue in error.issues if issue.severity == "error")
        assert theirs.refused or why_refused_here_alone(changed, first.code), (*where, first)
        return False
    is_known = not is_read_as_block(program) or theirs.refused.startswith(
        "File ended"
    )  # no M2: a warning here
    assert not theirs.refused or is_known, where
    assert theirs.refused or compare(toolpath, theirs.moves) == "", where
    return True


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("rs274") is None, reason="Debian package linuxcnc-uspace")
def test_linuxcnc_reads_and_refuses_the_same(tmp_path, monkeypatch, capsys):
    from tests.reference.rs274 import beside as other

    monkeypatch.setattr(other, "LONGEST_S", 3.0)
    beside, difference = other.Beside(tmp_path), other.difference
    rng, tally = random.Random(7), {False: 0, True: 0}
    for path in sorted((RS274 / "programs_macro").iterdir()) + sorted((RS274 / "programs").iterdir())[::80]:
        program = Program(path)
        theirs = beside.read("\n".join(program.lines).encode("latin-1"))
        if theirs.refused or isinstance(program.original, tuple):
            continue
        assert difference(program.read(program.lines), theirs.moves) == ""
        for number, line in lines_of_code(program):
            columns = outside_comments(line)
            changes = [(column, COMMENT) for column in rng.sample(columns, min(2, len(columns)))]
            changes += [(rng.choice(columns), rng.choice(OTHER_TEXTS))]
            for column, text in changes:
                is_read = check_beside(program, number, with_text(line, column, text), beside, difference)
                tally[is_read] += 1
    with capsys.disabled():
        print(f"\nas LinuxCNC does: {tally[True]} comments read, {tally[False]} refused")
    assert min(tally.values()) > 300
