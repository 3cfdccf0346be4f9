"""Programs for industrial controls against a second reading of them, which knows nothing of the package."""

import io

import pytest

from gcode2krl.gcode import read_stream
from tests.cells import over_demonstration
from tests.reference import controls

CELL = over_demonstration({"tool": {n: {"diameter_mm": 10.0, "teeth": 2, "length_mm": 60.0} for n in (1, 2)}})
HEAD = {
    "fanuc": "%\nO0001\nG21 G90 G17\nG54\nT1 M6\nG0 G43 H1 Z50.\nX0. Y0.\nF100\n",
    "sinumerik": "G710 G90 G17 G54\nT1 D1 M6\nG0 X0 Y0 Z50\nF100\n",
    "heidenhain": "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S900 F100\n2 L X+0 Y+0 Z+50 R0 FMAX\n",
}
PROGRAMS = [
    ("fanuc", "G81 G98 X5. Y6. Z-3. R2.\nX9.\nG99 Y3.\nG80\nG1 X1. Z5.\nG2 X11. I5.\nM30"),
    ("fanuc", "G91 G81 X5. Z-6. R-48. K3\nG80\nG90 G0 X1. Z9.\nM30"),
    ("fanuc", "G83 X5. Y6. Z-9. R2. Q2. L2\nM98 P100 L2\nM30\nO100\nG91 G1 X1.\nG90 M99"),
    ("fanuc", "M97 P50\nG28 G91 Z0.\nG90 G0 X2. Y2. Z3.\nM30\nN50 G1 X7. Y8.\nM99"),
    ("fanuc", "G20\nG0 X1. Y2.\nG91 X.5\nG90\nS100 M3\nG84 G99 Z-.2 R.1\nX2.\nG80\nM30"),
    ("fanuc", "G53 G0 Z0.\nX3. Y3.\nZ4.\nG3 X5. Y5. R2.\nG73 Z-4. R1. Q1.5\nG80\nM30"),
    ("fanuc", "M98 P21000\nM30\nO1000\nM98 P2000\nX3.\nM99\nO2000\nG91 Y1.\nG90\nM99"),
    ("fanuc", "G89 X5. Y5. Z-2. R1. P100\nX7.\nG80\nM30"),
    (
        "sinumerik",
        "R1=2\nG1 X=R1*3 Y=IC(4)\nG91 X=AC(1) Y2\nG90\nTRANS X10\nX1\nATRANS Y5\nX2 Y2\nTRANS\nX3\nM30",
    ),
    ("sinumerik", "MCALL CYCLE81(10,0,2,-5)\nX5 Y6\nX7\nMCALL\nX0\nCYCLE82(10,0,2,,6,0)\nG0 X3\nM30"),
    ("sinumerik", "R1=0\nAG: R1=R1+1\nX=R1\nIF R1<4 GOTOB AG\nGOTOF OU\nX99\nOU: Y=SIN(30)*R1\nM30"),
    ("sinumerik", "FOR R1=1 TO 3\nFOR R2=1 TO 2\nX=R1*10+R2\nENDFOR\nENDFOR\nX=R1\nM30"),
    (
        "sinumerik",
        "R1=5\nWHILE (R1>1) AND (R1<>2)\nR1=R1-1\nX=R1\nENDWHILE\nREPEAT\nR1=R1+2\nY=R1\nUNTIL R1>7\nM30",
    ),
    (
        "sinumerik",
        "DEF REAL WW=2.5, HH\nDEF INT NN=3\nHH=WW*NN\nIF HH>7\nX=HH\nELSE\nX=1\nENDIF\n"
        "IF HH<7\nY9\nELSE\nY8\nENDIF\nM30",
    ),
    ("sinumerik", "G91\nST: X1\nY1\nEN: X2\nREPEAT ST EN P=2\nREPEAT EN P=1\nM30"),
    ("sinumerik", "LOOP\nR1=R1+1\nX=R1\nIF R1==5 GOTOF OU\nENDLOOP\nOU: SUPA G0 Z0\nX1 Y1 Z1\nM30"),
    ("sinumerik", "CYCLE83(10,0,2,-20,,,8,2,0,0,0.5,1)\nG2 X10 Y0 CR=5\nG3 X20 Y0 I5 J0 TURN=1\nM30"),
    (
        "sinumerik",
        "R1=1\nAG: CASE R1 OF 1 GOTOF ONE 3 GOTOF TWO DEFAULT GOTOF OT\nONE: X1\nTWO: X2\nOT: R1=R1+1\n"
        "X=R1*10\n"
        "IF R1<4 GOTOB AG\nMCALL CYCLE81(10,0,2,-5,0)\nX1\nMCALL CYCLE82(10,0,2,0,4,0)\nX2\nMCALL\nM30",
    ),
    (
        "sinumerik",
        "MCALL CYCLE81(10,0,2,-5,0)\nHOLES1(20,10,30,5,12,4)\nHOLES1(20,10,30,5,12,4)\n"
        "HOLES2(50,60,20,15,0,5)\nHOLES2(50,60,20,15,-30,3)\nCYCLE801(100,-20,20,15,10,3,4)\nCYCLE801(100,-20,20,10,15,3,4)\nMCALL\n"
        "G0 X1\nM30",
    ),
    (
        "sinumerik",
        "TRANS X5 Y7\nMCALL CYCLE82(10,0,2,-5,0,0.5)\nX200 Y100\nCYCLE801(10,20,0,15,10,2,3)\n"
        "HOLES1(0,0,180,5,12,3)\nMCALL\nM30",
    ),
    (
        "sinumerik",
        "DEF REAL WEG[4]=SET(1,2.5,4), HOCH=3\nDEF INT FELD[2,3]=REP(7)\nWEG[3]=WEG[1]*2\nFELD[1,2]=HOCH\n"
        "FOR R1=0 TO 3\nX=WEG[R1] Y=FELD[1,R1 MOD 3]\nENDFOR\nR[R1+1]=8\nX=R5 Y=R[5]+1\nM30",
    ),
    ("heidenhain", "3 CC X+10 Y+0\n4 C X+20 Y+0 DR- F100\n5 L IX+5 IZ-2\n6 CR X+30 Y+5 R+5 DR+\n7 L M30"),
    (
        "heidenhain",
        "3 CYCL DEF 1.0 PECKING\n4 CYCL DEF 1.1 SET UP 2\n5 CYCL DEF 1.2 DEPTH -9.5\n6 CYCL DEF 1.3 PECKG 4\n"
        "7 CYCL DEF 1.4 DWELL 0\n8 CYCLE DEF 1.5 F80\n9 L Z+12 FMAX\n10 L X+5 Y+5 FMAX M99\n11 L IX+9 FMAX\n"
        "12 CYCL CALL\n13 CC X+24 Y+5\n14 C DR- F90\n15 L M30",
    ),
    (
        "heidenhain",
        "3 LBL 1\n4 L IX+3 FMAX\n5 LBL 2\n6 L IY+1 FMAX\n7 CALL LBL 2 REP 2/2\n8 CALL LBL 1 REP 1/1\n9 L M2",
    ),
    (
        "heidenhain",
        "3 CALL LBL 1\n4 L X+0 FMAX\n5 CALL LBL 1\n6 L M2\n7 LBL 1\n8 L IX+3 IY+1 FMAX\n9 LBL 0",
    ),
    (
        "heidenhain",
        "3 Q1 = 3\n4 FN 1: Q2 = +Q1 + +4\n5 L X+Q1 Y-Q2 FMAX\n6 LBL 7\n7 FN 2: Q1 = +Q1 - +1\n8 L X+Q1 FMAX\n"
        "9 FN 11: IF +Q1 GT +0 GOTO LBL 7\n10 L M30",
    ),
    (
        "heidenhain",
        "3 CYCL DEF 200 DRILLING ~\n Q200=+2 ~\n Q201=-8 ~\n Q206=+100 ~\n Q202=+3 ~\n Q203=+1 ~\n Q204=+20\n"
        "4 L X+5 Y+6 R0 FMAX M99\n5 L X+7 R0 FMAX\n6 CYCL CALL\n7 L Z+100 FMAX M91\n"
        "8 L X+1 Y+1 Z+2 FMAX\n9 L M30",
    ),
    (
        "heidenhain",
        "3 CYCL DEF 7.0 DATUM\n4 CYCL DEF 7.1 X+10\n5 L X+1 FMAX\n6 CP IPA+360 IZ-3 DR+\n7 L M30",
    ),
]


@pytest.mark.parametrize(("dialect", "lines"), PROGRAMS)
def test_two_readings_lead_to_the_same_places(dialect, lines):
    lines = lines.replace("6 CP IPA", "6 CC X+5 Y+0\n6 CP IPA")
    text = f"{HEAD[dialect]}{lines}\n"
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", CELL, dialect=dialect)
    ours, theirs = (
        controls.columns(controls.places_of(toolpath)),
        controls.columns(controls.READERS[dialect](text)),
    )
    assert len(theirs) > 1
    assert controls.difference(ours, theirs) is None, (ours, theirs)
