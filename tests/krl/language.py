"""A parser of KRL for tests, written from public facts about the language; it imports nothing of gcode2krl.

`parse_program` takes the texts of a program by file name, checks them as a controller does when it links
them, and returns a `Program` that `execution.py` runs; `parse_module` takes one file. What is wrong raises
`KrlError` with file and line. The grammar of a line is in `grammar.lark`; blocks are nested here.

An expression is a tuple: ``("number", 1.5)``, ``("truth", True)``, ``("text", "ab")``, ``("enum", "#BASE")``,
``("reference", ((name, indices), ...))`` with indices a tuple of expressions, ``()`` for ``[]`` or None,
``("call", name, arguments)``, ``("aggregate", ((components, expression), ...))``, ``("unary", operator, a)``,
``("binary", operator, a, b)``.

Facts: KUKA, "Expert Programming" (KSS 5.2) and "Operating and Programming Instructions for System
Integrators" (KSS 8.3): structure of files, declarations, names of at most 24 characters, priority of
operators, motions, TRIGGER, INTERRUPT. Not refused, as no public source states them: the longest line, the
most nested blocks, the largest program.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from lark import Lark, Token, Transformer, Tree
from lark.exceptions import LarkError, UnexpectedInput, UnexpectedToken

LONGEST_NAME = 24


class KrlError(Exception):
    """What a controller would refuse: ``file``, ``line`` (1-based) and a sentence."""

    def __init__(self, file: str, line: int, sentence: str) -> None:
        """Take the place and the sentence."""
        super().__init__(f"{file}:{line}: {sentence}")
        self.file, self.line, self.sentence = file, line, sentence


@dataclass(slots=True)
class Statement:
    """A statement: its kind (the name of a rule of the grammar), what it says, the blocks inside it."""

    kind: str
    file: str
    line: int
    values: tuple = ()
    blocks: list[Any] = field(default_factory=list)
    """Lists of statements: of IF two; of SWITCH pairs (expressions or None, statements)."""


@dataclass(slots=True)
class Variable:
    """A declared variable."""

    type: str
    sizes: tuple | None = None
    is_const: bool = False
    is_global: bool = False
    initial: Any = None


@dataclass(slots=True)
class Routine:
    """A DEF or DEFFCT."""

    name: str
    file: str
    line: int
    parameters: tuple[tuple[str, str], ...] = ()
    """Names with "IN" or "OUT"."""
    returns: str | None = None
    is_global: bool = False
    variables: dict[str, Variable] = field(default_factory=dict)
    body: list[Statement] = field(default_factory=list)


@dataclass(slots=True)
class Module:
    """A file: routines of a .src, or the data of a .dat."""

    name: str
    file: str
    is_data: bool
    routines: dict[str, Routine] = field(default_factory=dict)
    variables: dict[str, Variable] = field(default_factory=dict)
    assignments: list[Statement] = field(default_factory=list)
    """Elements of arrays that a .dat sets."""
    externals: dict[str, int] = field(default_factory=dict)
    """EXT and EXTFCT: name to the number of parameters."""
    types: set[str] = field(default_factory=set)
    enum_values: set[str] = field(default_factory=set)


@dataclass(slots=True)
class Program:
    """Modules that belong together; ``main`` is the routine that is started."""

    modules: dict[str, Module]
    """By upper-case file name."""
    main: Routine
    routines: dict[str, Routine]
    """The first routine of each .src, and those that are GLOBAL."""
    externals: dict[str, int]
    """What EXT names and no file of the program defines."""
    has_globals: bool = False

    def data_of(self, file: str) -> Module | None:
        """Return the .dat of a .src."""
        return self.modules.get(re.sub(r"\.SRC$", ".DAT", file.upper()))

    def local_routines(self, file: str) -> dict[str, Routine]:
        """Return the routines of a file."""
        return self.modules[file.upper()].routines


# --- words of the controller ---------------------------------------------------------------------------


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


KEYWORDS = _words(
    """
    AND ANIN ANOUT BOOL BRAKE B_AND B_EXOR B_NOT B_OR CASE CHAR CIRC CIRC_REL CONST CONTINUE C_DIS C_ORI C_PTP
    C_SPL C_VEL DECL DEF DEFAULT DEFDAT DEFFCT DELAY DO ELSE END ENDDAT ENDFCT ENDFOR ENDIF ENDLOOP ENDSPLINE
    ENDSWITCH ENDWHILE ENUM EXIT EXOR EXT EXTFCT FALSE FOR GLOBAL GOTO HALT IF IMPORT INT INTERRUPT LIN
    LIN_REL
    LOOP NOT OR PRIO PTP PTP_REL PUBLIC REAL REPEAT RESUME RETURN SCIRC SEC SIGNAL SLIN SPL SPLINE SPTP STRUC
    SWITCH THEN TO TRIGGER TRUE UNTIL WAIT WHEN WHILE
    """
)
TYPES = _words(
    """
    INT REAL BOOL CHAR FRAME POS E6POS E3POS AXIS E6AXIS E3AXIS LOAD INERTIA CP PTP_PARAMS ADAP_ACC
    BAS_COMMAND
    KRLMSG_T KRLMSGPAR_T KRLMSGOPT_T KRLMSGDLGSK_T FDAT LDAT PDAT MODULEPARAM_T CIRC_TYPE ORI_TYPE IPO_M_T
    STATE_T EX_KIN MODE_OP
    """
)
READ_ONLY = _words(
    """
    $AXIS_ACT $AXIS_ACT_MEAS $POS_ACT $POS_ACT_MES $IN $ANIN $TRAFONAME $STOPMESS $EX_AX_NUM $ROBROOT_C
    $MODE_OP $PRO_STATE $PRO_MODE $T1 $T2 $AUT $EXT $ALARM_STOP $PERI_RDY $USER_SAF $ROB_STOPPED $VEL_ACT
    $AXIS_INT $POS_INT $AXIS_RET $POS_RET $AXIS_BACK $AXIS_FOR $POS_BACK $POS_FOR $DISTANCE $NULLFRAME
    $MODEL_NAME $ROBRUNTIME $DATE $KR_SERIALNO $AXIS_HOME $IN_HOME $H_POS $POWER_FAIL $OUT_C_DUMMY
    """
)
WRITABLE = _words(
    """
    $BASE $TOOL $LOAD $VEL $ACC $APO $VEL_AXIS $ACC_AXIS $VEL_EXTAX $ACC_EXTAX $ORI_TYPE $CIRC_TYPE $IPO_MODE
    $ADVANCE $ACT_BASE $ACT_TOOL $ACT_EX_AX $OV_PRO $OUT $OUT_C $ANOUT $FLAG $CYCFLAG $TIMER $TIMER_STOP
    $TIMER_FLAG $SEN_PINT $SEN_PREA $SEN_DEL $SEN_PINT_C $SEN_PREA_C $TECH $WORLD $ROBROOT $LOAD_A1 $LOAD_A2
    $LOAD_A3 $BRAKE_SIG $CMD $GEAR_JERK $JERK $CP_STATMON $ORI_CONST $COULD_START_MOTION $TSYS
    """
)
SYSTEM_VARIABLES = READ_ONLY | WRITABLE
CONFIGURED = _words("BASE_DATA TOOL_DATA LOAD_DATA MACHINE_DEF BASE_NAME TOOL_NAME")
"""Variables of $CONFIG.DAT and the machine data."""
CONSTANTS = _words("RSIOK PI")
FUNCTIONS: dict[str, tuple[int, int]] = {
    **dict.fromkeys(
        _words("ABS SQRT SIN COS TAN ACOS INV_POS INVERSE_FRAME STRLEN STRDECLEN STRCLEAR"), (1, 1)
    ),
    **dict.fromkeys(_words("ATAN2 STRADD STRCOPY VARTYPE SYNCCMD"), (2, 2)),
    **dict.fromkeys(_words("STRFIND"), (4, 4)),
    **dict.fromkeys(_words("STRCOMP PULSE EK EB FORWARD"), (3, 3)),
    **dict.fromkeys(_words("EO INVERSE"), (2, 3)),
    **dict.fromkeys(_words("SREAD SWRITE CAST_TO CAST_FROM CREAD CWRITE COPEN CCLOSE"), (2, 99)),
    **dict.fromkeys(_words("SET_KRLMSG"), (4, 4)),
    **dict.fromkeys(_words("EXISTS_KRLMSG CLEAR_KRLMSG"), (1, 1)),
    "SET_KRLDLG": (4, 4),
    "VARSTATE": (1, 1),
    "RSI_CREATE": (1, 3),
    "RSI_ON": (0, 4),
    "RSI_OFF": (0, 0),
    "RSI_MOVECORR": (0, 1),
    "RSI_DELETE": (1, 1),
    "IR_STOPM": (0, 0),
    "BAS": (2, 2),
}
"""Functions and standard modules of the controller: fewest and most arguments. RSI as in RSI 3."""
POSE_KEYS = ("X", "Y", "Z", "A", "B", "C", "S", "T")
AXIS_KEYS = ("A1", "A2", "A3", "A4", "A5", "A6")
EXTERNAL_KEYS = ("E1", "E2", "E3", "E4", "E5", "E6")

# --- a line --------------------------------------------------------------------------------------------

_CODE = re.compile(r'"[^"]*"|[^";]+|;.*|"')
_PLAIN_MOTION = re.compile(r"(LIN|PTP|SPL) ?\{([A-Z0-9 .,+-]+)\}(?: (C_DIS))?")
_COMPONENT = re.compile(r"([A-Z][A-Z0-9]*) +(-?\d+(?:\.\d*)?)")


class _Shaper(Transformer):
    """Makes tuples of the grammar's rules."""

    def NAME(self, token: Token) -> str:
        if len(token) > LONGEST_NAME:
            raise ValueError(f"{token} is longer than {LONGEST_NAME} characters")
        return str(token)

    def integer(self, c: list) -> tuple:
        return ("number", int(c[0]))

    def bits(self, c: list) -> tuple:
        return ("number", int(c[0][2:-1], 16 if c[0][1] == "H" else 2))

    def real(self, c: list) -> tuple:
        return ("number", float(c[0]))

    def string(self, c: list) -> tuple:
        return ("text", str(c[0][1:-1]))

    def truth(self, c: list) -> tuple:
        return ("truth", c[0] == "TRUE")

    def enum_value(self, c: list) -> tuple:
        return ("enum", str(c[0]))

    def index(self, c: list) -> tuple:
        return tuple(c)

    def component(self, c: list) -> tuple:
        return (c[0], () if isinstance(c[1], Token) else c[1])

    def reference(self, c: list) -> tuple:
        return ("reference", tuple(c))

    def call(self, c: list) -> tuple:
        return ("call", c[0], tuple(a for a in c[1:] if a is not None))

    def value(self, c: list) -> tuple:
        return (c[0], c[1])

    def aggregate(self, c: list) -> tuple:
        seen = [name for (name, _), _ in c[1:]]
        for name in seen:
            if seen.count(name) > 1:
                raise ValueError(f"{name} stands twice in an aggregate")
        return ("aggregate", tuple(c[1:]))

    def unary(self, c: list) -> tuple:
        if c[0] == "-" and c[1][0] == "number":
            return ("number", -c[1][1])
        return ("unary", str(c[0]), c[1])

    def binary(self, c: list) -> tuple:
        return ("binary", str(c[1]), c[0], c[2])

    def __default__(self, data: Any, children: list, meta: Any) -> Any:
        if data.startswith("__"):  # lark's helpers of repetitions, which it takes apart itself
            return Tree(data, children)
        return (str(data).rstrip("_"), *(str(c) if isinstance(c, Token) else c for c in children))


_PARSER = Lark(
    Path(__file__).with_name("grammar.lark").read_text(),
    start="line",
    parser="lalr",
    lexer="contextual",
    maybe_placeholders=True,
    transformer=_Shaper(),
)


def code_of(text: str) -> str:
    """Return a line without comment, in capitals outside of strings."""
    if ";" not in text and '"' not in text:
        return text.strip().upper()
    pieces = []
    for piece in _CODE.findall(text):
        if piece[0] == ";":
            break
        pieces.append(piece if piece[0] == '"' else piece.upper())
    return "".join(pieces).strip()


@lru_cache(maxsize=4096)
def _parsed(code: str) -> tuple:
    try:
        return _PARSER.parse(code)
    except UnexpectedInput as error:
        if isinstance(error, UnexpectedToken) and error.token.type == "$END":
            raise ValueError("the line is not complete") from None
        raise ValueError(f"not KRL from {code[error.column - 1 :][:40]!r} on") from None
    except LarkError as error:
        raise ValueError(str(error)) from None


def parse_line(code: str) -> tuple:
    """Return what a line without its comment says: (rule, values ...). Raises ValueError."""
    plain = _PLAIN_MOTION.fullmatch(code)
    if plain:
        parts = [_COMPONENT.fullmatch(part.strip()) for part in plain[2].split(",")]
        if all(parts):
            keys = [part[1] for part in parts]
            if len(set(keys)) < len(keys):
                raise ValueError("a component stands twice in an aggregate")
            values = tuple(((part[1], None), ("number", float(part[2]))) for part in parts)
            approximation = [("approximation", plain[3])] if plain[3] else []
            if plain[1] == "SPL":
                return ("spline_move", "SPL", ("aggregate", values), None, *approximation)
            return ("move", plain[1], ("aggregate", values), *approximation)
    return _parsed(code)


# --- a file --------------------------------------------------------------------------------------------

_DECLARING = _words("ext extfct decl struc enum signal")
_OPENS = {
    "if": "endif",
    "while": "endwhile",
    "for": "endfor",
    "loop": "endloop",
    "repeat": "until",
    "switch": "endswitch",
    "spline": "endspline",
}
_CLOSES = {end: opening for opening, end in _OPENS.items()}
_IN_SPLINE = _words("spline_move spline_arc trigger endspline")


def parse_module(text: str | bytes, file: str) -> Module:
    """Return one .src or .dat; raises `KrlError`. What other files declare is not known here."""
    return _Reader(text, file).module


class _Reader:
    def __init__(self, text: str | bytes, file: str) -> None:
        if isinstance(text, bytes):
            text = text.decode("latin-1")
        self.file, self.line = file, 0
        is_data = file.lower().endswith(".dat")
        self.module = Module(re.split(r"[\\/]", file)[-1].rsplit(".", 1)[0].upper(), file, is_data)
        self.routine: Routine | None = None
        self.open: list[Statement] = []
        self.bodies: list[list[Statement]] = []
        self.has_begun = self.has_ended = False
        folds: list[int] = []
        for self.line, raw in enumerate(re.split(r"\r?\n", text), start=1):
            if raw.startswith("&"):
                if self.has_begun:
                    self.refuse("a header line stands behind the beginning of the program")
                continue
            comment = raw.lstrip()
            if comment[:5].upper() == ";FOLD":
                folds.append(self.line)
            elif comment[:8].upper() == ";ENDFOLD":
                if not folds:
                    self.refuse("ENDFOLD without FOLD")
                folds.pop()
            code = code_of(raw)
            if not code:
                continue
            try:
                said = parse_line(code)
            except ValueError as error:
                self.refuse(str(error))
            self.has_begun = True
            self.take(said)
        if folds:
            self.line = folds[-1]
            self.refuse("FOLD without ENDFOLD")
        if self.routine is not None or (is_data and not self.has_ended):
            self.refuse("the end is missing")
        if not is_data and not self.module.routines:
            self.refuse("no DEF")

    def refuse(self, sentence: str) -> None:
        raise KrlError(self.file, self.line, sentence)

    def take(self, said: tuple) -> None:
        kind = said[0]
        if self.module.is_data:
            self.take_data(kind, said)
        elif self.routine is None:
            if kind not in ("def", "deffct"):
                self.refuse(f"{kind.upper()} outside of a DEF")
            self.begin(kind, said)
        elif kind in ("def", "deffct", "defdat", "enddat"):
            self.refuse(f"{kind.upper()} inside of a DEF: an END is missing")
        elif kind in ("end", "endfct"):
            self.finish(kind)
        elif kind in _DECLARING:
            if self.routine.body or self.open:
                self.refuse("a declaration stands behind the first statement")
            self.declare(said, self.routine.variables)
        else:
            self.nest(said)

    def take_data(self, kind: str, said: tuple) -> None:
        if self.has_ended:
            self.refuse("something stands behind ENDDAT")
        if kind == "defdat":
            if self.routine is not None:
                self.refuse("DEFDAT inside of DEFDAT")
            if said[1] != self.module.name:
                self.refuse(f"DEFDAT {said[1]} in a file named {self.module.name}")
            self.routine = Routine(said[1], self.file, self.line)
        elif self.routine is None:
            self.refuse("DEFDAT is missing")
        elif kind == "enddat":
            self.routine, self.has_ended = None, True
        elif kind in _DECLARING:
            self.declare(said, self.module.variables)
        elif kind == "assign":
            self.module.assignments.append(Statement("assign", self.file, self.line, said[1:]))
        else:
            self.refuse("a data list has declarations only")

    def name(self, name: str) -> str:
        if name in KEYWORDS:
            self.refuse(f"{name} is a word of KRL")
        return name

    def begin(self, kind: str, said: tuple) -> None:
        is_function = kind == "deffct"
        name = self.name(said[3] if is_function else said[2])
        if name in self.module.routines:
            self.refuse(f"{name} is defined twice")
        if not self.module.routines and name != self.module.name:
            self.refuse(f"the first DEF, {name}, is not named as its file")
        listed = said[-1][1:] if said[-1] else ()
        parameters = tuple((self.name(p[1]), p[2] or "OUT") for p in listed)
        for parameter, way in parameters:
            if way not in ("IN", "OUT"):
                self.refuse(f"{parameter} is neither IN nor OUT")
        self.routine = Routine(name, self.file, self.line, parameters, said[2][1] if is_function else None)
        self.routine.is_global = said[1] is not None
        self.bodies = [self.routine.body]

    def finish(self, kind: str) -> None:
        routine = self.routine
        if self.open:
            opening = self.open[-1]
            self.refuse(f"{_OPENS[opening.kind].upper()} of line {opening.line} is missing")
        if (kind == "endfct") != (routine.returns is not None):
            self.refuse("DEF ends with END, DEFFCT with ENDFCT")
        for parameter, _ in routine.parameters:
            if parameter not in routine.variables:
                self.refuse(f"the parameter {parameter} has no type")
        self.module.routines[routine.name] = routine
        self.routine = None

    def declare(self, said: tuple, variables: dict[str, Variable]) -> None:
        kind, module = said[0], self.module
        if kind in ("ext", "extfct"):
            name, listed = (said[1], said[2]) if kind == "ext" else (said[2], said[3])
            module.externals[self.name(name)] = len(listed[1:]) if listed else 0
            return
        if kind == "struc":
            module.types.add(self.name(said[2]))
            return
        if kind == "enum":
            module.types.add(self.name(said[2]))
            module.enum_values.update(f"#{value}" for value in said[3:])
            return
        if kind == "signal":
            variables[self.name(said[2])] = Variable("SIGNAL", None, False, said[1] is not None)
            return
        marks = [part for part in said[1:] if isinstance(part, str)]
        ((_, type_name),) = [part for part in said[1:] if part[0] == "type"]
        if type_name not in TYPES | module.types:
            self.refuse(f"{type_name} is no type")
        for part in said[1:]:
            if part[0] != "declared":
                continue
            _, name, sizes, initial = part
            if self.name(name) in variables:
                self.refuse(f"{name} is declared twice")
            if initial is not None and not module.is_data:
                self.refuse("an initial value stands in a .dat only")
            if "CONST" in marks and initial is None:
                self.refuse(f"the constant {name} has no value")
            variables[name] = Variable(type_name, sizes, "CONST" in marks, "GLOBAL" in marks, initial)

    def nest(self, said: tuple) -> None:
        kind = said[0]
        statement = Statement(kind, self.file, self.line, said[1:])
        inner = self.open[-1].kind if self.open else None
        if inner == "spline" and kind not in _IN_SPLINE:
            self.refuse(f"{kind.upper()} in a SPLINE block")
        if inner == "switch" and not self.open[-1].blocks and kind not in ("case", "default", "endswitch"):
            self.refuse("a statement before the first CASE")
        if kind in _OPENS:
            self.bodies[-1].append(statement)
            self.open.append(statement)
            body: list[Statement] = []
            if kind != "switch":
                statement.blocks.append(body)
            self.bodies.append(body)
        elif kind in _CLOSES:
            if inner != _CLOSES[kind]:
                self.refuse(f"{kind.upper()} without its beginning")
            self.open[-1].values += said[1:]
            self.open.pop()
            self.bodies.pop()
        elif kind == "else":
            if inner != "if" or len(self.open[-1].blocks) > 1:
                self.refuse("ELSE without IF")
            self.bodies[-1] = []
            self.open[-1].blocks.append(self.bodies[-1])
        elif kind in ("case", "default"):
            if inner != "switch" or (self.open[-1].blocks and self.open[-1].blocks[-1][0] is None):
                self.refuse(f"{kind.upper()} without SWITCH, or behind DEFAULT")
            self.bodies[-1] = []
            self.open[-1].blocks.append((said[1:] if kind == "case" else None, self.bodies[-1]))
        else:
            if kind == "exit" and not any(s.kind in ("loop", "while", "for", "repeat") for s in self.open):
                self.refuse("EXIT outside of a loop")
            self.bodies[-1].append(statement)


# --- a program -----------------------------------------------------------------------------------------


def parse_program(
    texts: Mapping[str, str | bytes], main: str | None = None, *, has_globals: bool = False
) -> Program:
    """Return the program of some .src and .dat by file name; ``main`` is the .src that is started.

    ``has_globals``: the integrator's $CONFIG.DAT declares variables; then unknown names are taken for such,
    but not those that begin with $ or GK_. Without ``main`` it is the first .src. Other files (sidecars, XML)
    are passed over. Raises `KrlError`.
    """
    modules = {
        file.upper(): parse_module(text, file)
        for file, text in texts.items()
        if file.lower().endswith((".src", ".dat"))
    }
    sources = [module for module in modules.values() if not module.is_data]
    if not sources:
        raise KrlError(main or "", 0, "no .src")
    started = modules[main.upper()] if main else sources[0]
    routines: dict[str, Routine] = {}
    for module in sources:
        for k, routine in enumerate(module.routines.values()):
            if k == 0 or routine.is_global:
                if routine.name in routines:
                    raise KrlError(routine.file, routine.line, f"{routine.name} is defined in two files")
                routines[routine.name] = routine
    externals = {
        name: count
        for module in modules.values()
        for name, count in module.externals.items()
        if name not in routines
    }
    program = Program(modules, next(iter(started.routines.values())), routines, externals, has_globals)
    for module in sources:
        for routine in module.routines.values():
            _Checker(program, module, routine).check()
    return program


def statements_in(body: list[Statement]) -> Iterator[Statement]:
    """Yield the statements of a body and of all blocks inside it."""
    for statement in body:
        yield statement
        for block in statement.blocks:
            yield from statements_in(block[1] if isinstance(block, tuple) else block)


_NUMBERS, _FRAMES = ("INT", "REAL"), ("FRAME", "POS", "E6POS", "E3POS")
_SYSTEM_KINDS = {
    **dict.fromkeys(_words("$OUT $IN $STOPMESS $FLAG $CYCFLAG $T1 $T2 $PERI_RDY $ROB_STOPPED"), "truth"),
    **dict.fromkeys(
        _words("$ADVANCE $ACT_BASE $ACT_TOOL $OV_PRO $ANOUT $ANIN $SEN_PINT $SEN_PREA $EX_AX_NUM"), "number"
    ),
    **dict.fromkeys(
        _words("$BASE $TOOL $ROBROOT $ROBROOT_C $WORLD $NULLFRAME $POS_ACT BASE_DATA TOOL_DATA"), "frame"
    ),
    **dict.fromkeys(_words("$ORI_TYPE $CIRC_TYPE $IPO_MODE"), "enum"),
    "$TRAFONAME": "text",
}
_FUNCTION_KINDS = dict.fromkeys(_words("ABS SQRT SIN COS TAN ACOS ATAN2 STRFIND STRLEN SET_KRLMSG"), "number")
_INTERRUPTS = {*range(1, 40), *range(81, 129)}


class _Checker:
    """Names, numbers of arguments and kinds of values in a routine."""

    def __init__(self, program: Program, module: Module, routine: Routine) -> None:
        self.program, self.module, self.routine = program, module, routine
        self.line = routine.line
        data = program.data_of(module.file)
        self.shared = data.variables if data is not None else {}
        self.global_variables = {
            name: variable
            for other in program.modules.values()
            for name, variable in other.variables.items()
            if variable.is_global
        }

    def refuse(self, sentence: str) -> None:
        raise KrlError(self.routine.file, self.line, sentence)

    def check(self) -> None:
        for statement in statements_in(self.routine.body):
            self.line = statement.line
            getattr(self, f"check_{statement.kind}", self.check_parts)(statement)

    def check_parts(self, statement: Statement) -> None:
        for value in (
            *statement.values,
            *(c for b in statement.blocks if isinstance(b, tuple) for c in b[0] or ()),
        ):
            self.part(value)

    def part(self, value: Any) -> None:
        if not isinstance(value, tuple) or not value:
            return
        if value[0] == "assign" or value[0] == "assigned":
            self.check_assign(Statement("assign", self.routine.file, self.line, value[1:]))
        elif value[0] == "call_statement":
            self.kind(value[1])
        elif value[0] != "approximation":
            self.kind(value)

    def check_assign(self, statement: Statement) -> None:
        target, value = statement.values
        name = target[1][0][0]
        variable = self.variable(name)
        if name in READ_ONLY or name in CONSTANTS or (variable is not None and variable.is_const):
            self.refuse(f"{name} cannot be assigned")
        wanted, given = self.kind(target), self.kind(value)
        if wanted and given and wanted != given and (wanted, given) != ("frame", "aggregate"):
            self.refuse(f"{name} is a {wanted}, the value a {given}")

    def check_if(self, statement: Statement) -> None:
        self.condition(statement.values[0])

    check_while = check_until = check_wait_for = check_repeat = check_if

    def check_wait_sec(self, statement: Statement) -> None:
        if self.kind(statement.values[0]) not in ("number", None):
            self.refuse("WAIT SEC takes a number")

    def check_for(self, statement: Statement) -> None:
        name = statement.values[0]
        variable = self.variable(name)
        is_global = variable is None and self.program.has_globals and not name.startswith(("$", "GK_"))
        if not is_global and (variable is None or variable.type != "INT"):
            self.refuse(f"{name} of FOR is no declared INT")
        for value in statement.values[1:]:
            if value is not None:
                self.kind(value)

    def check_interrupt_decl(self, statement: Statement) -> None:
        _, number, condition, action = statement.values
        self.interrupt_number(number)
        self.condition(condition)
        self.part(action)

    def check_interrupt(self, statement: Statement) -> None:
        if statement.values[1] is not None:
            self.interrupt_number(statement.values[1])

    def interrupt_number(self, number: tuple) -> None:
        if number[0] == "number" and number[1] not in _INTERRUPTS:
            self.refuse(f"no interrupt has the number {number[1]}")

    def check_trigger(self, statement: Statement) -> None:
        way, place, delay, action, priority = statement.values
        if way == "DISTANCE" and place[0] == "number" and place[1] not in (0, 1):
            self.refuse("DISTANCE is 0 or 1")
        self.kind(place)
        self.kind(delay)
        self.part(action)
        if action[0] == "call_statement" and priority is None:
            self.refuse("a subprogram of a TRIGGER needs PRIO")
        if priority is not None and priority[0] == "number" and priority[1] not in _INTERRUPTS | {-1}:
            self.refuse(f"no trigger has the priority {priority[1]}")

    def check_move(self, statement: Statement) -> None:
        word, *values = statement.values
        blends = [value[1] for value in values if value and value[0] == "approximation"]
        if (word == "LIN" and set(blends) & {"C_PTP", "C_SPL"}) or (word == "PTP" and "C_SPL" in blends):
            self.refuse(f"{blends[0]} at {word}")
        for value in values:
            if value and value[0] == "aggregate":
                self.target(word, value)
            elif isinstance(value, tuple):
                self.part(value)

    check_spline_move = check_move

    def check_arc(self, statement: Statement) -> None:
        self.target("CIRC", statement.values[1])
        self.check_move(Statement("move", "", 0, (statement.values[0], statement.values[2])))

    def target(self, word: str, value: tuple) -> None:
        if value[0] != "aggregate":
            self.kind(value)
            return
        keys = [components[0] for components, _ in value[1]]
        in_axes = any(key in AXIS_KEYS for key in keys)
        known = (AXIS_KEYS if in_axes else POSE_KEYS) + EXTERNAL_KEYS
        if in_axes and word not in ("PTP", "SPTP"):
            self.refuse(f"{word} to axis angles")
        for key in keys:
            if key not in known:
                self.refuse(f"{key} in the target of {word}")
        for _, inner in value[1]:
            if self.kind(inner) not in ("number", None):
                self.refuse("a component of a target is no number")

    def check_return(self, statement: Statement) -> None:
        value = statement.values[0]
        if (value is not None) != (self.routine.returns is not None):
            self.refuse("RETURN has a value in a DEFFCT, and only there")
        if value is not None:
            self.kind(value)

    def check_goto(self, statement: Statement) -> None:
        labels = {s.values[0] for s in statements_in(self.routine.body) if s.kind == "label"}
        if statement.values[0] not in labels:
            self.refuse(f"there is no label {statement.values[0]}")

    def condition(self, value: tuple) -> None:
        if self.kind(value) not in ("truth", None):
            self.refuse("a condition is no BOOL")

    def variable(self, name: str) -> Variable | None:
        for scope in (self.routine.variables, self.shared, self.global_variables):
            if name in scope:
                return scope[name]
        return None

    def kind(self, value: tuple) -> str | None:
        """Return "number", "truth", "text", "enum", "frame", "aggregate", or None where it is not known."""
        node = value[0]
        if node in ("number", "truth", "text", "enum"):
            return node
        if node == "reference":
            return self.reference_kind(value[1])
        if node == "call":
            return self.call_kind(value)
        if node == "aggregate":
            for _, inner in value[1]:
                self.kind(inner)
            return "aggregate"
        if node == "unary":
            return self.unary_kind(value)
        return self.binary_kind(value)

    def reference_kind(self, components: tuple) -> str | None:
        for _, indices in components:
            for index in indices or ():
                if self.kind(index) not in ("number", None):
                    self.refuse("an index is no number")
        name = components[0][0]
        if name in KEYWORDS:
            self.refuse(f"{name} is a word of KRL")
        variable = self.variable(name)
        is_known = variable is not None or name in SYSTEM_VARIABLES | CONFIGURED | CONSTANTS
        if not is_known and (not self.program.has_globals or name.startswith(("$", "GK_"))):
            self.refuse(f"{name} is not declared")
        if len(components) > 1:
            if variable is not None and variable.type in ("INT", "REAL", "BOOL", "CHAR"):
                self.refuse(f"{name} has no components")
            return "number" if components[-1][0] in (*POSE_KEYS, *AXIS_KEYS, *EXTERNAL_KEYS) else None
        if variable is None:
            return _SYSTEM_KINDS.get(name)
        if components[0][1] is not None and variable.sizes is None:
            self.refuse(f"{name} is no array")
        if variable.type in _NUMBERS:
            return "number"
        return "truth" if variable.type == "BOOL" else "frame" if variable.type in _FRAMES else None

    def call_kind(self, value: tuple) -> str | None:
        _, name, arguments = value
        for argument in arguments:
            self.kind(argument)
        routine = self.program.local_routines(self.module.file).get(name) or self.program.routines.get(name)
        fewest, most = FUNCTIONS.get(name, (0, 0))
        if routine is not None:
            fewest = most = len(routine.parameters)
        elif name in self.program.externals:
            fewest = most = self.program.externals[name]
        elif name not in FUNCTIONS:
            self.refuse(f"the subprogram {name} is not declared")
        if not fewest <= len(arguments) <= most:
            self.refuse(f"{name} takes {fewest} to {most} arguments, not {len(arguments)}")
        return _FUNCTION_KINDS.get(name)

    def unary_kind(self, value: tuple) -> str | None:
        wanted = "truth" if value[1] == "NOT" else "number"
        if self.kind(value[2]) not in (wanted, None):
            self.refuse(f"{value[1]} of something that is no {wanted}")
        return wanted

    def binary_kind(self, value: tuple) -> str | None:
        _, operator, a, b = value
        kinds = {self.kind(a), self.kind(b)} - {None}
        if operator == ":":
            if kinds - {"frame", "aggregate"}:
                self.refuse("the geometric operator takes frames")
            return "frame"
        if operator in ("==", "<>", "<", ">", "<=", ">="):
            if len(kinds) > 1 or kinds & {"frame", "aggregate"}:
                self.refuse(f"{operator} compares values of different kinds")
            return "truth"
        wanted = "truth" if operator in ("AND", "OR", "EXOR") else "number"
        if kinds - {wanted}:
            self.refuse(f"{operator} of something that is no {wanted}")
        return wanted
