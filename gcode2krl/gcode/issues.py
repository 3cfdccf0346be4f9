"""What the interpreter found, as Issues: causes first, equal arcs together, consequences counted."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.ascii_codes import FIRST_FOREIGN
from gcode2krl.errors import Issue, Severity
from gcode2krl.gcode import dialect_marks as d
from gcode2krl.gcode import findings, sentences
from gcode2krl.gcode.excerpt import column, quote
from gcode2krl.gcode.state import (
    NOTE_CENTRE,
    NOTE_CODE,
    NOTE_HOME,
    NOTE_LOCAL,
    NOTE_OVERRIDE,
    NOTE_ROTARY,
    NOTE_SHIFT,
    NOTE_SMALL_ARC,
    NOTE_STATEMENT,
    NOTE_TABLE,
)
from gcode2krl.gcode.vocabulary import G91_1, TENFOLD

_STATEMENT = re.compile(r"\$\S*|[A-Z_]{3,}\w*")
_O_LINE = re.compile(rb"\s*/?\s*(?:N[\d.\s]*)?O\s*[<\d#\[]", re.IGNORECASE)
Record = Any
"""A numpy record; numpy does not type its fields."""

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_LETTER_O = re.compile(r"[A-MP-Z]\s*[-+]?[\d.]*O[\d.]*")
_NAME_OR_EXPRESSION = re.compile(r"\[[^\]]*\]|<[^>]*>")
_LETTERS_WITH_O = re.compile(r"[A-Z]O[A-Z]")
_JUMP = re.compile(r"GOTO|POPEN")
_ALONE = re.compile(r"(?<![A-Z])([A-MP-Z])\s*(?=[A-Z])")
"""A letter that another one follows."""
_MACRO_STATEMENT = re.compile(r"[A-Z]O[A-Z]|(?:^|\])\s*(?:N\d+\s*)?DO\s*\d")
"""GOTO, POPEN, DO1: statements of a macro."""
_EXPONENT = re.compile(r"[\d.]E[-+]?\d")
_SHIFTS: dict[int, tuple[Severity, str, str]] = {
    NOTE_LOCAL: ("note", "{code} moves the zero{by}{more}", "nothing to do if the part lies there"),
    NOTE_SHIFT: (
        "warning",
        "G92 moves the zero{by}{more}",
        "check that the part lies there; a zero of the cell stands in [work_offsets]",
    ),
    NOTE_TABLE: (
        "warning",
        "G10 sets a work offset of its own, moved{by}{more}",
        "check that the part lies there; a zero of the cell stands in [work_offsets]",
    ),
}
_UNSET_COUNTS = {d.PROGRAMS_FANUC: "empty, and a word with it is left out", d.PROGRAMS_SINUMERIK: "0"}
_INCH_DECIMALS = 4
_INCH_EXTENT_MM = 60.0
_NOTES = {
    NOTE_ROTARY: (
        "rotary-zero",
        "{word}0 is no motion where the cell declares no rotary axes, and is not read ({blocks})",
        "nothing to do; without rotary words in the post the note goes away",
    ),
    NOTE_CENTRE: (
        "centre-zero",
        "{word}0 is not in the plane of its arc and says nothing ({blocks})",
        "nothing to do; a post for LinuxCNC leaves it out",
    ),
    NOTE_HOME: (
        "home-beside-rapid",
        "G0 and G{home} in one block: read as G{home} by way of the point; G0 stays in force ({blocks})",
        "nothing to do; for LinuxCNC write them in separate blocks",
    ),
    NOTE_OVERRIDE: (
        "override-switch",
        "M{number} switches overrides, which have no meaning on this robot; not read ({blocks})",
        "nothing to do; the override stands on the robot's panel",
    ),
    NOTE_SMALL_ARC: (
        "arc-small",
        "an arc that is smaller as a whole than the chord tolerance is read as a straight move ({blocks})",
        "nothing to do; a post that leaves such arcs out makes shorter programs",
    ),
    NOTE_CODE: (
        "dialect-harmless",
        "G{tenth:g}, and the like, set something that this robot does not have; not read ({blocks})",
        "nothing to do",
    ),
    NOTE_STATEMENT: (
        "dialect-harmless",
        "{statement}, and the like, set something that this robot does not have; not read ({blocks})",
        "nothing to do",
    ),
}


def lines_to_quote(raised: NDArray[np.void], state: Record) -> set[int]:
    """Return the file lines that the findings and notes so far speak of."""
    lines = {int(line) for line in raised["line"]}
    return lines | {int(line) for line in state["note_line"]} | {int(state["spiral_line"])}


def found_issues(
    raised: NDArray[np.void], counts: Record, state: Record, texts: Mapping[int, bytes]
) -> list[Issue]:
    """Return the findings in the order of the file, then how many more there are.

    ``texts`` are the blocks by line, for quoting them.
    """
    rows = raised[: counts["findings"]]
    issues = [_issue(row, texts) for row in rows]
    misfits = [k for k, row in enumerate(rows) if row["number"] == findings.F.ARC_RADIUS_MISMATCH]
    if misfits:
        issues[misfits[0]] = _of_all_misfits(
            issues[misfits[0]], rows[misfits[0]], [int(rows[k]["line"]) for k in misfits], state
        )
    issues = [issue for k, issue in enumerate(issues) if k not in misfits[1:]]
    severity: Severity = "error" if any(issue.severity == "error" for issue in issues) else "warning"
    if counts["dropped"]:
        dropped = int(counts["dropped"])
        issues.append(Issue(severity, "more", 0, f"{dropped} more findings", "mend these first"))
    if counts["consequences"]:
        count = int(counts["consequences"])
        what = "1 more finding rests" if count == 1 else f"{count} more findings rest"
        sentence = f"{what} on the errors above and " + ("is not listed" if count == 1 else "are not listed")
        issues.append(Issue("note", "consequences", 0, sentence, "mend the errors, then read again"))
    return issues


def _issue(row: Record, texts: Mapping[int, bytes]) -> Issue:
    number, line = int(row["number"]), int(row["line"])
    a, b, c = (float(row[name]) for name in "abc")
    if number == findings.F.O_WORD and a == findings.PF.FAULT_NOT_FIRST:
        letter = _letter_of_a_word(texts.get(line, b""))
        number, a = (int(findings.F.NO_NUMBER), float(ord(letter))) if letter else (number, a)
    excerpt = quote(texts[line], number, a, b, c) if line in texts else ""
    issue = sentences.make_issue(number, line, a, b, c, excerpt)
    if excerpt:
        issue = replace(issue, column=column(texts[line], number, a, b, c))
    letter = chr(int(a)) if 0 < a < FIRST_FOREIGN else ""
    may_slip = line in texts and not (number == findings.F.O_WORD and _O_LINE.match(texts[line]))
    usual = _slip(texts[line], issue.code, letter) if may_slip else None
    return replace(issue, message=usual[0], remedy=usual[1]) if usual else issue


def _letter_of_a_word(block: bytes) -> str:
    """Return the first letter without a number where the O stands in a word, as FOO; else ''."""
    text = _NAME_OR_EXPRESSION.sub("", _COMMENT.sub(" ", block.decode("latin-1"))).upper()
    if not _LETTERS_WITH_O.search(text) or _JUMP.search(text):
        return ""
    letter = _ALONE.search(text)
    return letter[1] if letter else ""


def _of_all_misfits(issue: Issue, row: Record, lines: list[int], state: Record) -> Issue:
    """Arcs whose radii differ too much are one finding: mostly one setting of the post is wrong."""
    count = int(state["misfits"])
    message, remedy = issue.message, issue.remedy
    if count > 1:
        others = ", ".join(map(str, lines[1:]))
        more = ", …" if count > len(lines) else ""
        lines_word = "line" if count == 2 else "lines"
        message += f"; so do {count - 1} more ({lines_word} {others}{more})"
    if state["misfits_other_centre"] == count:
        now, other, how = (
            ("G91.1", "G90.1", "absolute") if abs(row["c"]) == G91_1 else ("G90.1", "G91.1", "relative")
        )
        message += f"; {now} is in force, and with {other} the radii fit"
        remedy = f"write {other} before the first arc: I, J, K look {how}"
    elif state["misfits_reversed"] == count:
        message += "; with the signs of I, J, K reversed the radii fit"
        remedy = "I, J, K count from the start to the centre: reverse their signs in the post"
    elif state["misfits_exchanged"] == count:
        message += "; with the centre words exchanged the radii fit"
        remedy = "check which of I, J, K belongs to which axis (X: I, Y: J, Z: K)"
    return replace(issue, message=message, remedy=remedy)


def program_issues(
    state: Record,
    texts: Mapping[int, bytes],
    *,
    rest_line: int,
    most_decimals: int,
    head: bytes,
    programs: int,
) -> Iterator[Issue]:
    """Yield the warnings and notes about a program that is understood."""
    yield from _spirals(state, texts)
    yield from _notes(state, texts)
    yield from _zero_issues(state)
    if state["unset_line"]:
        yield _unset(int(state["unset_line"]), int(state["unset_parameter"]), programs)
    if state["retract_unnamed_line"]:
        yield _retract_unnamed(int(state["retract_unnamed_line"]))
    if state["distance_unnamed_line"]:
        yield Issue(
            "warning",
            "start-unnamed",
            int(state["distance_unnamed_line"]),
            "a move before G90 or G91: with which of them a Fanuc starts is a parameter; read under G90",
            "write G90 before it, or state [program.start] distance in the cell",
        )
    if not state["ended"]:
        yield _no_end(cut_off=state["tape_marks"] == 1)
    if rest_line:
        yield Issue(
            "warning",
            "after-end",
            rest_line,
            "lines behind the program's end are not read",
            "remove them or the early M2/M30/%",
        )
    if not state["unit_named"]:
        yield _unit_issue(state, most_decimals)
    elif state["unit_mm"] == 1.0 and _says_inch(head):
        yield Issue(
            "warning",
            "unit-doubtful",
            0,
            "a comment at the top speaks of inches, the program says G21 (mm)",
            "check the post's unit",
        )


def _spirals(state: Record, texts: Mapping[int, bytes]) -> Iterator[Issue]:
    count, line = int(state["spirals"]), int(state["spiral_line"])
    if not count:
        return
    start, end = float(state["spiral_start"]), float(state["spiral_end"])
    sentence = sentences.SPIRAL_SENTENCE.format(
        count="an arc" if count == 1 else f"{count} arcs", difference=abs(start - end), a=start, b=end
    )
    remedy = sentences.SPIRAL_REMEDY.format(
        decimals=sentences.decimals_needed(float(state["spiral_unit_mm"]))
    )
    excerpt = quote(texts[line], findings.F.ARC_RADIUS_MISMATCH, start, end) if line in texts else ""
    yield Issue("warning", "arc-radius-differs", line, sentence, remedy, excerpt)


def _notes(state: Record, texts: Mapping[int, bytes]) -> Iterator[Issue]:
    for which, (code, sentence, remedy) in _NOTES.items():
        count, line, word = (int(state[name][which]) for name in ("note_count", "note_line", "note_word"))
        if not count:
            continue
        first = texts.get(line, b"").decode("latin-1")
        statement = next(iter(_STATEMENT.findall(first)[:1]), "a statement")
        values = {
            "tenth": word / TENFOLD,
            "statement": statement,
            "word": chr(word) if word < FIRST_FOREIGN else "",
            "home": word // TENFOLD,
            "number": word,
        }
        blocks = "in one block" if count == 1 else f"in {count} blocks"
        yield Issue("note", code, line, sentence.format(blocks=blocks, **values), remedy)


def _unset(line: int, number: int, programs: int) -> Issue:
    counts = _UNSET_COUNTS.get(programs, "0, as in LinuxCNC")
    name = f"R{number}" if programs == d.PROGRAMS_SINUMERIK else f"#{number}"
    return Issue(
        "warning",
        "parameter-unset",
        line,
        f"{name} is read before anything sets it; it counts as {counts}",
        f"set it at the beginning of the program: {name} = …",
    )


def _retract_unnamed(line: int) -> Issue:
    return Issue(
        "warning",
        "retract-unnamed",
        line,
        "the cycles retract to R between holes, as in LinuxCNC: neither G98 nor G99 is named",
        "write G98 (back to the height before the cycles) or G99 (to R) before them",
    )


def _no_end(*, cut_off: bool) -> Issue:
    if cut_off:
        what = "the file begins with % and ends without %, M2 or M30"
        return Issue("warning", "cut-off", 0, what, "is the file complete?")
    return Issue("warning", "no-program-end", 0, "no M2, M30 or % at the end", "is the file complete?")


def _unit_issue(state: Record, most_decimals: int) -> Issue:
    if state["largest_mm"] < _INCH_EXTENT_MM and most_decimals >= _INCH_DECIMALS:
        return Issue(
            "warning",
            "unit-doubtful",
            0,
            "no G20 or G21, and the numbers look like inches (four decimals, small); read as mm",
            "write G20 or G21 at the start",
        )
    return Issue("warning", "unit-unnamed", 0, "no G20 or G21; read as mm", "write G21 at the start")


def _says_inch(head: bytes) -> bool:
    comments = [line.lower() for line in head.splitlines() if line.lstrip()[:1] in (b"(", b";")]
    return any(b"inch" in line and b"mm" not in line for line in comments)


def _slip(block: bytes, code: str, letter: str) -> tuple[str, str] | None:
    """Return sentence and remedy for a finding ``code`` on ``letter`` if its block shows a usual slip."""
    text = _COMMENT.sub(" ", block.decode("latin-1")).rstrip()
    capitals = text.upper() if len(text.upper()) == len(text) else text
    match = _LETTER_O.search(capitals)
    if code in ("o-word", "no-number") and match and not _MACRO_STATEMENT.search(capitals):
        word = match[0].replace(" ", "")
        if code == "o-word" or word[0] == letter:
            return (
                f"the letter O stands in the number of {word[0]}",
                f"write the digit 0: {word.replace('O', '0')}",
            )
    if code == "no-number" and re.search(rf"{letter}\s*[-+]?l(?![A-Za-z])", text, re.IGNORECASE):
        return f"the letter l stands in the number of {letter}", "write the digit 1"
    if code == "no-number" and re.search(rf"{letter}\s*[-+]\s*[-+]", capitals):
        return f"two signs stand before the number of {letter}", "write one sign"
    if code == "unknown-letter" and letter == "E":
        if _EXPONENT.search(capitals):
            return "a number with an exponent E", "write it out, as 0.001"
        return "E is not a word of this dialect", "remove it; E drives the extruder of a 3D printer"
    return None


def _zero_issues(state: Record) -> Iterator[Issue]:
    """Yield where the program moves its zero, and that a shift is in force at its end."""
    for which, (severity, sentence, remedy) in _SHIFTS.items():
        count, line = int(state["note_count"][which]), int(state["note_line"][which])
        if count:
            first = 3 * (which - NOTE_LOCAL)
            by = _by_mm(state["moved_mm"][first : first + 3])
            more = f"; {count} blocks move it" if count > 1 else ""
            what = sentence.format(code=_shift_word(state), by=by, more=more)
            yield Issue(severity, "program-offset", line, what, remedy)
    if any(state["shift_mm"]):
        is_trans = _shift_word(state) == "TRANS"
        what = f"the shift{_by_mm(state['shift_mm'])} is in force at the end"
        yield Issue(
            "note",
            "offset-left",
            int(state["shift_line"]),
            what if is_trans else f"{what}; LinuxCNC would keep it",
            f"write {'TRANS' if is_trans else 'G92.1'} before the end; here the next program begins without",
        )


def _shift_word(state: Record) -> str:
    """Return what shifts the zero: G52, which is its number in the state, or TRANS of a Sinumerik."""
    return "G52" if state["note_word"][NOTE_LOCAL] or not state["note_count"][NOTE_LOCAL] else "TRANS"


def _by_mm(moved_mm: Any) -> str:
    """Return a move as `` by X10 Y-5 mm``; without one only the rotation changes."""
    words = [f"{letter}{value:g}" for letter, value in zip("XYZ", moved_mm.round(4), strict=True) if value]
    return f" by {' '.join(words)} mm" if words else " by a rotation"
