"""Where this reader differs from LinuxCNC on purpose: rules that name their row of docs/gcode.md.

A rule explains one refusal, by the finding of this reader or by the words of ``rs274``. What no rule explains
is a fault of one of the two.
"""

import re

from gcode2krl.errors import Issue

_BY_G = {
    ("G7", "G8", "G70", "G71", "G71.1", "G71.2", "G72", "G72.1", "G72.2", "G76"): "G7, G8, G70 to G72.2",
    ("G5", "G5.1", "G5.2", "G5.3", "G6", "G6.1", "G6.2", "G6.3"): "G5 to G5.3, G6 to G6.3",
    ("G33", "G33.1", "G38.2", "G38.3", "G38.4", "G38.5"): "G33, G33.1 (coupled to the spindle)",
    ("G96",): "G96 with D",
    ("G87", "G88"): "G87, G88 | read",
    ("G43.4", "G43.5"): "G43.4, G43.5 | unknown",
}
_LENGTH_IN_INCHES = "`G20 G43 H2`, then `G21`, then `G49`"
_FORGOTTEN = "M6 behind a change of length, or of the rotation"
_TURNED = "G10 L2 R of the work offset in force"
_UNUSED_BESIDE_G10 = "G10 L2 P1.5, G10 L2 Q5"
_TWO_SIGNS = "two signs before a number"
_HERE = (
    ("rotary-axis", "", "A, B, C (U, V, W) with the value 0, no rotary axes declared"),
    ("o-word", "M98 takes P", "M98 beside a word other than P and L"),
    ("arc-turns", "", "an arc of more than 1000 turns"),
    ("tool-number", "", "M61 Qn | sets the tool number"),
    ("output-word", "", "M62-M65, M67, M68 | outputs"),
    ("two-uses", "would share its words P, Q or E", "M62-M68 beside G4, G64, an arc or a cycle"),
    ("unsupported-m", "", "M66 | waits for an input"),
    ("modes-restore", "shares its block", "M72 beside other words"),
    ("modes-restore", "tool length", "M72 where another tool length is in force"),
    ("modes-restore", "cutter compensation", "M70-M73 under cutter compensation"),
    ("tool-not-selected", "", "M6 without a T before it"),
    ("too-far", "", "a coordinate beyond 1000 m"),
    ("arc-too-long", "", "a coordinate beyond 1000 m"),
    ("g10-words", "", "G10 L1, L10, L11 without Z and R"),
    ("expression-value", "has turned the zero", _TURNED),
    ("parameter-undefined", "", "`#<a> = [#<a> + 1]` where"),
    ("parameter-read-only", "", "setting `#5161` to `#5390`"),
    ("expression-value", "length in the unit of the machine", "lengths of `#5161` to `#5390`"),
    ("expression-value", "tool table of the control", "`#5401` to `#5413`"),
    ("expression-value", "rotary or secondary axis", "`#5423` to `#5428`"),
    ("expression-value", "#<_feed>", "`#<_feed>`"),
    ("o-word", "behind this O-word", "something behind `else`"),
    ("expression", "behind the O-word", "something behind `else`"),
    ("o-word", "no beginning", "O-words that end in the wrong order"),
    ("o-word", "was begun outside", "O-words that end in the wrong order"),
    ("o-word", "no end", "O-words that end in the wrong order"),
    ("o-word", "M99 in the main program", "M99 in the main program"),
    ("cutter-on", "", "G10, G92.1 to G92.3 under G41, G42"),
    ("cutter-frame", "", "G41, G42 under a rotated work offset"),
    ("cycle-modes-changed", "", "a change of plane or unit within a row of cycles"),
    ("cutter-diameter", "", "G41, G42 with a tool that has no diameter, or without a tool"),
    ("polar", "", "`^` alone at the zero"),
    ("cycle", "", "R or the depth of a cycle kept from before"),
    ("dwell-with-arc", "", "G4 beside a modal arc"),
    ("dwell-with-cycle", "", "G4 beside a canned cycle"),
    ("tool-offset-across", "", "G10 L1 and G43.1 with X or Y"),
)
"""Code of a finding, words of its message: words of the row."""
_THERE = (
    (r"File ended with no percent sign", "no M2, M30 or % at the end"),
    (r"Unknown m code used|M-code greater than 199", "M-codes it does not know"),
    (r"Requested tool \d+ not found in the tool table", "G43 H, M6 with an undeclared tool"),
    (r"D word with no .*G0*[78]3(?!\d)", "D of G73 and G83, the clearance"),
    (r"G7x\.x +requires a Q word", "G70 behind G20, G71 behind G21"),
    (r"[IJK] word given for arc in", "a centre word 0 outside the plane of the arc"),
    (r"Cannot use two g codes from same modal group.*G0?[0-3]?.*80", "G80 beside G0"),
)
"""Words of ``rs274``: words of the row."""


def why_refused_here(issue: Issue) -> str:
    """Return the words of the row by which this reader refuses what LinuxCNC reads, '' if there is none."""
    if issue.code == "unsupported-g":
        number = re.match(r"G[\d.]+\d|G\d", issue.message)
        return next((row for codes, row in _BY_G.items() if number and number[0] in codes), "")
    if issue.code == "no-number" and re.search(r"[-+]\s*[-+]", issue.excerpt):
        return _TWO_SIGNS
    if issue.code == "unused-word" and re.search(r"G\s*0*10\s*L\s*0*2(?!\d)", issue.excerpt.replace("^", "")):
        return _UNUSED_BESIDE_G10
    return next((row for code, words, row in _HERE if issue.code == code and words in issue.message), "")


def why_refused_there(message: str) -> str:
    """Return the words of the row by which this reader reads what LinuxCNC refuses, '' if there is none."""
    return next((row for pattern, row in _THERE if re.search(pattern, message)), "")


def why_lost(program: bytes, difference: str) -> str:
    """Return the words of the row by which ``rs274`` loses a tool length or a rotation, '' if none."""
    points = re.findall(r"\[(-?[\d.e-]+), (-?[\d.e-]+), (-?[\d.e-]+)\]", difference)
    if len(points) != 2:
        return ""
    off = [abs(float(one) - float(other)) > 1e-5 for one, other in zip(*points, strict=True)]
    lines = program.decode("latin-1").upper().splitlines()
    if not (off[0] or off[1]):
        changed = [bool(re.search(r"G\s*4[39]|G\s*10\s*L", line)) for line in lines]
        if any(changed) and any(re.search(r"G\s*20(?!\d)", line) for line in lines):
            return _LENGTH_IN_INCHES
    else:
        turns = [bool(re.search(r"G\s*10.*L\s*2.*R", line)) for line in lines]
        changed = [
            turn or bool(re.search(r"G\s*5[4-9]", line)) for turn, line in zip(turns, lines, strict=True)
        ]
        if off[2] or not any(turns):
            return ""
    return _FORGOTTEN if _m6_follows(lines, changed) else ""


def _m6_follows(lines: list[str], changed: list[bool]) -> bool:
    """Tell whether M6 comes behind a change and before any move."""
    waits = False
    for line, changes in zip(lines, changed, strict=True):
        if waits and re.search(r"M\s*0*6(?!\d)", line):
            return True
        waits = changes or (waits and not re.search(r"[XYZ]\s*[-+.\d#\[]", line))
    return False


def why_unknown(program: bytes, is_known: bool) -> str:
    """Return the words of the row by which a place is unknown and ``rs274`` has another, '' if none."""
    text = program.decode("latin-1").upper()
    turned = re.search(r"G\s*10[^\n]*L\s*2[^\n]*R", text)
    return _TURNED if not is_known and turned and re.search(r"G\s*(52|92)", text) else ""


def rows() -> tuple[str, ...]:
    """Return the words of all rows that a rule names."""
    return (
        _TWO_SIGNS,
        _UNUSED_BESIDE_G10,
        _LENGTH_IN_INCHES,
        _FORGOTTEN,
        *_BY_G.values(),
        *(row for *_, row in _HERE),
        *(row for _, row in _THERE),
    )
