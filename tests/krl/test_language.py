"""The grammar of KRL that the tests hold programs against: what it takes, what it refuses, how it binds."""

import pytest

from tests.conftest import ROOT
from tests.krl.execution import Environment, execute
from tests.krl.language import KrlError, parse_line, parse_program

DATA = """&ACCESS RVP
DEFDAT PART
EXT BAS (BAS_COMMAND :IN,REAL :IN )
DECL INT COUNT=3
DECL CONST INT LIMIT=7
ENDDAT
"""
GOOD = """&ACCESS RVP
&REL 1
DEF PART( )
;FOLD declarations
EXT MAGAZINE(INT :IN)
DECL INT N
DECL FRAME HERE,THERE
REAL LIST[4]
;ENDFOLD
BAS (#INITMOV,0 )
INTERRUPT DECL 21 WHEN $OUT[5]==FALSE DO LOST( )
HERE={X 10.0,Y 0.0,Z 0.0,A 90.0,B 0.0,C 0.0}
THERE=HERE:{X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
FOR N=1 TO 4
LIST[N]=N*2.5
ENDFOR
SWITCH N
CASE 1,2
HALT
DEFAULT
MAGAZINE(N)
ENDSWITCH
REPEAT
N=N-1
UNTIL (N<=0) OR $IN[3]
TRIGGER WHEN DISTANCE=0 DELAY=7 DO TOLD(1.0,N) PRIO=-1
LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0} C_DIS ; a "comment"
SPLINE
SPL {X 1.0,Y 2.0,Z 4.0,A 0.0,B 0.0,C 0.0}
ENDSPLINE
CIRC {X 1.0,Y 2.0,Z 5.0},{X 1.0,Y 2.0,Z 6.0,A 0.0,B 0.0,C 0.0} C_DIS
END
DEF LOST( )
BRAKE
LIN_REL {Z 5.0} #TOOL
LOOP
HALT
ENDLOOP
END
DEF TOLD(VALUE:IN,NUMBER:IN)
REAL VALUE
INT NUMBER
$SEN_PREA[1]=VALUE
END
DEFFCT BOOL IS_FAR(WAY:IN)
REAL WAY
RETURN WAY>2.0
ENDFCT
"""
END = "CIRC {X 1.0,Y 2.0,Z 5.0},{X 1.0,Y 2.0,Z 6.0,A 0.0,B 0.0,C 0.0} C_DIS\n"
BROKEN = [
    # replaced, by, what the refusal says
    ("INT N\n", "INT A_NAME_OF_TWENTY_FIVE_CHR\n", "longer than 24"),
    ("INT N\n", "INT 1N\n", "not KRL"),
    ("INT N\n", "INT LIN\n", "is a word of KRL"),
    ("INT N\n", "INT N,N\n", "declared twice"),
    ("INT N\n", "NUMERAL N\n", "no type"),
    ("INT N\n", "INT N=3\n", "in a .dat only"),
    ("HALT\nDEFAULT", "HALT\nDECL INT LATE\nDEFAULT", "behind the first statement"),
    ("BAS (#INITMOV,0 )\n", "BAS (#INITMOV,0 )\nDECL INT LATE\n", "behind the first statement"),
    ("BRAKE\n", "BREAK\n", "not complete|not KRL"),
    ("ENDFOR\n", "", "FOR|without its beginning"),
    ("ENDSPLINE\n", "", "in a SPLINE block"),
    ("END\nDEF LOST", "DEF LOST", "END is missing"),
    ("DEF TOLD(", "DEF LOST(", "defined twice"),
    ("DEF PART( )", "DEF OTHER( )", "not named as its file"),
    ("N=N-1", "M=N-1", "M is not declared"),
    ("N=N-1", "$MADE_UP=1", "is not declared"),
    ("N=N-1", "LIMIT=8", "cannot be assigned"),
    ("N=N-1", "$IN[3]=TRUE", "cannot be assigned"),
    ("N=N-1", "EXIT_NOW( )", "subprogram EXIT_NOW is not declared"),
    ("N=N-1", "MAGAZINE(N,2)", "takes 1 to 1 arguments"),
    ("N=N-1", "N=TRUE", "is a number, the value a truth"),
    ("N=N-1", "N=N-", "not complete"),
    ("N=N-1", 'N="a', "not KRL"),
    ("N=N-1", "IF N==1 AND N==2 THEN\nENDIF", "AND of something that is no truth"),
    ("N=N-1", "WHILE N\nENDWHILE", "no BOOL"),
    ("N=N-1", "GOTO NOWHERE", "no label"),
    ("N=N-1", "RETURN 3", "RETURN has a value"),
    (END, END + "EXIT\n", "outside of a loop"),
    ("DO LOST( )", "DO", "not complete"),
    ("DECL 21", "DECL 60", "no interrupt has the number"),
    (" PRIO=-1", "", "needs PRIO"),
    ("REAL VALUE\n", "", "has no type"),
    ("Z 3.0,A 0.0", "Z 3.0,Z 0.0", "stands twice"),
    ("LIN {X 1.0,Y 2.0,Z 3.0", "LIN {A1 1.0,A2 2.0,A3 3.0", "LIN to axis angles"),
    ("LIN {X 1.0,Y 2.0,Z 3.0", "LIN {X 1.0,Y 2.0,Q 3.0", "Q in the target"),
    ("C_DIS ;", "C_SPL ;", "C_SPL at LIN"),
    ("C_DIS ;", "C_NEAR ;", "not KRL"),
    (";ENDFOLD\n", "", "FOLD without ENDFOLD"),
    ("&REL 1\n", "&REL 1\nHALT\n", "outside of a DEF"),
    ("ENDFCT\n", "END\n", "DEFFCT with ENDFCT"),
]


def test_a_program_of_every_kind_is_taken_and_runs():
    program = parse_program({"PART.src": GOOD, "PART.dat": DATA})
    assert list(program.local_routines("PART.src")) == ["PART", "LOST", "TOLD", "IS_FAR"]
    run = execute(program, Environment())
    assert run.ended == "end", run.ended
    assert [motion.kind for motion in run.motions] == ["LIN", "SPL", "CIRC"]


@pytest.mark.parametrize(("old", "new", "refusal"), BROKEN)
def test_what_a_controller_refuses_is_refused(old, new, refusal):
    assert GOOD.count(old) >= 1
    with pytest.raises(KrlError, match=refusal) as caught:
        parse_program({"PART.src": GOOD.replace(old, new, 1), "PART.dat": DATA})
    assert caught.value.line > 0


@pytest.mark.parametrize(
    ("old", "new", "refusal"),
    [
        ("DEFDAT PART", "DEFDAT OTHER", "in a file named PART"),
        ("ENDDAT\n", "", "end is missing"),
        ("COUNT=3", "COUNT=3\nHALT", "declarations only"),
        ("CONST INT LIMIT=7", "CONST INT LIMIT", "has no value"),
    ],
)
def test_a_broken_data_list_is_refused(old, new, refusal):
    with pytest.raises(KrlError, match=refusal):
        parse_program({"PART.src": GOOD, "PART.dat": DATA.replace(old, new, 1)})


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("1+2*3", "1+(2*3)"),
        ("A:B*2", "(A:B)*2"),
        ("NOT A AND B", "(NOT A) AND B"),
        ("A AND B OR C", "(A AND B) OR C"),
        ("A OR B EXOR C AND D", "A OR (B EXOR (C AND D))"),
        ("A==B OR C", "A==(B OR C)"),
        ("A+B>C", "(A+B)>C"),
        ("A-B-C", "(A-B)-C"),
    ],
)
def test_operators_bind_as_in_the_manual(text, meant):
    assert parse_line(f"X={text}") == parse_line(f"X={meant}")


@pytest.mark.parametrize(
    "line", ["LIN {X 1.0,Y -2.5} C_DIS", "PTP {A1 0.0,E1 3.000}", "SPL {X 1.0}", "LIN {X 1.0}"]
)
def test_short_cut_for_plain_motions_says_what_the_grammar_says(line):
    assert parse_line(line) == parse_line(line.replace("{", " {"))  # two spaces: not the short cut


@pytest.mark.parametrize(
    "source", sorted((ROOT / "tests" / "golden" / "krl").glob("*.src")), ids=lambda p: p.stem
)
def test_golden_programs_are_krl(source):
    files = [source, source.with_suffix(".dat")]
    assert parse_program({file.name: file.read_bytes() for file in files}).main.name == source.stem
