"""Positions of programs for a Fanuc, a Sinumerik and a Heidenhain, read once more: from the manuals, in
plain Python.

Nothing of the package is used. Only places are worked out: of moves, arcs' ends, drilled holes, subprograms,
jumps and loops, in G17, without rotary axes; beside a compensated contour, at one height, by `contour`.
`columns` makes of places what two readings can be compared by: at each X and Y the lowest, highest and last
Z, as the strokes of a hole differ by parameters. What this does not know raises `Unknown`, and the program is
not compared.
"""

import cmath
import functools
import math
import re

from tests.reference import contour

MOST_PLACES, SAME_MM = 2_000_000, 1e-7
_WORD = re.compile(r"([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+))")


class Unknown(Exception):  # noqa: N818
    """Something that is not read here."""


def places_of(toolpath):
    """Return the programmed places of a reading: of an arc the end alone, of what is not known None."""
    arc, at, known = toolpath.arc, toolpath.position_mm, toolpath.known
    rows = [
        k
        for k in range(1, len(arc))
        if not toolpath.machine[k]
        and (arc[k] < 0 or k + 1 == len(arc) or arc[k + 1] != arc[k])
        and (arc[k] >= 0 or (at[k] != at[k - 1]).any() or (known[k] != known[k - 1]).any() or known[k].all())
    ]
    return [
        tuple(float(p) if is_known else None for p, is_known in zip(at[k], toolpath.known[k], strict=True))
        for k in rows
    ]


def columns(places):
    """Return (X, Y, lowest Z, highest Z, last Z) for each row of places above each other; None is unknown."""
    found = []
    for x, y, z in places:
        if x is None and y is None and z is None:
            continue
        if not found or not all(_is_same(a, b) for a, b in zip(found[-1], (x, y), strict=False)):
            found.append([x, y, z, z, z])
            continue
        last = found[-1]
        unknown = z is None or last[2] is None
        last[2:] = [None, None, z] if unknown else [min(last[2], z), max(last[3], z), z]
    return found


def _is_same(a, b):
    return a == b or (a is not None and b is not None and abs(a - b) < SAME_MM)


def difference(ours, theirs, within_mm=1e-6):
    """Return the first column in which two readings differ, None where none does."""

    def far(a, b):
        return a is not None and b is not None and abs(a - b) > within_mm

    for k, (a, b) in enumerate(zip(ours, theirs, strict=False)):
        if any(far(p, q) for p, q in zip(a, b, strict=True)):
            return k, a, b
    return None if len(ours) == len(theirs) else (min(len(ours), len(theirs)), len(ours), len(theirs))


class _Machine:
    def __init__(self, radius=None):
        """Take the radius of every tool, None where it is not known."""
        self.radius, self.side, self.corners = radius, 0, "arc"
        self.elements, self.roundings, self.is_led, self.corner = [], [], False, None
        self.at = {"X": None, "Y": None, "Z": None}
        self.places, self.absolute, self.unit = [], True, 1.0
        self.shift = {"X": 0.0, "Y": 0.0, "Z": 0.0}

    def go(self, **to):
        self.at.update(to)
        self.places.append(tuple(self.at[axis] for axis in "XYZ"))
        if len(self.places) > MOST_PLACES:
            raise Unknown("too many places")

    def target(self, axis, value, incremental):
        value *= self.unit
        if not incremental:
            return value + self.shift[axis]
        if self.at[axis] is None:
            raise Unknown("counted from nowhere")
        return self.at[axis] + value

    def switch(self, side):
        """Begin a compensated contour on a side, 1 left of it, or end it with 0."""
        if side and self.radius is None:
            raise Unknown("radius of the tool")
        if side == self.side:
            return
        if self.elements:
            path = contour.tool_path(self.elements, self.side, self.radius, self.corners, self.roundings)
            self.places += [(p.real, p.imag, self.at["Z"]) for p in path]
        self.elements, self.roundings, self.is_led, self.side = [], [], False, side

    def move(self, to, centre=None, turn=0, corner=None, feeds=True):
        """Go to where axes lead, straight or by an arc; ``corner`` is what is made behind this move."""
        before = dict(self.at)
        here = None if None in (before["X"], before["Y"]) else complex(before["X"], before["Y"])
        after = {**before, **to}
        across = (
            here is not None
            and None not in (after["X"], after["Y"])
            and here != complex(after["X"], after["Y"])
        )
        if self.side and (across or turn) and not self.is_led:
            if turn or corner:
                raise Unknown("an arc or a corner leads in")
            self.is_led = True
        elif self.side and self.is_led:
            if not (across or turn) or "Z" in to:
                raise Unknown("a move along the tool beside a contour")
            self.elements.append((here, complex(after["X"], after["Y"]), centre, turn))
            self.roundings.append(corner)
        elif corner or self.corner:
            self._round(here, complex(after["X"], after["Y"]), turn, corner, feeds)
        elif not self.side or not self.elements:
            self.go(**to)
        self.at = after

    def _round(self, here, there, turn, corner, feeds):
        if turn or not feeds:
            raise Unknown("a corner beside an arc or a rapid")
        if self.corner:
            before, kind, value = self.corner
            made = contour.rounded([before, contour.line(here, there)], [(kind, value), None])
            for element in made[1:]:
                self.go(X=element[0].real, Y=element[0].imag)
            here = made[-1][0]
        self.corner = (contour.line(here, there), *corner) if corner else None
        if not corner:
            self.go(X=there.real, Y=there.imag)

    def hole(self, approach, bottom, leave):
        for z in (approach, bottom, leave):
            self.go(Z=z)


def fanuc(text):
    """Return the places of a program for a Fanuc or Haas (a number without a point is in units)."""
    lines = [re.sub(r"\([^)]*\)", "", line).split(";")[0].upper().strip() for line in text.splitlines()]
    starts = {int(m[1]): k for k, line in enumerate(lines) if (m := re.fullmatch(r"[O:]\s*(\d+)", line))}
    numbers = {}
    for k, line in enumerate(lines):
        if m := re.match(r"/?\s*N\s*(\d+)", line):
            numbers.setdefault(int(m[1]), []).append(k)
    run = _Machine()
    state = {"g": 0, "level": None, "r": None, "z": None, "g98": True, "cycle": 0}
    _fanuc_lines(lines, 0, starts, numbers, run, state, 0)
    return run.places


def _fanuc_lines(lines, k, starts, numbers, run, state, depth):
    begun = k
    while k < len(lines):
        line = lines[k].lstrip("/").strip()
        k += 1
        if re.fullmatch(r"[O:]\s*\d+", line) and k - 1 > begun and depth:
            raise Unknown("subprogram without an end")
        if not line or line == "%" or re.match(r"[O:]\s*\d+$", line):
            continue
        if re.search(r"[#\[\],]|IF|GOTO|WHILE", line):
            raise Unknown("macro")
        words = [(a, float(v)) for a, v in _WORD.findall(line)]
        if re.sub(r"\s", "", _WORD.sub("", line)):
            raise Unknown(line)
        w = dict(words)
        gs, ms = {v for a, v in words if a == "G"}, {v for a, v in words if a == "M"}
        if (
            gs & {41, 42, 16, 68, 51, 52, 92, 10, 65, 66, 18, 19, 54.1, 43.4, 76, 87, 88}
            or "A" in w
            or "B" in w
        ):
            raise Unknown("G-code")
        run.unit = 25.4 if 20 in gs else 1.0 if 21 in gs else run.unit
        run.absolute = True if 90 in gs else False if 91 in gs else run.absolute
        state["g98"] = True if 98 in gs else False if 99 in gs else state["g98"]
        axes = {a: v for a, v in w.items() if a in "XYZ"}
        if gs & {28, 30, 53}:
            for axis in axes:
                run.at[axis] = None
            if {"X", "Y"} <= set(axes):
                run.at["Z"] = None
        elif 4 not in gs:
            _fanuc_move(gs, w, axes, run, state)
        if ms & {98, 97}:
            number = int(w["P"])
            times = int(w.get("L", 1)) if number < 10000 or 97 in ms else number // 10000
            number = number % 10000 if 98 in ms and number >= 10000 else number
            place = numbers.get(number, [None])[0] if 97 in ms else starts.get(number)
            if place is None or depth > 8:
                raise Unknown("subprogram")
            for _ in range(times):
                if _fanuc_lines(lines, place + (98 in ms), starts, numbers, run, state, depth + 1):
                    return True
        if 99 in ms:
            return False
        if ms & {2, 30}:
            return True
    return True


def _fanuc_move(gs, w, axes, run, state):
    cycles = {73, 74, 81, 82, 83, 84, 85, 86, 89}
    named = gs & ({0, 1, 2, 3} | cycles)
    if 80 in gs:
        state["cycle"] = 0
    if named:
        code = int(named.pop())
        if code in cycles and not state["cycle"]:
            state["level"] = run.at["Z"]
        state["cycle"] = code if code in cycles else 0
        state["g"] = code if code < 4 else state["g"]
    if state["cycle"]:
        if "R" in w:
            state["r"] = w["R"] * run.unit if run.absolute else state["level"] + w["R"] * run.unit
        if "Z" in w:
            state["z"] = w["Z"] * run.unit if run.absolute else state["r"] + w["Z"] * run.unit
        if not axes:
            return
        times = int(w.get("K", w.get("L", 1)))
        for _ in range(times):
            if run.at["Z"] is not None and run.at["Z"] < state["r"]:
                run.go(Z=state["r"])
            run.go(**{a: run.target(a, v, not run.absolute) for a, v in axes.items() if a != "Z"})
            top = (
                max(state["level"], state["r"]) if state["g98"] and state["level"] is not None else state["r"]
            )
            if state["g98"] and state["level"] is None:
                raise Unknown("level")
            run.hole(state["r"], state["z"], top)
    elif axes or (state["g"] > 1 and {"I", "J"} & set(w)):
        run.go(**{a: run.target(a, v, not run.absolute) for a, v in axes.items()})


_SIEMENS = {
    "SIN": lambda a: math.sin(math.radians(a)),
    "COS": lambda a: math.cos(math.radians(a)),
    "TAN": lambda a: math.tan(math.radians(a)),
    "SQRT": math.sqrt,
    "ABS": abs,
    "TRUNC": math.trunc,
    "POT": lambda a: a * a,
    "ROUND": lambda a: math.floor(a + 0.5),
}


@functools.cache
def _code(text):
    python = re.sub(r"<>", "!=", text.strip().upper())
    python = (
        re.sub(r"\b(AND|OR|NOT)\b", lambda m: m[1].lower(), python).replace("DIV", "//").replace("MOD", "%")
    )
    return compile(re.sub(r"(?<![\w.])0+(\d)", r"\1", python), "expression", "eval")


def _value(text, variables):
    """Return the value of an expression of a Sinumerik or Heidenhain."""
    try:
        return float(
            eval(_code(text), {"__builtins__": {}, **_SIEMENS, "R": _Parameters(variables)}, variables)
        )
    except Exception as error:
        raise Unknown(text) from error


_BRACKET = r"\([^()]*\)"
for _ in range(3):  # brackets within brackets
    _BRACKET = rf"\((?:[^()]|{_BRACKET})*\)"
_ADDRESS = re.compile(
    rf"([A-Z_]+\w*)=((?:[^\s();\[\]]|\[[^\]]*\]|{_BRACKET})+)|([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+))"
)
_SAID = (
    r"\b(?:MSG\s*\([^)]*\)|COMPCAD|COMPOF|FFWON|FFWOF|SOFT|BRISK|STOPRE|F?NORM|CYCLE832\s*\([^)]*\)|TRAFOOF|CYCLE800\(\)|SETMS\(\d\)"
    r"|G64[0-9]*|ADIS\s*=\S+)"
)


class _Array:
    """An array of a Sinumerik: indices are whole numbers from 0 on, one or two."""

    def __init__(self, sizes):
        self.sizes = [int(size) for size in sizes]
        self.values = [0.0] * math.prod(self.sizes)

    def place(self, index):
        """Return the place of an element."""
        index = index if isinstance(index, tuple) else (index,)
        if len(index) != len(self.sizes) or any(
            i != int(i) or not 0 <= i < n for i, n in zip(index, self.sizes, strict=True)
        ):
            raise Unknown("index")
        return int(index[0]) if len(index) == 1 else int(index[0]) * self.sizes[1] + int(index[1])

    def __getitem__(self, index):
        return self.values[self.place(index)]

    def fill(self, first, text, variables):
        """Give elements the values of SET(…) or REP(…), or one."""
        m = re.match(r"(SET|REP)\((.*)\)$", text)
        values = [_value(part, variables) for part in m[2].split(",")] if m else [_value(text, variables)]
        if m and m[1] == "REP":
            values *= len(self.values) - first
        self.values[first : first + len(values)] = values


class _Parameters:
    """R parameters by a number that is worked out: R[R1+2]."""

    def __init__(self, variables):
        self.variables = variables

    def __getitem__(self, index):
        return self.variables[f"R{int(index)}"]


def _outside_brackets(text):
    """Return the parts of a text between the commas that stand in no bracket."""
    return re.findall(r"(?:[^,(\[]|\([^()]*\)|\[[^\]]*\])+", text)


def siemens(text, programs=None, radius=None):
    """Return the places of a program for a Sinumerik 840D.

    ``programs`` are texts of subprograms by name, ``radius`` is that of every tool.
    """
    run, variables = _Machine(radius), {f"R{n}": 0.0 for n in range(100)}
    _siemens_program(text, run, variables, {"g": 0, "modal": None}, programs or {}, 0)
    return run.places


def _siemens_call(line, run, variables, state, programs, depth):
    """Run a subprogram that a line calls; return whether it is such a line."""
    m = re.match(r"([A-Z_]{2}\w*|L\d+)\s*(?:\((.*)\))?\s*(?:P\s*=?\s*(\d+))?$", line)
    if m is None or m[1] not in programs or m[1] in ("HOLES1", "HOLES2", "CYCLE801"):
        return False
    if depth > 8:
        raise Unknown("calls")
    heading = re.search(r"^\s*(?:N\d+)?\s*PROC\s+\w+\s*\(([^)]*)\)", programs[m[1]], re.MULTILINE | re.I)
    formals = [part.split()[-1].upper() for part in heading[1].split(",")] if heading else []
    given = [_value(part, variables) if part.strip() else 0.0 for part in (m[2] or "").split(",")]
    for _ in range(int(m[3] or 1)):
        inner = {name: value for name, value in variables.items() if re.fullmatch(r"R\d+", name)}
        shared = list(inner)
        inner.update(dict(zip(formals, given + [0.0] * len(formals), strict=False)))
        _siemens_program(programs[m[1]], run, inner, state, programs, depth + 1)
        variables.update({name: inner[name] for name in shared})
    return True


def _siemens_case(line, variables, labels):
    """Return where a CASE leads, None where it goes on."""
    m = re.match(r"CASE\b(.*?)\bOF\b(.*)$", line)
    value = _value(m[1], variables)
    for number, default, label in re.findall(r"(?:(-?\d+)|(DEFAULT))\s+GOTO[FB]?\s+(\w+)", m[2]):
        if default or float(number) == value:
            return labels[label]
    return None


def _siemens_program(text, run, variables, state, programs, depth):
    lines = [line.split(";")[0].upper().strip() for line in text.splitlines()]
    lines = [re.sub(r"\s*([=+*/<>,-])\s*|(?<=\()\s+|\s+(?=\))", r"\1", line) for line in lines]
    lines = [re.sub(r"\)(?=[A-Z])", ") ", line) for line in lines]
    lines = [re.sub(r"^/?\s*N\d+\s*", "", line) for line in lines]
    labels, codes = {}, []
    for k, line in enumerate(lines):
        found = re.match(r"([A-Z_]{2}\w*)\s*:(?!=)\s*", line)
        if found:
            labels[found[1]] = k
        codes.append(line[found.end() :] if found else line)
    pairs = _blocks(codes)
    k, stack, steps = 0, [], 0
    while k < len(codes):
        steps += 1
        if steps > MOST_PLACES:
            raise Unknown("endless")
        while stack and stack[-1][1] == k and stack[-1][2] == 0:
            k = stack.pop()[3]
        if stack and stack[-1][1] == k:
            stack[-1][2] -= 1
            k = stack[-1][0]
        line = codes[k]
        here, k = k, k + 1
        if (m := re.match(r"(?:IF\s+(.*?)\s*)?GOTO([FB]?)\s+(\w+)$", line)) is not None:
            if m[1] is None or _value(m[1], variables):
                k = labels[m[3]]
        elif (m := re.match(r"(IF|WHILE|UNTIL)\b(.*)$", line)) is not None:
            if not _value(m[2], variables):
                k = pairs[here] if m[1] == "UNTIL" else pairs[here] + 1
        elif re.match(r"(ELSE|ENDWHILE|ENDLOOP)\b", line):
            k = pairs[here] + (line == "ELSE")
        elif (m := re.match(r"FOR\s+(\w+)\s*=(.*)\bTO\b(.*)$", line)) is not None:
            variables[m[1]] = _value(m[2], variables)
            if variables[m[1]] > _value(m[3], variables):
                k = pairs[here] + 1
        elif line == "ENDFOR":
            m = re.match(r"FOR\s+(\w+)\s*=(.*)\bTO\b(.*)$", codes[pairs[here]])
            variables[m[1]] += 1
            if variables[m[1]] <= _value(m[3], variables):
                k = pairs[here] + 1
        elif (m := re.match(r"REPEAT\s+(\w+)(?:\s+(?!P\s*=)(\w+))?(?:\s+P\s*=\s*(.*))?$", line)) is not None:
            end = labels[m[2]] + 1 if m[2] else here
            times = int(_value(m[3], variables)) if m[3] else 1
            if times:
                stack.append([labels[m[1]], end, times - 1, k])
                k = labels[m[1]]
        elif line.startswith("CASE"):
            k = _siemens_case(line, variables, labels) or k
        elif re.match(r"(ENDIF|LOOP|REPEAT|PROC .*|EXTERN.*)$", line) or _siemens_call(
            line, run, variables, state, programs, depth
        ):
            continue
        elif line == "RET" or _siemens_block(line, run, variables, state):
            break


def _blocks(codes):
    """Return where each IF, ELSE, loop and end leads."""
    pairs, stack = {}, []
    for k, line in enumerate(codes):
        word = re.match(r"[A-Z]*", line)[0]
        if (word == "IF" and "GOTO" not in line) or word in ("WHILE", "FOR", "LOOP") or line == "REPEAT":
            stack.append(k)
        elif word == "ELSE":
            pairs[stack.pop()] = k
            stack.append(k)
        elif word in ("ENDIF", "ENDWHILE", "ENDFOR", "ENDLOOP", "UNTIL"):
            begin = stack.pop()
            pairs[k], pairs[begin] = begin, k
    return pairs


def _siemens_block(line, run, variables, state):
    """Carry out one block; return whether the program ends."""
    if (m := re.match(r"DEF\s+(?:REAL|INT|BOOL)\s+(.*)$", line)) is not None:
        for part in _outside_brackets(m[1]):
            name, _, value = part.partition("=")
            sizes = re.match(r"\s*(\w+)\[(.*)\]\s*$", name)
            if sizes:
                variables[sizes[1]] = _Array(sizes[2].split(","))
                if value:
                    variables[sizes[1]].fill(0, value, variables)
            else:
                variables[name.strip()] = _value(value, variables) if value else 0.0
        return False
    while (m := re.match(r"(\w+)\[([^=]*)\]=(\S+)\s*", line)) is not None:
        index = tuple(_value(part, variables) for part in _outside_brackets(m[2]))
        if m[1] == "R":
            variables[f"R{int(index[0])}"] = _value(m[3], variables)
        else:
            array = variables[m[1]]
            array.fill(array.place(index), m[3], variables)
        line = line[m.end() :]
    line = re.sub(_SAID, " ", line)
    if line.startswith("%") or line.startswith("WORKPIECE"):
        return False
    modal = "MCALL" in line
    cycle = re.search(r"CYCLE(8[123])\s*\((.*)\)", line)
    if (pattern := re.match(r"(HOLES1|HOLES2|CYCLE801)\((.*)\)$", line)) is not None:
        _siemens_pattern(
            pattern[1],
            [_value(part, variables) if part else 0.0 for part in pattern[2].split(",")],
            run,
            state,
        )
        return False
    if cycle or modal:
        hole = _siemens_hole(cycle, variables) if cycle else None
        if modal:
            state["modal"] = hole
        else:
            run.hole(*hole)
        return False
    frame = re.match(r"(A?)TRANS\b", line)
    machine = re.search(r"\bSUPA\b|\bG53\b", line)
    rest = re.sub(r"\bSUPA\b|\bA?TRANS\b|T\s*=\s*\"[^\"]*\"", " ", line)
    words = [(m[1] or m[3], m[2] or m[4]) for m in _ADDRESS.finditer(rest)]
    if re.sub(r"\s", "", _ADDRESS.sub("", rest)):
        raise Unknown(line)
    gs = {float(v) for a, v in words if a == "G"}
    ms = {float(v) for a, v in words if a == "M"}
    if gs & {18, 19, 110, 111, 112, 58, 59, 33, 331, 70}:
        raise Unknown("G-code")
    run.unit = 25.4 if 700 in gs else 1.0 if gs & {71, 710} else run.unit
    run.absolute = True if 90 in gs else False if 91 in gs else run.absolute
    moves = {int(g) for g in gs} & {0, 1, 2, 3}
    state["g"] = moves.pop() if moves else state["g"]
    if gs & {450, 451} and run.elements:
        raise Unknown("other corners within a contour")
    run.corners = "meeting" if 451 in gs else "arc" if 450 in gs else run.corners
    if gs & {40, 41, 42}:
        run.switch(1 if 41 in gs else -1 if 42 in gs else 0)
    to, corner, words_of_arc = {}, None, {}
    for address, value in words:
        if address in ("X", "Y", "Z"):
            way = value[:2] if value[:2] in ("AC", "IC") else ""
            to[address] = (
                _value(value[len(way) :], variables),
                way == "IC" or (not way and not run.absolute),
            )
        elif address in variables:
            variables[address] = _value(value, variables)
        elif address in ("RND", "CHR", "CHF"):
            corner = (address, _value(value, variables) * run.unit)
        elif address in ("I", "J", "CR"):
            words_of_arc[address] = value
        elif machine and address in ("A", "B", "C"):
            continue
        elif address not in ("G", "M", "F", "S", "T", "D", "N", "K", "TURN", "P", "S1", "H"):
            raise Unknown(address)
    if frame:
        for axis in run.shift:
            value = to.get(axis, (0.0, False))[0] * run.unit
            run.shift[axis] = run.shift[axis] + value if frame[1] else value
    elif machine:
        for axis in to:
            run.at[axis] = None
    elif 4 not in gs and (to or (state["g"] > 1 and any(a in ("I", "J") for a, _ in words))):
        there = {axis: run.target(axis, *value) for axis, value in to.items()}
        run.move(
            there, *_siemens_arc(run, there, words_of_arc, state["g"], variables), corner, state["g"] > 0
        )
        if state["modal"]:
            run.hole(*state["modal"])
    return bool(ms & {2, 17, 30})


def _siemens_arc(run, to, words, g, variables):
    """Return centre and turn of an arc, None and 0 for a straight move; the centre under G41 alone."""
    if g < 2:
        return None, 0
    turn = 1 if g == 3 else -1
    if not run.side:
        return None, turn
    if "CR" not in words:
        parts = []
        for axis, letter in (("X", "I"), ("Y", "J")):
            value = words.get(letter, "0")
            absolute = value.startswith("AC")
            part = _value(value[2:] if absolute else value, variables) * run.unit
            parts.append(part + (run.shift[axis] if absolute else run.at[axis]))
        return complex(*parts), turn
    here, there = (
        complex(run.at["X"], run.at["Y"]),
        complex(to.get("X", run.at["X"]), to.get("Y", run.at["Y"])),
    )
    return _centre(here, there, _value(words["CR"], variables) * run.unit, turn), turn


def _centre(here, there, radius, turn):
    """Return the centre of the arc of a radius, below 0 the longer one."""
    half = (there - here) / 2
    away = math.sqrt(max(0.0, radius**2 - abs(half) ** 2)) * (1 if radius > 0 else -1)
    return here + half + turn * 1j * half / abs(half) * away


def _siemens_pattern(name, given, run, state):
    """Drill a row, a circle or a grid of holes from where the tool stands."""
    here = complex(run.at["X"] - run.shift["X"], run.at["Y"] - run.shift["Y"])
    begin = complex(given[0], given[1])
    if name == "HOLES2":
        radius, first, step, count = abs(given[2]), given[3], given[4], int(given[5])
        step = step or 360 / count
        places = [begin + radius * cmath.exp(1j * math.radians(first + k * step)) for k in range(count)]
    else:
        way = cmath.exp(1j * math.radians(given[2]))
        if name == "HOLES1":
            places = [begin + (given[3] + k * given[4]) * way for k in range(int(given[5]))]
            if abs(here - places[-1]) < abs(here - places[0]):
                places.reverse()
        else:
            d1, d2, n1, n2 = given[3], given[4], int(given[5]), int(given[6])
            at = (here - begin) / way
            xs, ys = [k * d1 for k in range(n1)], [k * d2 for k in range(n2)]
            xs = xs[::-1] if at.real > xs[-1] / 2 else xs
            ys = ys[::-1] if at.imag > ys[-1] / 2 else ys
            outer, inner = (ys, xs) if d1 <= d2 else (xs, ys)
            grid = [(a, c) for k, a in enumerate(outer) for c in (inner if k % 2 == 0 else inner[::-1])]
            places = [begin + (complex(c, a) if d1 <= d2 else complex(a, c)) * way for a, c in grid]
    for place in places:
        run.go(X=place.real + run.shift["X"], Y=place.imag + run.shift["Y"])
        run.hole(*state["modal"])


def _siemens_hole(cycle, variables):
    given = [_value(part, variables) if part.strip() else None for part in cycle[2].split(",")]
    given += [None] * 8
    rtp, rfp, sdis, dp, dpr = given[:5]
    if dp is not None and dpr and dp != rfp:
        raise Unknown("two depths")
    return rfp + (sdis or 0.0), rfp - dpr if dpr else dp, rtp


def heidenhain(text, radius=None):
    """Return the places of a conversational program; ``radius`` is that of every tool."""
    logical = []
    for line in text.splitlines():
        goes_on = line.rstrip().endswith("~")
        code = " ".join(re.sub(r"^\s*\d+\s+", "", line.rstrip(" ~\r")).split(";")[0].upper().split())
        if logical and logical[-1][1]:
            logical[-1] = (f"{logical[-1][0]} {code}", goes_on)
        else:
            logical.append((code, goes_on))
    codes = [re.sub(r"\bCYCLE DEF\b", "CYCL DEF", code.replace(",", ".")) for code, _ in logical]
    labels = {m[1]: k for k, code in enumerate(codes) if (m := re.match(r"LBL (\S+)$", code)) and m[1] != "0"}
    codes = _with_corners(codes)
    run, q = _Machine(radius), {}
    state = {"pole": {}, "hole": None}
    _heidenhain_lines(codes, 0, labels, run, q, state, 0)
    return run.places


def _with_corners(codes):
    """Return the lines, those of RND and CHF behind the line to whose end they belong."""
    found = []
    for code in codes:
        if (m := re.match(r"(RND|CHF) ?R?([\d.]+)(?: F\S+)?$", code)) is not None and found:
            at = next(k for k in reversed(range(len(found))) if found[k])
            found[at] += f" [{'RND' if m[1] == 'RND' else 'CHR'} {m[2]}]"
            found.append("")
        else:
            found.append(code)
    return found


def _heidenhain_lines(codes, k, labels, run, q, state, depth):
    repeats = {}
    while k < len(codes):
        code = codes[k]
        here, k = k, k + 1
        if code == "LBL 0" and depth:
            return False
        if (m := re.match(r"CALL LBL (\S+?)(?: REP ?(\d+)\S*)?$", code)) is not None:
            if m[2] is None:
                if depth > 8 or _heidenhain_lines(codes, labels[m[1]] + 1, labels, run, q, state, depth + 1):
                    return True
            elif repeats.setdefault(here, int(m[2])) > 0:
                repeats[here] -= 1
                k = labels[m[1]]
            else:
                del repeats[here]
        elif (m := re.match(r"FN ?(9|1[012]) ?: ?IF (\S+) (\S+) (\S+) GOTO LBL (\S+)$", code)) is not None:
            a, b = _value(m[2], q), _value(m[4], q)
            if {"EQU": a == b, "NE": a != b, "GT": a > b, "LT": a < b}[m[3]]:
                k = labels[m[5]]
        elif (m := re.match(r"(?:FN ?\d ?: ?)?(Q\d+) ?= ?(.*)$", code)) is not None:
            q[m[1]] = _value(m[2].replace(" DIV ", " / "), q)
        elif _heidenhain_block(code, run, q, state):
            return True
    return True


def _heidenhain_block(code, run, q, state):
    head = code.split(" ")[0] if code else ""
    if head in ("", "BLK", "TOOL", "BEGIN", "LBL", "STOP", "*") or code.startswith("*"):
        return False
    if head == "END":
        return True
    if head == "CYCL":
        return _heidenhain_cycle(code, run, q, state)
    if head == "CC":
        for axis, value in re.findall(r"([XY]) ?([+-]?[\dQ.]+)", code):
            state["pole"][axis] = _value(value, q)
        return False
    if head in ("L", "C", "CR", "CT") or re.match(r"M\d", head):
        code, _, behind = code.partition(" [")
        corner = (behind.split(" ")[0], float(behind.split(" ")[1].rstrip("]"))) if behind else None
        if re.search(r"\b[ABC][+-]?\d|\bPLANE|\bM128", code):
            raise Unknown("rotary axes")
        if (side := re.search(r"\bR([0LR])\b", code)) is not None:
            run.switch({"0": 0, "L": 1, "R": -1}[side[1]])
        to = {}
        for incremental, axis, value in re.findall(r"(?:^| )(I?)([XYZ]) ?([+-]?[\dQ.]+)", code):
            to[axis] = (_value(value, q), bool(incremental))
        machine = re.search(r"\bM91\b", code) or "M140" in code
        if machine:
            for axis in to or {"Z": 0}:
                run.at[axis] = None
        elif to or head == "C":
            there = {axis: run.target(axis, *value) for axis, value in to.items()}
            run.move(there, *_heidenhain_arc(head, code, there, run, q, state), corner)
        if re.search(r"\bM99\b", code):
            run.hole(*_heidenhain_hole(run, state))
        return re.search(r"\bM(?:0?2|30)\b", code) is not None
    if head == "CP" and (m := re.search(r"IPA ?([+-]?[\d.]+)", code)) and float(m[1]) % 360 == 0:
        z = re.search(r"IZ ?([+-]?[\d.]+)", code)
        run.go(Z=run.at["Z"] + (float(z[1]) if z else 0.0))
        return False
    raise Unknown(code)


def _heidenhain_arc(head, code, to, run, q, state):
    """Return centre and turn of an arc, None and 0 for a straight move; the centre beside a contour alone."""
    if head not in ("C", "CR", "CT"):
        return None, 0
    way = re.search(r"\bDR ?([+-])", code)
    turn = 1 if way is None or way[1] == "+" else -1
    if not run.side:
        return None, turn
    if head == "C":
        return complex(state["pole"]["X"] + run.shift["X"], state["pole"]["Y"] + run.shift["Y"]), turn
    if head == "CT":
        raise Unknown("CT beside a contour")
    here, there = (
        complex(run.at["X"], run.at["Y"]),
        complex(to.get("X", run.at["X"]), to.get("Y", run.at["Y"])),
    )
    radius = re.search(r"(?<!D)R ?([+-]?[\d.]+)", code)
    return _centre(here, there, _value(radius[1], q), turn), turn


def _heidenhain_hole(run, state):
    """Return the hole of the cycle in force; that of cycle 1 begins where the tool stands."""
    if not state.get("pecking"):
        return state["hole"]
    top = run.at["Z"]
    return top, top - state["pecking"]["1"] + state["pecking"]["2"], top


def _heidenhain_cycle(code, run, q, state):
    if code.startswith("CYCL CALL"):
        if "POS" in code or "PAT" in code:
            raise Unknown(code)
        run.hole(*_heidenhain_hole(run, state))
    elif (m := re.match(r"CYCL DEF 1\.([12])\D*?([+-]?[\d.]+)$", code)) is not None:
        state["pecking"] = {**state.get("pecking", {}), m[1]: float(m[2])}
    elif re.match(r"CYCL DEF (?:200|201|203|207)\b", code):
        given = {name: _value(value, q) for name, value in re.findall(r"Q(2\d\d) ?= ?([+-]?[\dQ.]+)", code)}
        top = given["203"] + max(given["200"], given.get("204", 0.0))
        state["pecking"] = {}
        state["hole"] = (given["203"] + given["200"], given["203"] + given["201"], top)
    elif (m := re.match(r"CYCL DEF 7\.\d ([XYZ]) ?([+-]?[\d.]+)$", code)) is not None:
        run.shift[m[1]] = float(m[2])
    elif not re.match(r"CYCL DEF (?:1\.|7\.0|9\.|32|247)", code):
        raise Unknown(code)
    return False


READERS = {"fanuc": fanuc, "sinumerik": siemens, "heidenhain": heidenhain}
