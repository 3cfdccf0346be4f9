"""R parameters and jumps of a Sinumerik: rows worked out by hand, and what is refused with its line."""

import pytest

from tests.gcode import Control, named

SINUMERIK = Control("%_N_PART_MPF\nG710 G90 G17\nG0 X0 Y0 Z0\n", "M30", "sinumerik")


read, xs = SINUMERIK.read, SINUMERIK.xs


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1+2*3", 7.0),
        ("(1+2)*3", 9.0),
        ("10-4-3", 3.0),
        ("8/4/2", 1.0),
        ("-5+2", -3.0),
        ("2*-3", -6.0),
        ("R5", 4.0),
        ("-R5*R6", -10.0),
        ("SIN(30)*2", 1.0),
        ("COS(60)+TAN(45)", 1.5),
        ("ASIN(-0.5)", -30.0),
        ("ACOS(-0.5)", 120.0),
        ("ATAN2(-1,-1)", -135.0),
        ("SQRT(16)+ABS(-3)", 7.0),
        ("POT(3)", 9.0),
        ("TRUNC(-1.9)+ROUND(2.5)", 2.0),
        ("LN(EXP(2))", 2.0),
        ("(R5>3)+(R5==4)+(R5<>4)+(R5<=4)", 3.0),
    ],
)
@pytest.mark.parametrize("way", ["R1={}\nX=R1", "X={}"])
def test_a_calculation(way, expression, value):
    assert xs(f"R5=4 R6=2.5\n{way.format(expression)}") == [pytest.approx(value, abs=1e-12)]


def test_words_take_calculations():
    toolpath = read("R1=100 R2=5\nG1 F=R1*6 X=R2\nX=IC(R2) Y=AC(R2+1)\nG2 X=R2*4 Y=R2+1 CR=R2\nG4 F=R2/10")
    assert toolpath.position_mm[3].tolist() == [10.0, 6.0, 0.0]
    assert toolpath.position_mm[-1] == pytest.approx([20.0, 6.0, 0.0])
    assert toolpath.feed_mm_s[2] == pytest.approx(10.0)
    assert toolpath.dwell_s.sum() == 0.5


@named(
    ("lines", "expected"),
    {
        "a frame shifted by a parameter": ("R1=7\nTRANS X=R1\nX0\nATRANS X=R1+1\nX=IC(1)\nX0", [7, 8, 15]),
        "jumps to the nearest label": (
            "R1=0\nAGAIN: R1=R1+1\nX=R1\nIF R1<3 GOTOB AGAIN\nGOTOF OUT\nX99\n"
            "OUT: X50\nGOTOF OUT\nX99\nOUT: X51",
            [1, 2, 3, 50, 51],
        ),
        "goto looks forwards first, a block number is a label": (
            "R1=0\nN10 R1=R1+1\nX=R1\nIF R1==1 GOTO N10\nIF R1==2 GOTO N20\nX99\n"
            "N20 X7\nN30 IF R1>5 GOTOF N40\nX8\nN40",
            [1, 2, 7, 8],
        ),
        "back to plain blocks before the first calculation": (
            "BEGIN_1: G91 X1\nG90\nR9=R9+1\nIF R9<2 GOTOB BEGIN_1",
            [1, 2],
        ),
    },
)
def test_where_a_program_leads(lines, expected):
    assert xs(lines) == expected


def test_skipped_blocks_are_left_out():
    assert xs("R1=1\n/2 R1=5\n/GOTOF AB\nX=R1\nAB:", block_delete=True) == [1.0]


def test_other_statements_of_the_control_stay_as_they_are():
    text = 'R1=1\nMSG("A (b)")\nCYCLE832(0.01,_FINISH,1)\nN10 G0 X1 ; text\nS1=R1*1000 M1=3\nG641 ADIS=0.1'
    toolpath = read(text)
    assert toolpath.position_mm[2:, 0].tolist() == [1.0]
    assert next(e.values["text"] for e in toolpath.events if e.kind == "message") == "A (b)"
    assert next(e.values["rpm"] for e in toolpath.events if e.kind == "spindle") == 1000.0


def test_a_parameter_that_nothing_has_set_is_told():
    (issue,) = (i for i in read("X=R7").issues if i.code == "parameter-unset")
    assert issue.line == 4
    assert issue.message.startswith("R7 ")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("X=R100", ("expression-value", 1)),
        ("R1=1/0", ("expression-value", 1)),
        ("R1=SQRT(-1)", ("expression-value", 1)),
        ("R1=0.1+0.2\nIF R1==0.3 GOTOF AB\nAB:", ("expression-value", 2)),
        ("R1=", ("expression", 1)),
        ("R1=SIN(30", ("expression", 1)),
        ("R1=ATAN2(1)", ("expression", 1)),
        ("R1=NONE(1)", ("expression", 1)),
        ("R1=5 X=R1", ("expression", 1)),
        ("R1=5 R1=6", ("expression", 1)),
        ("R1=" + "(" * 300 + "1" + ")" * 300, ("expression", 1)),
        ("R1=1\nIF 1<2<3 GOTOF AB\nAB:", ("expression", 2)),
        ("R1=1\nIF R1==1 AND R1<2 GOTOF AB\nAB:", ("expression", 2)),
        ("GOTOF AB", ("o-word", 1)),
        ("AB:\nGOTOF AB", ("o-word", 2)),
        ("GOTOB AB\nAB:", ("o-word", 1)),
        ("GOTOF R1", ("o-word", 1)),
        ('R1=1 MSG("A")', ("dialect-statement", 1)),
        ("R1=1\nX[1+1]", ("dialect-statement", 2)),
        ("R1=1\nX#1", ("dialect-statement", 2)),
        ("R1=1\nO1 call", ("dialect-statement", 2)),
        ("R1=1\nM98 P1", ("dialect-statement", 2)),
        ("R1=1\nCYCLE81(1,2,3)", ("dialect-statement", 2)),
        ("R1=1\nX=5 NONSENSE", ("dialect-statement", 2)),
        ("R1[2]=1", ("bad-character", 1)),
        ("X=R(1)", ("expression", 1)),
        ("AB: GOTOB AB", ("endless-loop", 1)),
    ],
)
def test_what_is_refused(text, found):
    assert SINUMERIK.refused(text) == found
