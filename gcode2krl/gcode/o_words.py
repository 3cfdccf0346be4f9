"""O-words: which line ends what, and where a program goes on behind each.

An O-line is looked at once a file: its label, its word, and the words (columns of the scanner) to which it
leads. A line whose label or word makes no sense gets its fault and is reported where it is executed. What a
program passes over may be anything, as in LinuxCNC, but for such a line: it may be the else or the end of
what it stands in, so an if or a loop around it is not entered.
"""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from numpy.typing import NDArray

from gcode2krl.arrays import Ints
from gcode2krl.gcode import findings
from gcode2krl.gcode import program_tables as tables

Label = str
"""A number without leading zeros, or a name in small letters and without blanks."""

_BLANKS = rb"[ \t\r]*"
_WORDS = (
    *("sub", "endsub", "call", "do", "while", "repeat", "if", "elseif", "else", "endif"),
    *("break", "continue", "endwhile", "endrepeat", "return"),
)
_WORD = b"|".join(_BLANKS.join(bytes([c]) for c in word.encode()) for word in _WORDS)
_LINE = re.compile(
    _BLANKS
    + rb"/?"
    + _BLANKS
    + rb"(?:N[\d. \t\r]*)?O"
    + _BLANKS
    + rb"(?:<(?P<name>[^>(;\n]*)>|(?P<number>\d[\d \t]*)(?:\.[0 \t]*)?|(?P<computed>(?=[#\[])))"
    + _BLANKS
    + rb"(?P<word>"
    + _WORD
    + rb")?",
    re.IGNORECASE,
)
_COMMENT_BEFORE = re.compile(rb"[^OoNn(]*(?:N[\d. \t\r]*)?\(", re.IGNORECASE)
_CALL = re.compile(_BLANKS.join((b"c", b"a", b"l", b"l")), re.IGNORECASE)
COMMENTS_TO_END = rb"[ \t\r\x1a]*(?:\([^()]*\)[ \t\r\x1a]*)*(?:;.*)?\Z"
"""Nothing but comments up to the end of a line, each closed."""
_ALONE = re.compile(COMMENTS_TO_END, re.DOTALL)
_WITHOUT_EXPRESSION = {"sub", "do", "else", "endif", "endwhile", "endrepeat", "break", "continue"}
_SPACE = re.compile(rb"[ \t\r]")


class OLine(NamedTuple):
    """What an O-line says."""

    label: Label
    word: str
    """Small letters; ``program`` for a number that stands alone, empty for what is no O-word, ``(`` where a
    comment stands before it."""
    behind: int
    """Bytes before its expressions; for a computed label, before the label."""
    ends: bool = True
    """Nothing but a comment stands behind a word that has no expression."""


def parsed(line: bytes) -> OLine:
    """Return what an O-line says, without its expressions."""
    match = _LINE.match(line)
    if match is None:
        return OLine("", "(" if _COMMENT_BEFORE.match(line) else "", 0)
    if match["computed"] is not None:
        word = "call" if _CALL.search(line, match.end("computed")) else ""
        return OLine("", word, match.end("computed"))
    name, number, word_found = match["name"], match["number"], match["word"]
    label = (
        _SPACE.sub(b"", name).lower().decode("latin-1")
        if name is not None
        else str(int(_SPACE.sub(b"", number)))
    )
    if word_found is not None:
        word = _SPACE.sub(b"", word_found).lower().decode()
        ends = word not in _WITHOUT_EXPRESSION or _ALONE.match(line, match.end()) is not None
        return OLine(label, word, match.end(), ends)
    alone = _ALONE.match(line, match.end()) is not None
    return OLine(label, "program" if alone and number is not None else "", match.end())


class Definition(NamedTuple):
    """Where a subprogram begins."""

    label: Label
    entry: int
    """Word of the line behind its first."""
    is_program: bool
    """O1000 … M99, which M98 calls; else sub … endsub."""


class _Open:
    """An if, while, do, repeat or sub whose end has not come yet."""

    def __init__(self, label: Label, word: str, row: int) -> None:
        self.label, self.word, self.row = label, word, row
        self.branches = [row]
        self.breaks: list[int] = []
        self.continues: list[int] = []
        self.unread: int | None = None
        """The first row inside that makes no sense."""
        self.end_unread = False
        """An O-line inside makes no sense: it may have been the end."""


class Flow:
    """Fills in the O-lines of one file."""

    def __init__(self, lines: NDArray[Any], word_of_row: Ints, rows_of_labels: Mapping[Label, int]) -> None:
        """Take the marked lines, the word at which each begins, and the rows of subprograms by label."""
        self.lines, self.word_of_row = lines, word_of_row
        self.rows_of_labels = rows_of_labels
        self.definitions: list[Definition] = []
        self._open: list[_Open] = []
        self._labels: list[set[Label]] = [set()]

    def add(self, row: int, line: OLine) -> None:
        """Take the O-line of a row, in the order of the file."""
        self.lines["expression"][row] = self.lines["start"][row] + line.behind
        if line.word == "(":
            self._fault(row, findings.PF.FAULT_NOT_FIRST)
            self.add_refused(row, is_o_line=True)
            return
        handler = getattr(self, f"_{line.word}", None) if line.word else None
        if handler is None:
            known = line.label or line.word
            self._unread(row, findings.PF.FAULT_WORD if known else findings.PF.FAULT_LABEL)
        elif not line.label and line.word != "call":
            self._unread(row, findings.PF.FAULT_LABEL)
        elif not line.ends:
            self._unread(row, findings.PF.FAULT_BEHIND)
        else:
            handler(row, line.label)

    def add_refused(self, row: int, *, is_o_line: bool) -> None:
        """Take a line that is refused even where it is passed over: whatever it stands in leads there."""
        for block in self._open:
            block.unread = row if block.unread is None else block.unread
            block.end_unread |= is_o_line

    def finish(self) -> None:
        """Whatever is open at the end of the file has no end."""
        self._close_all(0)

    # --- what every word does -------------------------------------------------------------------------

    def _set(self, row: int, kind: int, target: int = -1) -> None:
        self.lines["kind"][row] = kind
        self.lines["target"][row] = target

    def _fault(self, row: int, fault: int) -> None:
        self._set(row, tables.KIND_FAULT)
        self.lines["fault"][row] = fault

    def _unread(self, row: int, fault: int) -> None:
        """Take a line that makes no sense, and remember it for all that is open around it."""
        self._fault(row, fault)
        for block in reversed(self._open):
            if block.word == "sub":
                break
            block.unread = row if block.unread is None else block.unread
            block.end_unread = True

    def _lead_to_unread(self, closed: _Open) -> None:
        """Let what has a line inside that makes no sense lead there, so that it is reported."""
        if closed.unread is not None:
            self._set(closed.row, tables.KIND_JUMP, self._word(closed.unread))

    def _word(self, row: int) -> int:
        return int(self.word_of_row[row])

    def _begin(self, row: int, label: Label, word: str, kind: int) -> None:
        self._set(row, kind)
        if label in self._labels[-1]:
            self._fault(row, findings.PF.FAULT_LABEL_TWICE)
        self._labels[-1].add(label)
        self._open.append(_Open(label, word, row))

    def _end(self, row: int, label: Label, *words: str) -> _Open | None:
        """Return what a line ends; without it the line gets a fault."""
        if self._open and self._open[-1].label == label and self._open[-1].word in words:
            return self._open.pop()
        crossed = any(each.label == label and each.word in words for each in self._open)
        self._unread(row, findings.PF.FAULT_CROSSED if crossed else findings.PF.FAULT_NO_OPENING)
        return None

    def _close_all(self, depth: int) -> None:
        for block in self._open[depth:]:
            if self.lines["kind"][block.row] != tables.KIND_FAULT:
                self._fault(block.row, findings.PF.FAULT_NO_CLOSING)
            if block.end_unread:
                self._lead_to_unread(block)
        del self._open[depth:]

    def _set_jumps(self, rows: list[int], target: int) -> None:
        for row in rows:
            self._set(row, tables.KIND_JUMP, target)

    def _enclosing(self, label: Label, *words: str) -> _Open | None:
        return next((o for o in reversed(self._open) if o.label == label and o.word in words), None)

    # --- branches -------------------------------------------------------------------------------------

    def _if(self, row: int, label: Label) -> None:
        self._begin(row, label, "if", tables.KIND_IF)

    def _elseif(self, row: int, label: Label) -> None:
        self._branch(row, label, tables.KIND_ELSEIF)

    def _else(self, row: int, label: Label) -> None:
        self._branch(row, label, tables.KIND_ELSE)

    def _branch(self, row: int, label: Label, kind: int) -> None:
        block = self._end(row, label, "if")
        if block is None:
            return
        self._open.append(block)
        if self.lines["kind"][block.branches[-1]] == tables.KIND_ELSE:
            self._fault(row, findings.PF.FAULT_NO_OPENING)
            return
        self._set(row, kind)
        self.lines["target"][block.branches[-1]] = self._word(row)
        block.branches.append(row)

    def _endif(self, row: int, label: Label) -> None:
        block = self._end(row, label, "if")
        if block is None:
            return
        self._set(row, tables.KIND_ENDIF)
        self.lines["target"][block.branches[-1]] = self._word(row)
        self.lines["end"][block.branches] = self._word(row)
        self._lead_to_unread(block)

    # --- loops ----------------------------------------------------------------------------------------

    def _while(self, row: int, label: Label) -> None:
        if self._enclosing(label, "do") is None:
            self._begin(row, label, "while", tables.KIND_WHILE)
            return
        block = self._end(row, label, "do")
        if block is not None:
            self._set(row, tables.KIND_DO_WHILE, self._word(block.row) + 1)
            self._set_jumps(block.breaks, self._word(row) + 1)
            self._set_jumps(block.continues, self._word(row))
            self._lead_to_unread(block)

    def _do(self, row: int, label: Label) -> None:
        self._begin(row, label, "do", tables.KIND_NOTHING)

    def _repeat(self, row: int, label: Label) -> None:
        self._begin(row, label, "repeat", tables.KIND_REPEAT)

    def _endwhile(self, row: int, label: Label) -> None:
        self._end_loop(row, label, "while")

    def _endrepeat(self, row: int, label: Label) -> None:
        self._end_loop(row, label, "repeat")

    def _end_loop(self, row: int, label: Label, word: str) -> None:
        block = self._end(row, label, word)
        if block is None:
            return
        self._set(row, tables.KIND_JUMP, self._word(block.row))
        self.lines["target"][block.row] = self._word(row) + 1
        self._set_jumps(block.breaks, self._word(row) + 1)
        self._set_jumps(block.continues, self._word(block.row))
        self._lead_to_unread(block)

    def _break(self, row: int, label: Label) -> None:
        block = self._enclosing(label, "while", "do")
        self._fault(row, findings.PF.FAULT_NOT_IN_LOOP)  # until the loop ends
        if block is not None:
            block.breaks.append(row)

    def _continue(self, row: int, label: Label) -> None:
        block = self._enclosing(label, "while", "do")
        self._fault(row, findings.PF.FAULT_NOT_IN_LOOP)
        if block is not None:
            block.continues.append(row)

    # --- subprograms ----------------------------------------------------------------------------------

    def _call(self, row: int, label: Label) -> None:
        self._set(row, tables.KIND_CALL)
        self.lines["subprogram"][row] = self.rows_of_labels[label] if label else -1

    def _sub(self, row: int, label: Label) -> None:
        outer = self._sub_at_hand()
        if outer is not None:
            self._fault(row, findings.PF.FAULT_NESTED_SUB)
            self._fault(outer.row, findings.PF.FAULT_NESTED_SUB)
            return
        self._set(row, tables.KIND_SUB)
        self._open.append(_Open(label, "sub", row))
        self.lines["subprogram"][row] = self.rows_of_labels[label]
        self._labels.append(set())
        self.definitions.append(Definition(label, self._word(row) + 1, is_program=False))

    def _sub_at_hand(self) -> _Open | None:
        return next((each for each in self._open if each.word == "sub"), None)

    def _endsub(self, row: int, label: Label) -> None:
        block = self._sub_at_hand()
        if block is None or block.label != label:
            self._fault(row, findings.PF.FAULT_NOT_IN_SUB)
            return
        self._close_all(self._open.index(block) + 1)
        self._open.pop()
        self._labels.pop()
        self._set(row, tables.KIND_ENDSUB)
        self.lines["target"][block.row] = self._word(row) + 1
        self._lead_to_unread(block)

    def _return(self, row: int, _label: Label) -> None:
        # LinuxCNC leaves the subprogram whatever the label is: that of an if or a loop around it too
        if self._sub_at_hand() is None:
            self._fault(row, findings.PF.FAULT_NOT_IN_SUB)
        else:
            self._set(row, tables.KIND_RETURN)

    def _program(self, row: int, label: Label) -> None:
        self._set(row, tables.KIND_PROGRAM_NUMBER)
        if self._sub_at_hand() is not None:
            self._fault(row, findings.PF.FAULT_NESTED_SUB)
            return
        self._close_all(0)
        self._labels = [set()]
        self.definitions.append(Definition(label, self._word(row) + 1, is_program=True))
