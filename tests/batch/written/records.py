"""Made-up records of a batch, as its lines of results.jsonl are."""

import math
import random

NASTY = '<b>&"x"]]>\x00\x1b[31m\u202e\ud800`|*_#@ \ufffe.nc'
"""A name of a part that no file format likes."""
ERROR = {
    "severity": "error",
    "code": "out-of-reach",
    "line": 120,
    "message": "the robot cannot reach X 4000 Y 0 Z 100",
    "remedy": "move the part nearer",
}
WARNING = {
    "severity": "warning",
    "code": "force-high",
    "line": 44,
    "message": "force of 812 N is above `[limits] force_N`",
    "remedy": "",
}
NOTE = {
    "severity": "note",
    "code": "stock-guessed",
    "line": 0,
    "message": "the raw part is guessed",
    "remedy": "state [stock]",
}
OF_CELL = {
    "severity": "error",
    "code": "model-unknown",
    "line": 3,
    "message": "robot.model: found 'x'",
    "remedy": "correct it",
    "file": "cells/big.toml",
}
_FIGURES = ("moves", "time_s", "path_mm", "max_force_N", "max_deflection_mm", "corner_error_mm")


def record(part, exit_code=0, issues=(), **more):
    """Return a record with plausible figures; a part that was not written has none."""
    figures = dict.fromkeys(_FIGURES)
    if exit_code == 0:
        figures = dict(zip(_FIGURES, (420, 78.3, 2950.0, 412.5, 0.613, 0.031), strict=True))
    name = part.rpartition("/")[2].removesuffix(".nc")
    files = [f"{name}.src", f"{name}.dat"] if exit_code == 0 else []
    counts = {
        f"{severity}s": sum(one["severity"] == severity for one in issues)
        for severity in ("error", "warning", "note")
    }
    return {
        "schema": "gcode2krl/result/1",
        "command": "translate",
        "version": "0.1.0",
        "input": {"file": f"parts/{part}", "sha256": "0" * 64, "size_bytes": 1000},
        "cell": {"name": "demonstration", "file": "cell.toml", "sha256": "1" * 64},
        "options": {},
        "exit_code": exit_code,
        "counts": counts,
        "files": files,
        **figures,
        "issues": list(issues),
        "part": part,
        "seconds": 1.25,
        "cached": False,
        "thumbnail": [[0.0, 0.0], [100.0, 0.0], [100.0, 40.0], [0.0, 40.0], [0.0, 0.0]],
        "against": None,
        **more,
    }


def many(count, seed=1):
    """Return records of several folders: most written, some refused, some not understood."""
    chance = random.Random(seed)
    return [_one(number, chance) for number in range(count)]


def _one(number, chance):
    folder = ("", "pockets/", "pockets/deep/", "finishing/")[number % 4]
    part = f"{folder}part{number}.nc"
    kind = chance.random()
    common = {"seconds": chance.uniform(0.5, 20.0), "thumbnail": _flower(chance)}
    if kind < 0.06:
        return record(part, 1, [ERROR | {"line": chance.randint(2, 900)}, WARNING, NOTE], **common)
    if kind < 0.09:
        wrong = {"severity": "error", "code": "no-number", "line": chance.randint(2, 90)}
        wrong |= {"message": "X is not followed by a number", "remedy": "write the number, or remove it"}
        return record(part, 2, [wrong], **common | {"thumbnail": None})
    issues = [WARNING | {"line": chance.randint(2, 900)}] * (kind > 0.7) + [NOTE]
    made = record(part, 0, issues, **common, cached=kind > 0.5)
    made |= {"time_s": chance.uniform(20.0, 9000.0), "max_force_N": chance.uniform(50.0, 900.0)}
    made |= {"max_deflection_mm": chance.uniform(0.05, 1.6) if kind < 0.9 else None}
    pages = [f"{part.removesuffix('.nc')}.html"] if kind < 0.6 else []
    return made | {"files": [*made["files"], *pages]}


def _flower(chance):
    leaves, depth, size = chance.randint(0, 7), chance.uniform(0.1, 0.9), chance.uniform(20.0, 400.0)
    turns = chance.choice((1, 3, 6))
    points = []
    for k in range(200):
        angle, share = 2.0 * math.pi * turns * k / 199, (k + 1) / 200
        radius = size * (share if turns > 1 else 1.0) * (1.0 + depth * math.cos(leaves * angle)) / 2.0
        points.append([radius * math.cos(angle), 0.6 * radius * math.sin(angle)])
    return points
