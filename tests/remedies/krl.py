"""Remedies of what `verify` says of a program, its data list, its sidecar and its RSI files."""

import re

from tests.remedies.bench import BASE, DRY, GONE, VERIFY, WET, block, case, laid

STATE = laid(BASE, {"words": f"{DRY}; change; {VERIFY}"})
SPLIT = f"{DRY} --split files --max-lines 100"
LIN = "LIN {X 30.000,Y 10.000,Z -1.000,A 0.0000,B 0.0000,C 0.0000}\r\n"
CARRIED = WET.replace("--pilot none", "--pilot index")
ONLINE = WET.replace("--pilot none", "--pilot none --online RSI")
METAL = {"material": {"model": "AW-2017A"}, "stock": {"box_mm": block(40.0, 20.0)}}
LINK = {"online": {"link": {"address": "192.168.7.3"}}}
RAIL = {
    "kind": "rail",
    "axis": "y",
    "limits": [-500.0, 500.0],
    "speed": 1200.0,
    "acceleration": 1500.0,
    "position": 0.0,
}
CARRIED_CUT = "G1 Z0.5 F300\nZ-1\nX15 F600\nX30"


def again(edits, write=DRY, verify=VERIFY, **state):
    """Return the case of a program that was edited behind its translation, and is translated again."""
    return case(
        {"words": f"{write}; change; {verify}", "change": edits, **state},
        {"words": f"{write}; change; {write}; {verify}"},
    )


def limited(cell):
    """Return the cell of a controller that holds two triggers at a time."""
    return cell + b"\n[pilot]\nmax_active = 2\ntolerance_N = 200.0\n"


def src(old, new):
    return again({"out.src": (old, new)})


def piloted(file, old, new):
    return again({file: (old, new)}, CARRIED, **{"cell.toml": METAL, "cut": CARRIED_CUT})


def online(file, old, new):
    return again({file: (old, new)}, ONLINE, **{"cell.toml": METAL | LINK, "cut": CARRIED_CUT})


def templated(key, value, *remedies):
    """Return the case of a statement of the cell's templates."""
    return case({"words": DRY, "m_code": {key: value}, "cut": f"{key}\nG1 Z-1 F300\nX30"}, *remedies)


CASES = {
    "verify-cdis": src("$APO.CDIS=0.100", "$APO.CDIS=0.200"),
    "verify-count": src(LIN, ""),
    "verify-header": src("; findings released by hand: none", "; findings released by hand: spindle-off:8"),
    "verify-motion": src("LIN {X 30.000,Y 10.000,Z -1.000", "PTP {X 30.000,Y 10.000,Z -1.000"),
    "verify-position": src("LIN {X 30.000,Y 10.000,Z -1.000", "LIN {X 30.500,Y 10.000,Z -1.000"),
    "verify-rotation": src(LIN, LIN.replace("A 0.0000", "A 5.0000")),
    "verify-speed": src("$VEL.CP=0.0100000", "$VEL.CP=0.0200000"),
    "verify-start": src("Z 20.000,A 0.0000,B 0.0000,C 0.0000}", "Z 20.000,A 0.0000,B 0.0000,C 0.0000} C_DIS"),
    "verify-statement": src("$OUT[11]=TRUE\r\n", ""),
    "verify-status": src("S 6,", "S 2,"),
    "verify-wait": again({"out.src": ("WAIT SEC 0.500", "WAIT SEC 0.200")}, cut="G1 Z-1 F300\nG4 P0.5\nX30"),
    "verify-cell-changed": case(
        {"change": {"cell.toml": ("x_mm = 1450.0", "x_mm = 1451.0")}},
        {"words": f"{DRY}; change; {DRY}; {VERIFY}"},
    ),
    "verify-cell-unknown": again(
        {
            "out.src": lambda text: re.sub(
                rb"; cell hash: .*\r\n", b"", re.sub(rb"; options: .*\r\n", b"", text)
            )
        }
    ),
    "verify-external": again({"out.src": ("E1 0.000", "E1 9.000")}, **{"external.E1": RAIL}),
    "krl-external": again({"out.src": (",E1 0.000", "")}, **{"external.E1": RAIL}),
    "krl-blend-broken": src("C_DIS\r\n", "C_DIS\r\n$OUT[5]=TRUE\r\n"),
    "krl-data": again({"out.dat": ("EXT BAS", "EXT BAD")}),
    "krl-first-motion": again({"out.src": lambda text: re.sub(rb"PTP \{[^\r]*\r\n", b"", text, count=2)}),
    "krl-incomplete": src(",Z -1.000,A 0.0000,B 0.0000,C 0.0000}", "}"),
    "krl-initmov": src("BAS (#INITMOV,0 )\r\n", ""),
    "krl-malformed": src("X 30.000", "X 3O.000"),
    "krl-motion-unknown": src(LIN, "SLIN" + LIN[3:]),
    "krl-no-motion": again({"out.src": "DEF OUT( )\n; nothing\nEND\n"}),
    "krl-not-ascii": again({"out.src": lambda text: text.replace(b"; line 3", "; größer".encode(), 1)}),
    "krl-structure": src("ENDWHILE\r\n;ENDFOLD (guard)", ";ENDFOLD (guard)"),
    "krl-velocity": src("$VEL.CP=0.0100000", "$VEL.CP=5.0"),
    "krl-setting-changed": src(LIN, "$BASE=$NULLFRAME\r\n" + LIN),
    "krl-state-unknown": src("; line 11: M5\r\n", "HALT\r\n; line 11: M5\r\n"),
    "krl-part": case(
        {
            "words": f"{SPLIT}; change; {VERIFY}",
            "change": {"OUT_002.src": GONE},
            "cut": "G1 Z-1 F300\n" + "\n".join(f"X{10 + k % 7} Y{10 + k / 10}" for k in range(120)),
        },
        {"words": f"{SPLIT}; {VERIFY}"},
        {"words": f"{SPLIT}; change; {SPLIT}; {VERIFY}"},
    ),
    "no-def": case(
        {"words": f"{DRY}; verify part.nc part.nc --cell cell.toml"}, {"words": f"{DRY}; {VERIFY}"}
    ),
    "krl-call-undeclared": src(LIN, LIN + "GRIPPER(1)\r\n"),
    "krl-line-too-long": templated("M10", "; " + "x" * 600, {"m_code.M10": "; x"}),
    "krl-unknown": src(LIN, LIN + "SWITCHON 5\r\n"),
    "krl-name": case(
        {"words": DRY.replace("out.src", "circ.src")}, {"words": DRY.replace("out.src", "circ_1.src")}
    ),
    # the pilot force
    "pilot-checksum": piloted("out.src", "$SEN_PINT[2]=", "$SEN_PINT[2]=1"),
    "pilot-count": again(
        {"out.src": lambda text: re.sub(rb"TRIGGER [^\r]*\r\n", b"", text, count=1)},
        CARRIED,
        **{"cell.toml": METAL, "cut": CARRIED_CUT},
    ),
    "pilot-knot": piloted("out.src", "DELAY=44 DO", "DELAY=-44 DO"),
    "pilot-window": piloted("out.src", "DELAY=44 DO", "DELAY=9999 DO"),
    "pilot-file": piloted("out.pilot.csv", "gcode2krl/pilot/1", "gcode2krl/pilot/0"),
    "pilot-form": piloted("out.src", "DO $SEN_PINT[1]=1", "DO $SEN_PREA[1]=1.0"),
    "pilot-sidecar": again({"out.pilot.csv": GONE}, CARRIED, **{"cell.toml": METAL, "cut": CARRIED_CUT}),
    # RSI
    "rsi-file": online("RSI.rsi.xml", "OV_PRO", "OV_PRI"),
    "rsi-mode": online("out.src", "#ABSOLUTE", "#RELATIVE"),
    "rsi-order": online("out.src", "GK_RSI_RET=RSI_OFF()\r\n", ""),
    "rsi-place": again(
        {
            "out.src": lambda text: re.sub(
                rb"(?s)(INTERRUPT OFF 21.*?ENDWHILE\r\n.*?\r\n.*?\r\n)(.*?PTP[^\r]*\r\n)", rb"\2\1", text
            )
        },
        ONLINE,
        **{"cell.toml": METAL | LINK, "cut": CARRIED_CUT},
    ),
    "rsi-ready": online("out.src", "WAIT FOR $OUT[1020]\r\n", ""),
    "rsi-version": online("out.src", 'RSI_CREATE("RSI.rsi"', 'RSI_CREATE("RSI"'),
    "pilot-active": case(
        {
            "words": f"{CARRIED}; change; {VERIFY}",
            "change": {"cell.toml": limited},
            "cell.toml": METAL,
            "cut": CARRIED_CUT,
        },
        {"words": f"{CARRIED}; change; {CARRIED}; {VERIFY}"},
    ),
}
