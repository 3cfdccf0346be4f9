"""Cycles, blocks, loops and mirrors of a Sinumerik: rows worked out by hand from its manuals."""

import numpy as np
import pytest

from tests.cells import over_demonstration
from tests.gcode.test_controls import errors, read, way

RAPID = float("inf")


def heights(lines):
    """Return Z of the rows, their feed in mm/min and the seconds that the tool stands at each."""
    found = read(lines)
    return found.position_mm[2:, 2].tolist(), (60 * found.feed_mm_s[2:]).tolist(), found.dwell_s[2:].tolist()


def test_cycle83_leaves_the_hole_behind_each_stroke():
    """Strokes 8, 6, 4 and the rest; back in to 0.6 mm above the last depth, as holes up to 30 mm have it."""
    z, feed, dwell = heights("CYCLE83(10,0,2,-20,,,8,2,0.5,0.25,0.5,1)")
    np.testing.assert_allclose(z, [2, -8, 2, -7.4, -14, 2, -13.4, -18, 2, -17.4, -20, 10], atol=1e-12)
    assert feed == [RAPID, 50, RAPID, RAPID, 100, RAPID, RAPID, 100, RAPID, RAPID, 100, RAPID]
    assert dwell == [0, 0.5, 0.25, 0, 0.5, 0.25, 0, 0.5, 0.25, 0, 0.5, 0]


def test_cycle83_breaks_the_chip():
    z, feed, _ = heights("CYCLE83(10,0,2,,20,-8,,0,0,0,1,0,3,,1.5)")
    np.testing.assert_allclose(z, [2, -8, -6.5, -14, -12.5, -20, 10], atol=1e-12)
    assert feed == [RAPID, 100, 100, 100, 100, 100, RAPID]
    z, _, _ = heights("CYCLE83(10,0,2,-24,,-8,,0,0,0,1,0)")
    np.testing.assert_allclose(z, [2, -8, -7, -16, -15, -20, -19, -24, 10], atol=1e-12)


def test_the_last_two_strokes_of_cycle83_are_alike():
    """10, 7, 4, 3, and from 24 on 5 mm, which are less than twice 3."""
    z, _, _ = heights("CYCLE83(10,0,2,-29,,,10,3,0,0,1,0,,,0.5)")
    np.testing.assert_allclose(z[1::2], [-10, -17, -21, -24, -26.5, -29], atol=1e-12)


@pytest.mark.parametrize(
    ("first", "less", "least", "depths"),
    [
        (8, 0, 0, [8, 14, 20]),
        (20, 0, 0, [20]),
        (30, 3, 0, [20]),
        (8, 3, 0, [8, 13, 16, 18, 20]),
        (11, 3, 0, [11, 17, 20]),
        (10, 4, 0, [10, 16, 20]),
        (8, 5, 0, [8, 13, 16.5, 20]),
        (8, -1, 0, [8, 16, 20]),
        (8, -0.5, 1, [8, 12, 14, 15, 16, 17, 18, 19, 19.5, 20]),
        (8, -0.5, 3, [8, 12, 15, 17.5, 20]),
    ],
)
def test_strokes_of_cycle83(first, less, least, depths):
    """By DAM, a length or a share of the stroke before; the last two are halved rather than too short."""
    z, _, _ = heights(f"CYCLE83(10,0,2,-20,,,{first},{less},0,0,1,0,,{least},1)")
    np.testing.assert_allclose(z[1::2], [-depth for depth in depths], atol=1e-12)


def test_the_advance_of_cycle83_grows_with_the_depth():
    z = heights("CYCLE83(10,0,2,-90,,,30,0,0,0,1,1)")[0]
    np.testing.assert_allclose(z[3::3], [-29.4, -58.8, -73.5], atol=1e-9)
    assert heights("CYCLE83(10,0,2,-60,,,30,0,0,0,1,1,,,,,5)")[0][3] == pytest.approx(-25)


def test_digits_of_amode_say_which_depth_counts():
    assert heights("CYCLE81(10,0,2,-8,9,,0,1,2)")[0] == [2, -8, 10]
    assert heights("CYCLE82(10,0,2,-8,9,0.5,0,1,11)")[::2] == ([2, -9, 10], [0, 0.5, 0])
    assert heights("S100 M3\nCYCLE82(10,0,2,-8,,5,0,1,22)")[2] == [0, 3, 0]
    assert heights("S100 M3\nCYCLE82(10,0,2,-8,,-5)")[2] == [0, 3, 0]
    assert heights("CYCLE83(10,0,2,-8,,-5,4,0,0,0,1,0,,,,,,0,1,2012)")[0] == [2, -5, -4, -8, 10]


def test_cycle84_taps_with_its_pitch_and_cycle85_and_89_ream():
    found = read("S700 M3\nCYCLE84(10,0,2,,8,0.1,3,,1.25,0,300,600)")
    assert found.position_mm[2:, 2].tolist() == [2, -8, 2, 10]
    assert (60 * found.feed_mm_s[3:5]).tolist() == [375, 750]
    spindle = [event.values for event in found.events if event.kind == "spindle" and "cycle" in event.values]
    assert [(s["rpm"], s["m"]) for s in spindle] == [(300, 3), (0, 5), (-600, 4), (0, 5), (700, 3)]
    assert {s["cycle"] for s in spindle} == {"CYCLE84"}
    left = read("CYCLE84(10,0,2,-8,,,5,,-1,,100)")
    assert [e.values["rpm"] for e in left.events if e.kind == "spindle"][:2] == [-100, 0]
    assert heights("CYCLE85(10,0,2,-3,,0.5,80,120)") == (
        [2, -3, 2, 10],
        [RAPID, 80, 120, RAPID],
        [0, 0.5, 0, 0],
    )
    assert heights("CYCLE89(10,0,2,-3,,0.5)") == ([2, -3, 2, 10], [RAPID, 100, 100, RAPID], [0, 0.5, 0, 0])


def test_cycle86_leaves_with_the_spindle_at_rest():
    found = read("S100 M4\nMCALL CYCLE86(10,0,2,-3,,0,3,0,0,0,45)\nX5\nMCALL")
    assert found.position_mm[2:, 2].tolist() == [5, 2, -3, 10]
    assert [e.values["m"] for e in found.events if e.kind == "spindle"] == [4, 3, 5]
    assert found.spindle_rad_s[-1] == 0


@pytest.mark.parametrize(
    "line",
    [
        *("CYCLE83(10,0,2,-20,,,21)", "CYCLE83(10,0,2,-20,,-5,6)", "CYCLE83(10,0,2,-20,,,5,-0.5)"),
        *(
            "CYCLE83(10,0,2,-20,,,5,0,0,0,2)",
            "CYCLE83(10,0,2,-20,,,5,0,0,0,1,2)",
            "CYCLE83(10,0,2,-20,,,0.00001)",
        ),
        *("CYCLE83(10,0,2,-20,,,5,0,0,0,1,0,1)", "CYCLE83(10,0,2,-20,,,5,0,0,0,1,0,,,,,,0,1,100112)"),
        *("CYCLE83(10,0,2,-20,,,5,0,-1)", "CYCLE81(10,0,2,-8,,,0,2,0)", "CYCLE81(10,0,2,-8,,,1)"),
        *("CYCLE84(10,0,2,-8,,,5,6,,,300)", "CYCLE84(10,0,2,-8,,,,,1,,300)", "CYCLE84(10,0,2,-8,,,5,,1)"),
        *("CYCLE84(10,0,2,-8,,,5,,1,,300,,,2)", "CYCLE84(10,0,2,-8,,,5,,1,,300,,,,,1)"),
        *("CYCLE85(10,0,2,-3)", "CYCLE86(10,0,2,-3,,0,3,1)", "CYCLE86(10,0,2,-3)"),
        *('CYCLE800(1,"",0,57,0,0,0,0,30)', 'CYCLE800(1,"",0)', "CYCLE800(0,,0,57,5)"),
    ],
)
def test_a_cycle_that_is_not_sure_is_refused(line):
    found = errors(f"{line}\nG0 X1")
    assert [(issue.code, issue.line) for issue in found] == [("dialect-statement", 1)]


def test_a_plane_that_nothing_swivels_is_that_of_the_part():
    assert way('CYCLE800()\nCYCLE800(0,"T1",200000,57,0,0,0,0,0,0,0,0,0,-1,100,1)\nX1').tolist() == [
        [1, 0, 5]
    ]


@pytest.mark.parametrize(
    ("lines", "xs"),
    [
        ("R1=1\nIF R1==1\nX1\nELSE\nX2\nENDIF\nX3", [1, 3]),
        ("R1=2\nIF R1==1\nX1\nELSE\nX2\nENDIF\nX3", [2, 3]),
        ("R1=2\nIF R1==1\nX1\nENDIF\nIF R1==2\nIF R1>5\nX7\nENDIF\nX4\nENDIF", [4]),
        (
            "DEF INT NUM\nDEF REAL W_1=2.5, VV\nFOR NUM=1 TO 3\nX=NUM*W_1\nENDFOR\nX=NUM\nVV=1\nX=VV",
            [2.5, 5, 7.5, 4, 1],
        ),
        ("DEF INT NUM=2.5, NEG=-2.5\nDEF BOOL YES=3\nX=NUM\nX=NEG\nX=YES", [3, -2, 1]),
        ("FOR R1=5 TO 4\nX99\nENDFOR\nX=R1", [5]),
        ("FOR R1=1 TO 2\nFOR R2=1 TO 2\nX=R1*10+R2\nENDFOR\nENDFOR", [11, 12, 21, 22]),
        ("R1=0\nLOOP\nR1=R1+1\nX=R1\nIF R1>2 GOTOF OUT\nENDLOOP\nOUT: X99", [1, 2, 3, 99]),
        ("R1=0\nREPEAT\nR1=R1+1\nX=R1\nUNTIL R1>=3", [1, 2, 3]),
        ("R1=3\nWHILE (R1<6) AND NOT (R1==5)\nR1=R1+1\nX=R1\nENDWHILE", [4, 5]),
        ("R1=1\nIF (R1==2) OR (R1==1) ; comment\nX1\nENDIF ; comment", [1]),
        ("N10 R1=1\nN20 WHILE R1<3\nN30 X=R1\n/N35 X50\nN40 R1=R1+1\nN50 ENDWHILE", [1, 50, 2, 50]),
        ("G91\nSTART: X1\nX2\nREPEAT START P=2\nX10", [1, 3, 4, 6, 7, 9, 19]),
        (
            "G91\nST: X1\nX2\nEN: X3\nG0 X5\nREPEAT ST EN\nREPEATB ST P=R1+2",
            [1, 3, 6, 11, 12, 14, 17, 18, 19],
        ),
        ("G91\nST: X1\nX2\nENDLABEL:\nX4\nREPEAT ST", [1, 3, 7, 8, 10]),
        ("G91\nGOTOF OV\nST: X1\nENDLABEL:\nGOTOF EN\nOV: X5\nREPEAT ST P=2\nEN:", [5, 6, 7]),
        ("G91\nIN: X1\nOU: X2\nREPEAT IN P=1\nREPEAT OU P=1", [1, 3, 4, 6, 8, 9, 11]),
        ("AA: X1\nGOTOF BB\nX2\nBB: X3\nCC: X4\nREPEAT AA BB P=0\nREPEAT AA BB\nX50", [1, 3, 4, 1, 3, 50]),
        ("R1=7 DIV 2\nR2=7 MOD 4\nX=R1+R2\nX=MINVAL(3,R1+9)+MAXVAL(1,2)", [6, 5]),
        ("DEF REAL AB=2\nIF AB==2 GOTOF CC\nX2\nCC: AB=AB+1\nX=AB F=AB*100", [3]),
        ("DEF REAL DEEP=-8\nCYCLE81(10,0,2,DEEP)\nX1", [0, 0, 0, 1]),
        ("DEF REAL WEG[3]=SET(1,2.5), HH=4\nWEG[2]=WEG[1]*2\nX=WEG[2] F=WEG[0]+99\nX=WEG[0]+HH", [5, 5]),
        ("DEF INT WEG[2,2]=REP(1.6)\nWEG[1,1]=WEG[0,0]+7\nX=WEG[1,WEG[0,1]-1]", [9]),
        ("R1=3\nR[R1+1]=R[1]*2\nX=R4 Y=7 DIV 2", [6]),
    ],
)
def test_blocks_loops_and_sections(lines, xs):
    assert way(lines)[:, 0].tolist() == xs


@pytest.mark.parametrize(
    ("lines", "code", "line"),
    [
        ("R1=1\nIF R1==1\nWHILE R1<3\nX1\nENDIF\nENDWHILE", "o-word", 5),
        ("R1=1\nIF R1==1\nX1", "o-word", 2),
        ("ENDFOR", "o-word", 1),
        ("ELSE", "o-word", 1),
        ("LOOP X1\nENDLOOP", "o-word", 1),
        ("REPEAT ST", "o-word", 1),
        ("ST: X1\nST: X2\nREPEAT ST", "o-word", 3),
        ("ST: X1\nREPEAT ST P=1.5", "o-word", 2),
        ("ST: X1\nREPEAT ST EN\nEN: X2", "o-word", 2),
        ("AA: X1\nR1=R1+1\nIF R1>1 GOTOF CC\nX2\nBB: X3\nX5\nREPEAT AA BB\nCC: X50", "o-word", 3),
        ("R2=3\nFOR R1=1 TO R2\nX1\nR2=5\nENDFOR", "o-word", 2),
        ("DEF REAL II=1\nFOR II=1 TO 3\nENDFOR", "expression", 2),
        ("FOR R1=1\nENDFOR", "expression", 1),
        ("DEF STRING[10] NAME", "expression", 1),
        ("DEF REAL RND=3", "expression", 1),
        ("DEF REAL WEG[2]\nX=WEG[2]", "expression-value", 2),
        ("DEF REAL WEG[2]\nX=WEG[0.5]", "expression-value", 2),
        ("DEF REAL WEG[2]\nX=WEG", "expression", 2),
        ("DEF REAL WEG[2,2]\nX=WEG[1]", "expression", 2),
        ("DEF REAL WEG[2]=SET(1,2,3)", "expression", 1),
        ("DEF REAL WEG[2]=4", "expression", 1),
        ("DEF REAL WEG[1001]", "expression", 1),
        ("DEF REAL WEG[R1]", "expression", 1),
        ("R[100]=1", "expression-value", 1),
        ("DEF REAL WEG[2]\nWEG[0]=1 X=WEG[0]", "expression", 2),
        ("DEF INT WEG[2]\nFOR R1=1 TO WEG[0]\nX1\nWEG[0]=5\nENDFOR", "o-word", 2),
        ("R2=3\nFOR R1=1 TO R2\nX1\nR[2]=5\nENDFOR", "o-word", 2),
        ("FOR R1=1 TO R[2]\nX1\nR2=5\nENDFOR", "o-word", 1),
        ("HOLES2(0,0,20,0,0,4)", "dialect-statement", 1),
        ("MCALL CYCLE81(10,0,2,-5)\nHOLES2(0,0,20,0,90,5)", "dialect-statement", 2),
        ("MCALL CYCLE81(10,0,2,-5)\nHOLES2(0,0,20,0,0,4,1000)", "dialect-statement", 2),
        ("MCALL CYCLE81(10,0,2,-5)\nG91\nHOLES1(0,0,20,0,0,4)", "dialect-statement", 3),
        ("MCALL CYCLE81(10,0,2,-5)\nHOLES1(0,0,20,0,10,0)", "dialect-statement", 2),
        ("G500\nCYCLE81(10,0,2,-5)", "dialect-statement", 2),
        ("X=WIDTH\nDEF REAL WIDTH=3", "expression", 1),
        ("R1=1\nIF R1==1 X5\nENDIF", "expression", 2),
        ("R1=2\nIF R1 AND 1\nENDIF", "expression", 2),
        ("WHILE R1<5\nENDWHILE", "endless-loop", 2),
    ],
)
def test_what_leads_nowhere_sure_is_refused(lines, code, line):
    found = errors(lines)
    assert (found[0].code, found[0].line) == (code, line)
    assert found[0].remedy


@pytest.mark.parametrize(
    ("lines", "dialect", "last"),
    [
        ("TRANS X10\nAMIRROR X0\nX3 Y4", "sinumerik", [7, 4, 5]),
        ("TRANS X10\nMIRROR X0\nX3 Y4", "sinumerik", [-3, 4, 5]),
        ("MIRROR X0 Y0\nX3 Y4\nMIRROR\nX3", "sinumerik", [3, -4, 5]),
        ("ROT RPL=90\nAMIRROR Y0\nX1 Y2", "sinumerik", [2, 1, 5]),
        ("MIRROR X0\nG1 X1 Y1\nG91 X2 Z-1", "sinumerik", [-3, 1, 4]),
        ("MIRROR X0\nX1\nTRANS\nX1 Y2", "sinumerik", [1, 2, 5]),
        ("G51.1 X10.\nX3. Y4.", "fanuc", [17, 4, 5]),
        ("G51.1 X10. Y5.\nX3. Y4.\nG50.1 X0.\nX3. Y4.", "fanuc", [3, 6, 5]),
        ("G51.1 Y0.\nX3. Y4.\nG50.1 X0. Y0. Z0.\nX3. Y4.", "fanuc", [3, 4, 5]),
        ("G50.1 X0. Y0.\nX3.", "fanuc", [3, 0, 5]),
    ],
)
def test_mirrors_of_the_program(lines, dialect, last):
    np.testing.assert_allclose(way(lines, dialect)[-1], last, atol=1e-12)


def test_an_arc_in_a_mirror_turns_the_other_way():
    plain = way("G2 X10 Y10 I10 J0\nG1 X20 RND=2\nY0")
    mirrored = way("MIRROR X0\nG2 X10 Y10 I10 J0\nG1 X20 RND=2\nY0")
    np.testing.assert_allclose(mirrored, plain * [-1, 1, 1], atol=1e-12)


@pytest.mark.parametrize(
    ("lines", "dialect"),
    [
        *((f"MIRROR X0\n{line}", "sinumerik") for line in ("ATRANS X1", "AROT RPL=3", "AMIRROR Y0", "G18")),
        *((line, "sinumerik") for line in ("MIRROR Z0", "AMIRROR", "MIRROR X0 F5", "G18\nMIRROR X0")),
        *(
            (f"G51.1 X0.\n{line}", "fanuc")
            for line in ("X1.", "G68 X0. Y0. R9.", "G51.1 Y0.", "G55", "G28 Z0.")
        ),
        *((line, "fanuc") for line in ("G51.1", "G51.1 Z0.", "G51 X0. Y0. P500", "G91 G51.1 X0.")),
    ],
)
def test_a_mirror_that_is_not_sure_is_refused(lines, dialect):
    assert errors(lines, dialect)[0].code in ("dialect-statement", "dialect-code")


def test_arcs_by_a_point_and_by_what_leads_to_them():
    """Quarter circles: the centres are (5, 5) and, by the points, (5, 0)."""
    found = way("G1 X5\nCT X10 Y5\nCT X5 Y10\nG1 X0\nCT X-5 Y5")
    radius = np.hypot(*(found[1:-1, :2] - [5, 5]).T)[:40]
    assert found[-1].tolist() == [-5, 5, 5]
    on_first = found[(found[:, 0] > 5)]
    np.testing.assert_allclose(np.hypot(*(on_first[:, :2] - [5, 5]).T), 5, atol=1e-9)
    assert radius.min() > 4.9
    half = way("CIP X10 Y0 I1=5 J1=5\nG91 CIP X-10 Y0 I1=-5 J1=-5")
    np.testing.assert_allclose(np.hypot(*(half[:, :2] - [5, 0]).T), 5, atol=1e-9)
    assert half[:, 1].max() > 4.99
    assert half[:, 1].min() < -4.99
    np.testing.assert_allclose(half[-1], [0, 0, 5], atol=1e-12)


@pytest.mark.parametrize(
    "lines",
    [
        *(
            "CIP X9 Y4 I1=5",
            "CIP X9 Y9 I1=5 J1=5",
            "CIP X9 Y4 I1=5 J1=6 K1=1",
            "CIP X9 Y4 I5 J1=1 I1=1",
            "I1=5 X3",
        ),
        *("G1 Z3\nCT X1 Y1", "G1 X4\nCT X8", "CT X8 Y3", "G1 X4\nROT RPL=3\nCT X8 Y8", "G0 CT X8 Y3"),
    ],
)
def test_an_arc_whose_centre_is_not_sure_is_refused(lines):
    assert {issue.code for issue in errors(lines)} == {"dialect-statement"}


def test_a_cell_with_named_tools_and_variables_reads_both():
    cell = over_demonstration(
        {"tool": {7: {"name": "MILL", "diameter_mm": 6.0, "teeth": 2, "length_mm": 60.0}}}
    )
    found = read('DEF REAL DEEP=3\nT="MILL" D1 M6\nG0 X=DEEP', cell=cell)
    assert (found.tool[-1], found.position_mm[-1, 0]) == (7, 3)
