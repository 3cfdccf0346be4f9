"""Statements of a Sinumerik: where jumps lead, what ends what, which lines are repeated or called; variables.

All labels are written out, so all of it is known before the program runs. Blocks and loops are those of
the O-words (`o_words`), under labels of their own.
"""

import re
from bisect import bisect_right
from collections.abc import Container, Iterator, Mapping
from itertools import product
from string import ascii_uppercase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Ints
from gcode2krl.gcode import findings
from gcode2krl.gcode import program_tables as tables
from gcode2krl.gcode.o_words import Flow, Label, OLine

Array = tuple[int, int, int]
"""Number of the first element of an array, as a parameter, and its sizes, 0 for none."""
_FLAGS = re.IGNORECASE | re.DOTALL
_NAME = rb"[A-Z_][A-Z0-9_]+"
_HEAD = rb"[ \t\r]*(?:/\d?)?[ \t\r]*(?:N[ \t]*(?P<block>\d+)[ \t]*)?"
_LABEL = rb"(?P<label>" + _NAME + rb")[ \t]*:(?!=)"
_END = rb"[ \t\r\x1a]*(?:;.*)?\Z"
_LINE = re.compile(_HEAD + rb"(?:" + _LABEL + rb")?", _FLAGS)
_STATEMENT = _HEAD + rb"(?:" + _NAME + rb"[ \t]*:(?!=))?[ \t]*"
_JUMP = re.compile(
    _STATEMENT
    + rb"(?:IF\b(?P<test>[^;]*?))?"
    + rb"\bGOTO(?P<way>[FBC]?)[ \t]+(?P<target>[A-Z_][A-Z0-9_]+|N\d+)"
    + _END,
    _FLAGS,
)
_BLOCK = re.compile(
    _STATEMENT
    + rb"(?P<word>IF|ELSE|ENDIF|WHILE|ENDWHILE|FOR|ENDFOR|LOOP|ENDLOOP|REPEAT(?="
    + _END
    + rb")|UNTIL)\b",
    _FLAGS,
)
_SECTION = re.compile(
    _STATEMENT
    + rb"REPEAT(?P<one>B?)[ \t]+(?P<first>"
    + _NAME
    + rb")(?:[ \t]+(?P<last>(?!P[ \t]*=)"
    + _NAME
    + rb"))?"
    + rb"(?:[ \t]+P[ \t]*=(?P<times>[^;]*)|(?="
    + _END
    + rb"))",
    _FLAGS,
)
_ALONE = re.compile(_END, _FLAGS)
_CALL = re.compile(
    _STATEMENT
    + rb"(?P<name>(?:[A-Z]|_)[A-Z]\w*\b|L\d+(?!\d))(?P<behind>[ \t]*(?:\([^;]*\))?[ \t]*(?:P[ \t]*=?[^;]*)?)"
    + _END,
    _FLAGS,
)
_CASE = re.compile(_STATEMENT + rb"CASE\b(?P<value>[^;]*?)\bOF\b(?P<ways>[^;]*)", _FLAGS)
_WAY = re.compile(
    rb"[ \t]*(?:(?P<number>[-+]?\d+)|DEFAULT)[ \t]+GOTO(?P<way>[FBC]?)[ \t]+(?P<target>" + _NAME + rb"|N\d+)",
    _FLAGS,
)
_HEADING = re.compile(
    rb"(?:[ \t\r]*(?:(?:N\d+[ \t]*)?(?:;[^\n]*)?|%[^\n]*)\n)*[ \t]*(?:N\d+[ \t]*)?PROC[ \t]+\w+[ \t]*"
    rb"(?:\((?P<formals>[^()\n]*)\))?(?P<attributes>[^;\n]*)",
    re.IGNORECASE,
)
_FORMAL = re.compile(
    rb"[ \t]*(?P<type>REAL|INT|BOOL)[ \t]+(?P<name>[A-Z_]{2}[A-Z0-9_]*)[ \t]*\Z", re.IGNORECASE
)
_DEFINED = re.compile(
    rb"^[ \t\r]*(?:/\d?)?[ \t]*(?:N\d+[ \t]*)?DEF[ \t]+(?P<type>REAL|INT|BOOL)\b(?P<names>[^;\n]*)",
    _FLAGS & ~re.DOTALL | re.MULTILINE,
)
_VARIABLE = re.compile(
    rb"[ \t]*(?P<name>[A-Z_]{2}[A-Z0-9_]*)"
    rb"(?:\[[ \t]*(?P<rows>\d{1,4})[ \t]*(?:,[ \t]*(?P<columns>\d{1,4})[ \t]*)?\])?[ \t]*(?:=|\Z)",
    re.IGNORECASE,
)
_BETWEEN_COMMAS = re.compile(rb"(?:[^,(\[]|\((?:[^()]|\([^()]*\))*\)|\[[^\]]*\])+")
_MOST_ELEMENTS = 1000
_ROOM = {
    b"REAL": (tables.FIRST_REAL, tables.FIRST_INT),
    b"INT": (tables.FIRST_INT, tables.FIRST_BOOL),
    b"BOOL": (tables.FIRST_BOOL, tables.MOST_PARAMETERS),
}
_LOOP_END = re.compile(rb"\bTO\b(?P<end>[^;]*)", _FLAGS)
_NAMED = re.compile(rb"\b(?:R(?=\[)|(?:R\d+|[A-Z_]{2}\w*)\b(?![ \t]*\())", re.IGNORECASE)
_OPENS = {"if": "if", "while": "while", "for": "while", "loop": "while", "repeat": "do"}
_ENDS = {
    "else": "else",
    "endif": "endif",
    "endwhile": "endwhile",
    "endfor": "endwhile",
    "endloop": "endwhile",
} | {"until": "while"}
_OPENED_BY = {
    "endif": "if",
    "else": "if",
    "endwhile": "while",
    "endfor": "for",
    "endloop": "loop",
    "until": "repeat",
}
_WITH_EXPRESSION = ("if", "while", "for", "until")


def variables_of(
    text: bytes, taken: Mapping[str, int], taken_arrays: Mapping[str, Array]
) -> tuple[dict[str, int], dict[str, Array]]:
    """Return the numbers, as parameters, of the variables that a file defines, and its arrays, by names.

    Names are in capitals. ``taken`` and ``taken_arrays`` are those of the files before.
    """
    numbers: dict[str, int] = {}
    arrays: dict[str, Array] = {}
    ends = [n + 1 for n in taken.values()] + [
        first + _size(*sizes) for first, *sizes in taken_arrays.values()
    ]
    free = {
        of_type: max((n for n in ends if first < n <= end), default=first)
        for of_type, (first, end) in _ROOM.items()
    }
    for of_type, name, rows, columns in _names_defined(text):
        size = _size(rows, columns)
        if name in numbers or name in arrays or free[of_type] + size > _ROOM[of_type][1]:
            continue
        if rows:
            arrays[name] = (free[of_type], rows, columns)
        else:
            numbers[name] = free[of_type]
        free[of_type] += size
    return numbers, arrays


def _size(rows: int, columns: int) -> int:
    return max(1, rows) * max(1, columns)


def _names_defined(text: bytes) -> Iterator[tuple[bytes, str, int, int]]:
    """Yield type and name of each variable that PROC and DEF define, and its sizes, 0 for none."""
    heading = _HEADING.match(text)
    for part in (heading["formals"] or b"").split(b",") if heading is not None else ():
        formal = _FORMAL.match(part)
        if formal is not None:
            yield formal["type"].upper(), formal["name"].upper().decode(), 0, 0
    for definition in _DEFINED.finditer(text):
        for part in _BETWEEN_COMMAS.findall(definition["names"].rstrip(b" \t\r")):
            name = _VARIABLE.match(part)
            if name is None:
                continue
            rows, columns = (int(name[size] or 0) for size in ("rows", "columns"))
            if _size(rows, columns) <= _MOST_ELEMENTS and (rows > 0 or not name["rows"]):
                yield definition["type"].upper(), name["name"].upper().decode(), rows, columns


def with_own_names(text: bytes, taken: Container[str]) -> bytes:
    """Return a subprogram whose variables have names that no file before has, each as long as it was."""
    for name in dict.fromkeys(name for _, name, *_ in _names_defined(text) if name in taken):
        free = next(
            other
            for letters in product(ascii_uppercase, repeat=2)
            if (other := "".join(letters) + name[2:]) not in taken and other.encode() not in text.upper()
        )
        text = re.sub(
            rb"(?<![A-Z0-9_])" + name.encode() + rb"(?![A-Z0-9_])", free.encode(), text, flags=re.IGNORECASE
        )
    return text


def formals_of(text: bytes, variables: Mapping[str, int]) -> list[int] | None:
    """Return the parameters that take a subprogram's arguments, None where one of them is not read."""
    heading = _HEADING.match(text)
    if heading is None:
        return []
    if re.search(rb"\bSAVE\b", heading["attributes"], _FLAGS):
        return None
    parts = heading["formals"].split(b",") if (heading["formals"] or b"").strip() else []
    formals = [_FORMAL.match(part) for part in parts]
    names = [formal["name"].upper().decode() for formal in formals if formal is not None]
    if len(names) < len(parts) or len(names) > tables.MOST_FORMALS or len(set(names)) < len(names):
        return None
    return [variables[name] for name in names]


class SiemensFlow:
    """Fills in the jumps, blocks and loops of one file."""

    def __init__(
        self,
        text: bytes,
        first_line: int,
        line_of_word: Ints,
        lines: NDArray[Any],
        word_of_row: Ints,
        rows_of_labels: Mapping[Label, int],
        known: Container[str],
    ) -> None:
        """Take the text of a file from its first line on, the line of each word of the program, its marked
        lines, the rows of subprograms by label, and the names in capitals that are none of subprograms."""
        self._rows_of_labels, self._known = rows_of_labels, known
        self.cases: list[tuple[int, int, int]] = []
        """Row of each CASE, a number of it, and the word to which that leads."""
        self._lines, self._word_of_row, self._line_of_word = lines, word_of_row, line_of_word
        self._flow = Flow(lines, word_of_row, {})
        self._open: list[tuple[str, int]] = []
        """The word of each block or loop that is open, and its row."""
        self._blocks: list[int] = []
        self._contents = text.split(b"\n")
        self._first_line = first_line
        self._words: dict[bytes, list[int]] = {}
        """Words at which the lines of a label or a block number begin, in their order."""
        names, numbers = [], []
        for line, content in enumerate(self._contents, start=first_line):
            match = _LINE.match(content)
            if match is None:
                continue
            for name in (match["label"], b"N%d" % int(match["block"]) if match["block"] else None):
                if name is not None:
                    names.append(name.upper())
                    numbers.append(line)
        words = np.searchsorted(line_of_word, np.array(numbers, np.int64)).tolist()
        for name, word in zip(names, words, strict=True):
            self._words.setdefault(name, []).append(word)

    def add(self, row: int, content: bytes) -> None:
        """Take the line of a row, in the order of the file; what does not lead elsewhere stays a block."""
        self._lines["kind"][row] = tables.KIND_BLOCK
        if (jump := _JUMP.match(content)) is not None:
            self._jump(row, jump)
        elif (section := _SECTION.match(content)) is not None:
            self._section(row, section)
        elif (block := _BLOCK.match(content)) is not None:
            self._block(row, block["word"].decode().lower(), block.end(), content)
        elif (case := _CASE.match(content)) is not None:
            self._case(row, case)
        elif (call := _CALL.match(content)) is not None and call["name"].upper().decode() not in self._known:
            self._lines["kind"][row] = tables.KIND_SIEMENS_CALL
            self._lines["subprogram"][row] = self._rows_of_labels[call["name"].lower().decode()]
            self._lines["expression"][row] = self._lines["start"][row] + call.start("behind")

    def finish(self) -> None:
        """Whatever is open at the end of the file has no end."""
        self._flow.finish()
        for row in self._blocks:
            if (
                self._lines["kind"][row] == tables.KIND_FAULT
                and self._lines["fault"][row] != findings.PF.FAULT_FOR_END
            ):
                self._lines["fault"][row] = findings.PF.FAULT_STRUCTURE

    # --- jumps ------------------------------------------------------------------------------------------

    def _jump(self, row: int, match: re.Match[bytes]) -> None:
        target = self._target(match["target"].upper(), match["way"].upper(), int(self._word_of_row[row]))
        if target is None:
            if match["way"].upper() != b"C":  # GOTOC goes on where there is no such label
                self._fault(row, findings.PF.FAULT_NO_LABEL)
            else:
                self._lines["kind"][row] = tables.KIND_NOTHING
            return
        self._lines["kind"][row] = tables.KIND_JUMP if match["test"] is None else tables.KIND_SIEMENS_IF
        self._lines["target"][row] = target
        if match["test"] is not None:
            self._lines["expression"][row] = self._lines["start"][row] + match.start("test")

    def _target(self, name: bytes, way: bytes, word: int) -> int | None:
        """Return the next line of a name forwards (F), the last one backwards (B), or either."""
        number = re.fullmatch(rb"N(\d+)", name)
        known = self._words.get(b"N%d" % int(number[1]) if number else name, [])
        split = bisect_right(known, word)
        if way != b"B" and split < len(known):
            return known[split]
        return known[split - 1] if way != b"F" and split else None

    def _case(self, row: int, match: re.Match[bytes]) -> None:
        at, word = match.start("ways"), int(self._word_of_row[row])
        self._lines["kind"][row] = tables.KIND_CASE
        self._lines["expression"][row] = self._lines["start"][row] + match.start("value")
        while (way := _WAY.match(match.string, at, match.end("ways"))) is not None:
            at = way.end()
            target = self._target(way["target"].upper(), way["way"].upper(), word)
            if target is None:
                self._fault(row, findings.PF.FAULT_NO_LABEL)
                return
            if way["number"] is not None:
                self.cases.append((row, int(way["number"]), target))
            else:
                self._lines["target"][row] = target
        if at == match.start("ways") or match.string[at : match.end("ways")].strip():
            self._fault(row, findings.PF.FAULT_CASE)

    def _fault(self, row: int, fault: int) -> None:
        self._lines["kind"][row], self._lines["fault"][row] = tables.KIND_FAULT, fault

    # --- blocks and loops -------------------------------------------------------------------------------

    def _block(self, row: int, word: str, behind: int, content: bytes) -> None:
        self._blocks.append(row)
        alone = word in _WITH_EXPRESSION or _ALONE.match(content, behind) is not None
        if word in _OPENS:
            self._open.append((word, row))
            self._flow.add(row, OLine(f"{row}", _OPENS[word], behind, alone))
        elif not self._open or self._open[-1][0] != _OPENED_BY[word]:
            self._fault(row, findings.PF.FAULT_STRUCTURE)
            self._flow.add_refused(row, is_o_line=True)
            return
        else:
            begin = self._open[-1][1]
            self._flow.add(row, OLine(f"{begin}", _ENDS[word], behind, alone))
            if word != "else":
                self._open.pop()
        if self._lines["kind"][row] != tables.KIND_FAULT:
            self._set_kind(row, word)

    def _set_kind(self, row: int, word: str) -> None:
        """Let a line be what its O-word is not."""
        lines = self._lines
        if word == "loop":
            lines["kind"][row] = tables.KIND_NOTHING
        elif word == "for":
            lines["kind"][row] = tables.KIND_FOR
        elif word == "until":
            lines["kind"][row] = tables.KIND_UNTIL
        elif word == "endfor":
            begin = int(np.flatnonzero(self._word_of_row == lines["target"][row])[-1])
            lines["kind"][row] = tables.KIND_ENDFOR
            lines["target"][row] += 1
            lines["expression"][row] = lines["expression"][begin]
            if self._sets_its_end(self._line_of(begin), self._line_of(row)):
                self._fault(begin, findings.PF.FAULT_FOR_END)

    def _line_of(self, row: int) -> int:
        return int(self._line_of_word[self._word_of_row[row]]) - self._first_line

    def _sets_its_end(self, first: int, last: int) -> bool:
        """Tell whether lines between FOR and ENDFOR set a parameter that the loop's end depends on."""
        end = _LOOP_END.search(self._contents[first])
        names = _NAMED.findall(end["end"]) if end is not None else []
        if not names:
            return False
        whole = [rb"R\d+" if name.upper() == b"R" else name for name in names]
        places = b"|".join(name + rb"(?:\[[^\]=]*\])?" for name in whole)
        if any(re.match(rb"R(?:\d|\Z)", name, re.IGNORECASE) for name in names):
            places += rb"|R\[[^\]=]*\]"
        sets = re.compile(rb"\b(?:" + places + rb")[ \t]*=(?!=)", re.IGNORECASE)
        return any(sets.search(content.split(b";")[0]) for content in self._contents[first + 1 : last])

    # --- repeated sections ------------------------------------------------------------------------------

    def _section(self, row: int, match: re.Match[bytes]) -> None:
        here = int(self._word_of_row[row])
        begin = self._only(match["first"])
        last = begin if match["one"] else self._only(match["last"]) if match["last"] else None
        if begin is None or (match["last"] and last is None):
            self._fault(row, findings.PF.FAULT_SECTION_LABEL)
            return
        if last is not None:
            until = self._behind(last)
        else:
            ends = [word for word in self._words.get(b"ENDLABEL", []) if word > begin]
            until = ends[0] if ends and not begin < here < ends[0] else here
        if until <= begin or begin <= here < until:
            self._fault(row, findings.PF.FAULT_SECTION_LABEL)
            return
        lines = self._lines
        lines["kind"][row], lines["target"][row], lines["end"][row] = tables.KIND_SECTION, begin, until
        times = match.start("times")
        lines["expression"][row] = lines["start"][row] + max(0, times)

    def _only(self, name: bytes) -> int | None:
        """Return the word of a label that stands once."""
        known = self._words.get(name.upper(), [])
        return known[0] if len(known) == 1 else None

    def _behind(self, word: int) -> int:
        """Return the word at which the line behind that of a word begins."""
        return int(np.searchsorted(self._line_of_word, self._line_of_word[word], side="right"))
