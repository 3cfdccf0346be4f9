"""Remedies of what is said of a program and where it runs, without forces."""

import io

from gcode2krl import load_cell, set_targets
from gcode2krl.chain import corner_errors
from gcode2krl.gcode import read_stream
from tests.remedies.bench import BASE, HEAD, MILL, UPRIGHT, call, case

STATE = BASE
FIVE = {"machine": {"kind": "head-head", "axes": ["C", "A"], "signs": [1, 1], "tcpm": True}}
A = "G43.4 H1\n"


@call
def corners(tolerance_mm):
    """Judge targets that were set with a tolerance by one of 0.05 mm."""
    moves = "G21 T1 M6\nS9000 M3\nG0 G43 H1 Z50\nX0 Y0\nG1 Z0 F900\nX10\nY10\nX30 Y15\nG0 Z50\nM30\n"
    cell = load_cell()
    toolpath = read_stream(io.BytesIO(moves.encode()), "part.nc", cell)
    return corner_errors(toolpath, set_targets(toolpath, cell, float(tolerance_mm)), cell, 0.05)[1]


LEVEL = """\
based_on = "demonstration"
[frames.base]
x_mm = 1300.0
y_mm = 0.0
z_mm = 1400.0
a_deg = 0.0
b_deg = 0.0
c_deg = 0.0
"""
"""At this height the forearm is level and A5 passes 0."""
CASES = {
    # places
    "above-clearance": case(
        {"cut": "G1 Z160 F300\nX30"}, {"clearance.z_mm": 160.0}, {"cut": "G1 Z-1 F300\nX30"}
    ),
    "below-table": case(
        {"cut": "G1 Z-3 F300\nX30", "table.z_mm": -2.0}, {"cut": "G1 Z-1 F300\nX30"}, {"table.z_mm": -5.0}
    ),
    "undefined-position": case({"head": ("X10 Y10 Z20", "X10 Y10")}, {"head": ("X10 Y10", "X10 Y10 Z20")}),
    "out-of-reach": case({"frames.base.x_mm": 4000.0}, {"frames.base.x_mm": 1450.0}),
    "joint-limit": case({"frames.spin": 180.0}, {"frames.spin": "auto"}, {"frames.spin": 0.0}),
    "home-below-clearance": case({"home.q_deg": [0.0, -20.0, 60.0, 0.0, 50.0, 0.0]}, {"home.q_deg": UPRIGHT}),
    "home-limit": case({"home.q_deg": [0.0, 0.0, 90.0, 0.0, 0.0, 0.0]}, {"home.q_deg": UPRIGHT}),
    "ptp-below-clearance": case(
        {"home.q_deg": [3.0, -100.0, 120.0, 0.0, 124.0, 0.0]}, {"home.q_deg": UPRIGHT}
    ),
    "no-clearance": case({"clearance": None}, {"clearance.z_mm": 150.0}),
    "machine-feed": case({"tail": ("G0 Z20", "G53 G1 Z0 F500")}, {"tail": ("G1 Z0 F500", "G0 Z0")}),
    "no-motion": case(
        {"head": "G21 G90\n", "cut": "", "tail": "M30\n"}, {"head": HEAD, "cut": "G1 Z-1 F300\nX30"}
    ),
    # speeds
    "feed-too-high": case({"cut": "G1 Z-1 F300\nX30 F400000"}, {"cut": "G1 Z-1 F300\nX30 F400"}),
    "feed-too-low": case(
        {"cut": "G1 Z-1 F300\nX30 F0.01"},
        {"cut": "G1 Z-1 F300\nG95 X30 F0.01"},
        {"cut": "G1 Z-1 F300\nX30 F300"},
    ),
    "acceleration-high": case(
        {
            "cut": "G1 Z-1 F300\nX60 F60000\nY60",
            "controller.cdis_mm": 0.1,
            "limits.acceleration_mm_s2": 6000.0,
        },
        {"cut": "G1 Z-1 F300\nX60 F600\nY60"},
    ),
    "dwell-long": case({"cut": "G1 Z-1 F300\nX30\nG4 P2000\nX10"}, {"cut": "G1 Z-1 F300\nX30\nG4 P2\nX10"}),
    "blend-wide": case({"cut": "G1 Z-1 F300\nG64 P5\nX60\nY60"}, {"cut": "G1 Z-1 F300\nG64 P0.05\nX60\nY60"}),
    "chord-tolerance": case(
        {"cut": "G1 Z-1 F300\nG2 X30 I10", "options": "--chord-tolerance 5"},
        {"options": "--chord-tolerance 0.01"},
    ),
    "spindle-off": case(
        {"head": ("T1 M6\nG43 H1\nS8000 M3\n", ""), "mounted_tool": 1},
        {"head": ("G0 X10", "S8000 M3\nG0 X10")},
        {"program.start.spindle_rpm": 8000.0},
    ),
    "spindle-direction": case({"head": ("M3", "M4")}, {"head": ("M4", "M3")}),
    "spindle-speed": case(
        {"head": ("S8000", "S20000")}, {"head": ("S20000", "S18000")}, {"spindle.max_rpm": 20000.0}
    ),
    "stop-in-cut": case(
        {"cut": "G1 Z-1 F300\nX30\nM0\nX40", "m_code.M0": "HALT"},
        {"cut": "G1 Z-1 F300\nX30\nG0 Z5\nM0\nG1 Z-1 F300\nX40"},
    ),
    "stopped-by-end": case({"tail": ("M5\n", "")}, {"tail": ("M30", "M5\nM30")}),
    "exact-stops": case({"tail": ("M5\n", "M5\n")}, {"head": ("Z20", "Z20"), "cut": "G0 Z5\nX30"}),
    "tapping-cycle": case(
        {"cut": "F800\nG98 G84 X20 Y10 Z-5 R2\nG80"}, {"cut": "G1 Z-5 F300\nG3 I-1 Z-4 F300\nG0 Z20"}
    ),
    # unit, end
    "unit-unnamed": case({"head": ("G21 ", "")}, {"head": HEAD}),
    "unit-doubtful": case(
        {"head": ("G21 ", "(unit: inch)\nG21 ")},
        {"head": ("G21 ", "G20 "), "cut": "G1 Z-.1 F10\nX1", "frames.base.x_mm": 1300.0},
        {"head": ("(unit: inch)\n", "")},
    ),
    "no-program-end": case({"tail": ("M30\n", "")}, {"tail": ("M5\n", "M5\nM30\n")}),
    "cut-off": case({"head": "%\n" + HEAD, "tail": "G0 Z20\n"}, {"tail": "G0 Z20\nM5\nM30\n"}),
    "after-end": case({"tail": "G0 Z20\nM30\nG0 X10\n"}, {"tail": "G0 Z20\nM30\n"}),
    # tools
    "tool-unknown": case({"head": ("T1 M6\nG43 H1", "T7 M6\nG43 H7")}, {"tool.7": MILL["tool"]["1"]}),
    "tool-assumed": case({"head": ("T1 M6\n", ""), "mounted_tool": 1}, {"head": ("G43", "T1 M6\nG43")}),
    "tool-missing": case({"head": ("T1 M6\nG43 H1\n", "")}, {"head": HEAD}, {"mounted_tool": 1}),
    "tool-not-changed": case(
        {"head": ("T1 M6", "T1"), "mounted_tool": 2}, {"head": ("T1", "T1 M6")}, {"mounted_tool": 1}
    ),
    "tool-change-silent": case(
        {
            "tool_change": "; tool {{ tool }}",
            "tail": ("M5", "T2 M6\nG43 H2\nS8000 M3\nG0 X10 Y10 Z20\nG1 Z-1 F300\nG0 Z20\nM5"),
        },
        {"tool_change": "HALT ; tool {{ tool }}"},
        {"tail": "G0 Z20\nM5\nM30\n"},
    ),
    "tool-differs": case({"head": "(T1 D=10. CR=0. - flat end mill)\n" + HEAD}, {"tool.1.diameter_mm": 10.0}),
    "g43-missing": case({"head": ("G43 H1\n", "")}, {"head": HEAD}),
    "m-code-unmapped": case(
        {"cut": "M10\nG1 Z-1 F300\nX30"}, {"m_code.M10": "$OUT[20]=TRUE"}, {"m_code.M10": ""}
    ),
    # five axes
    "turn-speed": case(
        {"cell.toml": FIVE, "cut": A + "G0 A0 C0\nG1 X20 Y10 Z60 F600\nG1 A30 F60\nG1 X30 F600\nG0 Z80\nA0"},
        {"controller.vel_ori_deg_s": 1.0},
        {"cut": A + "G0 A0 C0\nG1 X20 Y10 Z60 F600\nG1 X30 A30\nG0 Z80\nA0"},
    ),
    "turned-length": case(
        {
            "head": ("G43 H1\n", ""),
            "machine": FIVE["machine"] | {"tcpm": False, "pivot_mm": 100.0},
            "cut": "G0 A10\nG1 X20 F600",
        },
        {"head": HEAD},
    ),
    "tool-lies": case(
        {"cell.toml": FIVE, "cut": A + "G0 A0 C0\nG1 X20 Y10 Z50 F600\nG1 X21 A90 F600", "tail": "M5\nM30\n"},
        {"cut": A + "G0 A0 C0\nG1 X20 Y10 Z50 F600\nG1 X21 A60 F600"},
    ),
    # zero points
    "offset-left": case({"cut": "G92 X0\nG1 Z-1 F300\nX30"}, {"tail": ("M30", "G92.1\nM30")}),
    "program-offset": case(
        {"cut": "G92 X0\nG1 Z-1 F300\nX30"},
        {
            "cut": "G1 Z-1 F300\nX30",
            "work_offsets.G54": {
                "x_mm": 10.0,
                "y_mm": 0.0,
                "z_mm": 0.0,
                "a_deg": 0.0,
                "b_deg": 0.0,
                "c_deg": 0.0,
            },
        },
    ),
    "retract-unnamed": case(
        {"cut": "F300\nG81 X20 Y10 Z-5 R2\nG80"},
        {"cut": "F300\nG98 G81 X20 Y10 Z-5 R2\nG80"},
        {"cut": "F300\nG99 G81 X20 Y10 Z-5 R2\nG80"},
    ),
    "parameter-unset": case({"cut": "G1 Z-1 F300\nX[20+#100]"}, {"cut": "#100=10\nG1 Z-1 F300\nX[20+#100]"}),
    "argument-count": case(
        {"cut": "G1 Z-1 F300\no1 sub\nG1 X#1 Y#2\no1 endsub\no1 call [30]"},
        {"cut": "G1 Z-1 F300\no1 sub\nG1 X#1 Y#2\no1 endsub\no1 call [30] [20]"},
    ),
    "arc-radius-differs": case(
        {"cut": "G1 Z-1 F300\nG2 X30.02 Y10 I10"}, {"cut": "G1 Z-1 F300\nG2 X30.02 Y10 I10.01"}
    ),
    "start-unnamed": case(
        {
            "head": "G21 G17\nT1 M6\nG43 H1\nS8000 M3\nG0 X10. Y10. Z20.\n",
            "options": "--dialect fanuc",
            "cut": "G1 Z-1. F300.\nX30.",
            "tail": "G0 Z20.\nM30\n",
        },
        {"head": ("G21", "G21 G90")},
        {"program.start.distance": "G90"},
    ),
    "short-moves": case(
        {
            "cut": "G1 Z-1 F300\nF9000\n"
            + "\n".join(f"X{10 + k / 10:.1f} Y{10 + (k % 2) / 500:.3f}" for k in range(1, 200))
        },
        {"options": "--simplify 0.01"},
    ),
    "near": case(
        {
            "obstacle": [{"name": "clamp", "box_mm": [[-40.0, 0.0, -60.0], [0.0, 40.0, 60.0]]}],
            "collision.clearance_mm": 5.0,
        },
        {"collision.clearance_mm": 0.5},
    ),
    "collision": case(
        {"obstacle": [{"name": "clamp", "box_mm": [[25.0, 0.0, -60.0], [60.0, 40.0, 10.0]]}]},
        {"cut": "G1 Z-1 F300\nX0", "head": ("X10 Y10", "X-40 Y10")},
        {"obstacle": []},
    ),
    "singularity": case(
        {"cut": "G1 Z-1 F300\nX0 Y-200\nY200 F6000", "cell.toml": LEVEL},
        {"cell.toml": LEVEL.replace("z_mm = 1400.0", "z_mm = 800.0")},
    ),
    "joint-speed": case(
        {"cell.toml": FIVE, "cut": A + "G0 A0 C0\nG1 X20 Y10 Z60 F60000\nG1 A30 X21\nG0 Z80\nA0"},
        {"cut": A + "G0 A0 C0\nG1 X20 Y10 Z60 F60\nG1 A30 X21\nG1 A0 X22\nG0 Z80"},
    ),
    "corner-undecided": case(
        {"cut": "G64 P2\nG1 Z-1 F300\nX60 F600\nX100 Y40 F900"}, {"cut": "G64 P2\nG1 Z-1 F600\nX60\nX100 Y40"}
    ),
    "law-undecided": case(
        {"cell.toml": FIVE, "cut": A + "G0 A0 C0\nG1 X20 Y10 Z60 F600\nG1 X30 A30\nG0 Z80\nA0"},
        {"controller.law": "averages"},
    ),
    "circ": case({"cut": "G1 Z-1 F300\nG2 X50 Y10 I20", "controller.circ": True}, {"controller.circ": False}),
    "spline": case(
        {
            "cut": "G1 Z-1 F300\nF3000\n"
            + "\n".join(f"X{10 + k / 2:.1f} Y{10 + k * k / 500:.3f}" for k in range(1, 60)),
            "controller.spline": True,
        },
        {"controller.spline": False},
    ),
    "program-large": case(
        {
            "cut": "G1 Z-1 F300\n" + "\n".join(f"X{10 + k % 2}" for k in range(200)),
            "program.memory_moves": 120,
            "program.max_lines": 100,
        },
        {"options": "--split files"},
        {"cut": "G1 Z-1 F300\nX30"},
    ),
    "too-long": case(
        {"words": "predict part.nc --cell cell.toml -o prediction --no-forces --dt 0.0000001"},
        {"words": "predict part.nc --cell cell.toml -o prediction --no-forces --dt 0.012"},
    ),
    "machine-doubtful": case(
        {"machine": FIVE["machine"] | {"tcpm": False, "pivot_mm": 0.1}, "cut": "G0 A10\nG1 X20 F600"},
        {"machine.pivot_mm": 100.0},
        says="metres",
    ),
    "program-memory": case(
        {
            "controller.kss": "8.3",
            "program.warn_size_mb": 0.02,
            "cut": "G1 Z-1 F300\n" + "\n".join(f"X{10 + k / 10}" for k in range(200)),
        },
        {"options": "--simplify 0.01"},
        {"program.warn_size_mb": 4.0},
    ),
    "corner-tolerance": case({"words": "call corners 0.5"}, {"words": "call corners 0.05"}),
    "axis-swings": case(
        {
            "machine": FIVE["machine"] | {"axis_step_deg": 10.0},
            "cut": A + "G0 A0 C0 Z100\nG1 A85 X20 F600\nC120 X40\nA0 X41",
        },
        {"machine.axis_step_deg": 2.0},
    ),
}
