"""Remedies of what is said of a cell, as it is checked and as a program is written with it."""

from tests.remedies.bench import BASE, DRY, LIMITS_DEG, MILL, WET, block, case, laid

CONFIRM = "models confirm cell.toml --by A --yes; "
TIMED = MILL["m_code"]["M3"].replace(
    "WAIT FOR $IN[{{ spindle.at_speed_input }}]", "WAIT SEC {{ spindle.start_s }}"
)
OWN_ROBOT = {
    "model": None,
    "geometry": {
        "a1_mm": 330.0,
        "a2_mm": -115.0,
        "c1_mm": 645.0,
        "c2_mm": 1150.0,
        "c3_mm": 1220.0,
        "c4_mm": 215.0,
    },
}
CHECK = "models check cell.toml"
STATE = laid(BASE, {"words": CHECK})
TOOL = MILL["tool"]["1"]
OTHER = 'based_on = "mill.toml"\n'
CLAMP = {"name": "clamp", "box_mm": [[-40.0, 17.2, -60.0], [2.5, 60.0, 160.0]]}
CASES = {
    "cell-base": case(
        {"mill.toml": MILL, "cell.toml": 'based_on = "mil.toml"\n'},
        {"cell.toml": OTHER},
        {"cell.toml": 'based_on = "demonstration"\n'},
        {"cell.toml": MILL},
    ),
    "cell-changed": case(
        {"words": CONFIRM + "change; " + DRY, "change": {"cell.toml": ("x_mm = 1450.0", "x_mm = 1451.0")}},
        {"words": CONFIRM + DRY},
        {"words": CONFIRM + "change; " + CONFIRM + DRY},
    ),
    "cell-contradiction": case(
        {"words": DRY, "obstacle": [CLAMP], "clearance.z_mm": 100.0, "cut": "G1 Z-1 F300\nX20"},
        {"clearance.z_mm": 200.0},
        {"obstacle": []},
    ),
    "cell-doubtful": case({"controller.acc_cp_m_s2": 20.0}, {"controller.acc_cp_m_s2": 2.0}),
    "cell-impossible": case({"controller.rapid_m_s": 200.0}, {"controller.rapid_m_s": 0.2}),
    "cell-key": case({"tool.1.diameter_mm": True}, {"tool.1.diameter_mm": 16.0}),
    "cell-missing": case({"words": DRY, "load": None}, {"load": MILL["load"]}, {"based_on": "demonstration"}),
    "cell-not-verified": case({"words": DRY}, {"words": CONFIRM + DRY}),
    "cell-unsigned": case(
        {"words": DRY, "verified.by": "J. Smith", "verified.date": "2026-11-20"}, {"words": CONFIRM + DRY}
    ),
    "verified-future": case(
        {"verified.by": "J. Smith", "verified.date": "2126-11-20"},
        {"verified.by": "J. Smith", "verified.date": "2026-11-20"},
    ),
    "cell-pair": case({"m_code.M9": "$OUT[3]=FALSE"}, {"m_code.M9": MILL["m_code"]["M9"]}),
    "frame-split": case(
        {"mill.toml": MILL, "cell.toml": OTHER + "[frames]\nbase_data = 3\n"},
        {"cell.toml": laid(MILL, {"frames": {"base_data": 3}})},
    ),
    "kss-iiqka": case({"words": DRY, "controller.kss": "iiqka"}, {"controller.kss": "8.6"}),
    "limits-unknown": case({"words": DRY, "robot": OWN_ROBOT}, {"robot.limits.q_deg": LIMITS_DEG}),
    "joint-speeds-unknown": case(
        {"words": DRY, "robot": OWN_ROBOT}, {"robot.speeds.qd_deg_s": [100.0] * 6}, then="limits-unknown"
    ),
    "load-centre": case(
        {"words": DRY, "load.x_mm": None, "load.y_mm": None, "load.z_mm": None},
        {"load.x_mm": 110.0, "load.y_mm": 0.0, "load.z_mm": 160.0},
    ),
    "overload": case(
        {"words": DRY, "load.mass_kg": 150.0}, {"load.mass_kg": 42.0}, {"robot.model": "KR 210 R2700-2"}
    ),
    "material-without-law": case(
        {"words": WET, "material.name": "oak"},
        {"material.linear_edge": {"Ktc": 30.0, "Krc": 10.0, "Kac": 5.0, "Kte": 3.0, "Kre": 3.0, "Kae": 1.0}},
        {"material.name": None, "material.model": "AW-2017A"},
    ),
    "model-unknown": case({"robot.model": "KR 200"}, {"robot.model": "KR 210 R2700 prime"}),
    "signal-twice": case({"spindle.flood_output": 11}, {"spindle.flood_output": 13}),
    "spindle-wait": case(
        {
            "words": DRY,
            "spindle.at_speed_input": None,
            "spindle.start_s": 0.05,
            "m_code.M3": TIMED,
            "m_code.M4": TIMED.replace("run_cw", "run_ccw"),
        },
        {"spindle.start_s": 4.0},
        {"spindle.at_speed_input": 17, "m_code.M3": MILL["m_code"]["M3"], "m_code.M4": MILL["m_code"]["M4"]},
    ),
    "template": case({"m_code.M8": "$BASE=$NULLFRAME"}, {"m_code.M8": MILL["m_code"]["M8"]}),
    "template-effect": case(
        {"m_code.M3": "$ANOUT[1]={{ rpm // spindle.max_rpm }}\n$OUT[11]=TRUE\nWAIT FOR $IN[17]"},
        {"m_code.M3": MILL["m_code"]["M3"]},
    ),
    "tool-length-library": case(
        {"words": CONFIRM + DRY, "head": ("T1 M6\nG43 H1", "T5 M6\nG43 H5"), "tool.5.model": "flat 8 z3"},
        {"tool.5.length_mm": 90.0},
    ),
    "not-toml": case({"cell.toml": "[frames"}, {"cell.toml": MILL}),
    "not-utf8": case({"cell.toml": 'name = "Größe"\n'.encode("latin-1")}, {"cell.toml": MILL}),
    "file-too-large": case({"cell.toml": "#" * 40_000_000}, {"cell.toml": MILL}),
    "no-forces": case({"words": WET}, {"material.model": "AW-2017A", "stock.box_mm": block(40.0, 20.0)}),
}
