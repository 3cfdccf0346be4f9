"""``predict --nominal part.stl``: finished part against nominal one, as findings, figures and files."""

from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.errors import Issue

if TYPE_CHECKING:
    from gcode2krl.cutting.nominal import Comparison
    from gcode2krl.prediction import Prediction

FILES = {"gouge": "gouges.stl", "rest": "rest.stl"}
"""Solids of each kind, in the folder of the prediction."""
KEY, HASH_KEY = "nominal", "nominal_sha256"
"""What a prediction's inputs say of the nominal part."""
_MOST_NAMED = 5


def compared(prediction: "Prediction", nominal: str) -> "Comparison":
    """Return how the part that the prediction leaves differs from the mesh of the nominal part.

    Raises `NotUnderstoodError` where the mesh or the stock cannot be read, `RefusedError` where material
    removal cannot run.
    """
    from gcode2krl.cutting import remove
    from gcode2krl.cutting.nominal import compare
    from gcode2krl.cutting.raw_part import load_mesh

    mesh = load_mesh(Path(nominal), "nominal part")
    motion = prediction.motion
    if motion is None:
        raise AssertionError("predict_toolpath always plans a motion")
    return compare(remove(prediction.toolpath, motion, prediction.cell, is_checked=False), motion, mesh)


def with_comparison(prediction: "Prediction", comparison: "Comparison", nominal: str) -> "Prediction":
    """Return the prediction with findings on the differences, and with the nominal part among its inputs."""
    content = Path(nominal).read_bytes()
    named = {KEY: Path(nominal).as_posix(), HASH_KEY: sha256(content).hexdigest()}
    issues = tuple(issues_of(prediction, comparison))
    return replace(prediction, skipped=(*prediction.skipped, *issues), inputs={**prediction.inputs, **named})


def issues_of(prediction: "Prediction", comparison: "Comparison") -> list[Issue]:
    """Return a warning for each of the largest gouges, and a note on the rest."""
    toolpath, motion = prediction.toolpath, prediction.motion
    gouges = [one for one in comparison.differences if one.kind == "gouge"]
    issues = []
    for one in gouges[:_MOST_NAMED]:
        x, y, z = one.place_mm
        sentence = (
            f"cuts up to {one.depth_mm:.2f} mm into the nominal part at X {x:.2f} Y {y:.2f} Z {z:.2f} "
            f"({one.volume_mm3:.1f} mm3)"
        )
        line = int(toolpath.source_line[motion.move[one.row]]) if motion is not None else 0
        issues.append(Issue("warning", "nominal-gouge", line, sentence))
    rest = [one for one in comparison.differences if one.kind == "rest"]
    if rest:
        count = len(rest) + comparison.left_out["rest"]
        places = f"{count} places" if count > 1 else "one place"
        volume_mm3, most_mm = comparison.volume_mm3["rest"], max(one.depth_mm for one in rest)
        sentence = f"up to {most_mm:.2f} mm of material is left in {places} ({volume_mm3:.1f} mm3)"
        issues.append(Issue("note", "nominal-rest", 0, sentence))
    return issues


def comparison_lines(comparison: "Comparison") -> list[str]:
    """Return the lines of the summary."""
    lines = []
    for kind, name in (("gouge", "gouges"), ("rest", "rest")):
        own = [one for one in comparison.differences if one.kind == kind]
        count = len(own) + comparison.left_out[own[0].kind] if own else 0
        deepest = f", up to {max(one.depth_mm for one in own):.2f} mm" if own else ""
        volume = f"{comparison.volume_mm3[own[0].kind]:.1f} mm3" if own else "none"
        lines.append(f"  {name:<10} {volume}{f' in {count} places' if count > 1 else ''}{deepest}")
    return lines


def as_dict(comparison: "Comparison") -> dict[str, Any]:
    """Return the figures as JSON has them."""
    return {
        "volume_mm3": dict(comparison.volume_mm3),
        "left_out": dict(comparison.left_out),
        "differences": [
            {
                "kind": one.kind,
                "volume_mm3": one.volume_mm3,
                "depth_mm": one.depth_mm,
                "place_mm": one.place_mm.tolist(),
            }
            for one in comparison.differences
        ],
    }


def solids(comparison: "Comparison") -> dict[str, bytes]:
    """Return name and content of an STL file for each kind that there is."""
    import trimesh

    files = {}
    for kind, name in FILES.items():
        own = [one.solid for one in comparison.differences if one.kind == kind]
        if own:
            both: Any = trimesh.util.concatenate(own)
            files[name] = bytes(both.export(file_type="stl"))
    return files


def on_page(comparison: "Comparison") -> dict[str, Any]:
    """Return what the report shows: the same, with nearest samples, corners of triangles (t, 3, 3), a map."""
    import numpy as np

    plain = as_dict(comparison)
    for one, shown in zip(comparison.differences, plain["differences"], strict=True):
        shown |= {"row": one.row, "triangles_mm": np.asarray(one.solid.triangles)}
    return plain | {"above_mm": comparison.above_mm}
