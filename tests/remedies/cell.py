"""Remedies of what is said of a cell, as it is checked and as a program is written with it."""

from tests.remedies.bench import BASE, DRY, MILL, WET, case, laid

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
        {
            "words": DRY,
            "cell.toml": {"obstacle": [CLAMP], "clearance": {"z_mm": 100.0}},
            "cut": "G1 Z-1 F300\nX20",
        },
        {"cell.toml": {"clearance": {"z_mm": 200.0}}},
        {"cell.toml": {"obstacle": []}},
    ),
    "cell-doubtful": case(
        {"cell.toml": {"controller": {"acc_cp_m_s2": 20.0}}},
        {"cell.toml": {"controller": {"acc_cp_m_s2": 2.0}}},
    ),
    "cell-impossible": case(
        {"cell.toml": {"controller": {"rapid_m_s": 200.0}}}, {"cell.toml": {"controller": {"rapid_m_s": 0.2}}}
    ),
    "cell-key": case(
        {"cell.toml": {"tool": {"1": {"diameter_mm": True}}}},
        {"cell.toml": {"tool": {"1": {"diameter_mm": 16.0}}}},
    ),
    "cell-missing": case(
        {"words": DRY, "cell.toml": {"load": None}},
        {"cell.toml": {"load": MILL["load"]}},
        {"cell.toml": {"based_on": "demonstration"}},
    ),
    "cell-not-verified": case({"words": DRY}, {"words": CONFIRM + DRY}),
    "cell-unsigned": case(
        {"words": DRY, "cell.toml": {"verified": {"by": "J. Smith", "date": "2026-11-20"}}},
        {"words": CONFIRM + DRY},
    ),
    "verified-future": case(
        {"cell.toml": {"verified": {"by": "J. Smith", "date": "2126-11-20"}}},
        {"cell.toml": {"verified": {"by": "J. Smith", "date": "2026-11-20"}}},
    ),
    "cell-pair": case(
        {"cell.toml": {"m_code": {"M9": "$OUT[3]=FALSE"}}},
        {"cell.toml": {"m_code": {"M9": MILL["m_code"]["M9"]}}},
    ),
    "frame-split": case(
        {"mill.toml": MILL, "cell.toml": OTHER + "[frames]\nbase_data = 3\n"},
        {"cell.toml": laid(MILL, {"frames": {"base_data": 3}})},
    ),
    "kss-iiqka": case(
        {"words": DRY, "cell.toml": {"controller": {"kss": "iiqka"}}},
        {"cell.toml": {"controller": {"kss": "8.6"}}},
    ),
    "limits-unknown": case(
        {"words": DRY, "cell.toml": {"robot": OWN_ROBOT}},
        {
            "cell.toml": {
                "robot": {
                    "limits": {
                        "q_deg": [
                            [-185.0, 185.0],
                            [-140.0, -5.0],
                            [-120.0, 155.0],
                            [-350.0, 350.0],
                            [-122.5, 122.5],
                            [-350.0, 350.0],
                        ]
                    }
                }
            }
        },
    ),
    "joint-speeds-unknown": case(
        {"words": DRY, "cell.toml": {"robot": OWN_ROBOT}},
        {"cell.toml": {"robot": {"speeds": {"qd_deg_s": [100.0] * 6}}}},
        then="limits-unknown",
    ),
    "load-centre": case(
        {"words": DRY, "cell.toml": {"load": {"x_mm": None, "y_mm": None, "z_mm": None}}},
        {"cell.toml": {"load": {"x_mm": 110.0, "y_mm": 0.0, "z_mm": 160.0}}},
    ),
    "overload": case(
        {"words": DRY, "cell.toml": {"load": {"mass_kg": 150.0}}},
        {"cell.toml": {"load": {"mass_kg": 42.0}}},
        {"cell.toml": {"robot": {"model": "KR 210 R2700-2"}}},
    ),
    "material-without-law": case(
        {"words": WET, "cell.toml": {"material": {"name": "oak"}}},
        {
            "cell.toml": {
                "material": {
                    "linear_edge": {"Ktc": 30.0, "Krc": 10.0, "Kac": 5.0, "Kte": 3.0, "Kre": 3.0, "Kae": 1.0}
                }
            }
        },
        {"cell.toml": {"material": {"name": None, "model": "AW-2017A"}}},
    ),
    "model-unknown": case(
        {"cell.toml": {"robot": {"model": "KR 200"}}},
        {"cell.toml": {"robot": {"model": "KR 210 R2700 prime"}}},
    ),
    "signal-twice": case(
        {"cell.toml": {"spindle": {"flood_output": 11}}}, {"cell.toml": {"spindle": {"flood_output": 13}}}
    ),
    "spindle-wait": case(
        {
            "words": DRY,
            "cell.toml": {
                "spindle": {"at_speed_input": None, "start_s": 0.05},
                "m_code": {"M3": TIMED, "M4": TIMED.replace("run_cw", "run_ccw")},
            },
        },
        {"cell.toml": {"spindle": {"start_s": 4.0}}},
        {
            "cell.toml": {
                "spindle": {"at_speed_input": 17},
                "m_code": {"M3": MILL["m_code"]["M3"], "M4": MILL["m_code"]["M4"]},
            }
        },
    ),
    "template": case(
        {"cell.toml": {"m_code": {"M8": "$BASE=$NULLFRAME"}}},
        {"cell.toml": {"m_code": {"M8": MILL["m_code"]["M8"]}}},
    ),
    "template-effect": case(
        {
            "cell.toml": {
                "m_code": {"M3": "$ANOUT[1]={{ rpm // spindle.max_rpm }}\n$OUT[11]=TRUE\nWAIT FOR $IN[17]"}
            }
        },
        {"cell.toml": {"m_code": {"M3": MILL["m_code"]["M3"]}}},
    ),
    "tool-length-library": case(
        {
            "words": CONFIRM + DRY,
            "head": ("T1 M6\nG43 H1", "T5 M6\nG43 H5"),
            "cell.toml": {"tool": {"5": {"model": "flat 8 z3"}}},
        },
        {"cell.toml": {"tool": {"5": {"length_mm": 90.0}}}},
    ),
    "not-toml": case({"cell.toml": "[frames"}, {"cell.toml": MILL}),
    "not-utf8": case({"cell.toml": 'name = "Größe"\n'.encode("latin-1")}, {"cell.toml": MILL}),
    "file-too-large": case({"cell.toml": "#" * 40_000_000}, {"cell.toml": MILL}),
    "no-forces": case(
        {"words": WET},
        {
            "cell.toml": {
                "material": {"model": "AW-2017A"},
                "stock": {"box_mm": [[0.0, 0.0, -10.0], [40.0, 20.0, 0.0]]},
            }
        },
    ),
}
