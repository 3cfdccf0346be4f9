"""``predict --nominal part.stl``: finished part against nominal one, as findings, figures and files."""

from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.errors import Issue

if TYPE_CHECKING:
    import trimesh

    from gcode2krl.arrays import Floats
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
    from gcode2krl.cutting.height_field import HeightField
    from gcode2krl.cutting.nominal import compare
    from gcode2krl.cutting.nominal_turned import compare_turned
    from gcode2krl.cutting.raw_part import load_mesh

    mesh = load_mesh(Path(nominal), "nominal part")
    motion, cell = prediction.motion, prediction.cell
    if motion is None:
        raise AssertionError("predict_toolpath always plans a motion")
    removal = remove(prediction.toolpath, motion, cell, is_checked=False)
    if isinstance(removal.material, HeightField):
        return compare(removal, motion, mesh)
    return compare_turned(removal.material, motion, cell, mesh, _nearest_on)


def _nearest_on(mesh: "trimesh.Trimesh", places_mm: "Floats") -> "Floats":
    """Return the places (n, 3) on a mesh that are nearest to places (n, 3)."""
    import numpy as np

    from gcode2krl.collision import scene
    from gcode2krl.collision.gaps import nearest_on

    return nearest_on(scene.mesh(np.asarray(mesh.triangles)), places_mm)


def with_comparison(prediction: "Prediction", comparison: "Comparison", nominal: str) -> "Prediction":
    """Return the prediction with findings on the differences, and with the nominal part among its inputs."""
    content = Path(nominal).read_bytes()
    named = {KEY: Path(nominal).as_posix(), HASH_KEY: sha256(content).hexdigest()}
    issues = tuple(issues_of(prediction, comparison))
    return replace(prediction, skipped=(*prediction.skipped, *issues), inputs={**prediction.inputs, **named})


def issues_of(prediction: "Prediction", comparison: "Comparison") -> list[Issue]:
    """Return a warning for each of the largest gouges, and a note on the rest."""
    toolpath, motion = prediction.toolpath, prediction.motion
    gouges = [difference for difference in comparison.differences if difference.kind == "gouge"]
    issues = []
    for difference in gouges[:_MOST_NAMED]:
        x, y, z = difference.place_mm
        sentence = (
            f"cuts up to {difference.depth_mm:.2f} mm into the nominal part at X {x:.2f} Y {y:.2f} Z {z:.2f} "
            f"({difference.volume_mm3:.1f} mm3)"
        )
        line = int(toolpath.source_line[motion.move[difference.row]]) if motion is not None else 0
        issues.append(Issue("warning", "nominal-gouge", line, sentence))
    leftovers = [difference for difference in comparison.differences if difference.kind == "rest"]
    if leftovers:
        count = len(leftovers) + comparison.left_out["rest"]
        places = f"{count} places" if count > 1 else "one place"
        volume_mm3, most_mm = (
            comparison.volume_mm3["rest"],
            max(difference.depth_mm for difference in leftovers),
        )
        sentence = f"up to {most_mm:.2f} mm of material is left in {places} ({volume_mm3:.1f} mm3)"
        issues.append(Issue("note", "nominal-rest", 0, sentence))
    return issues


def comparison_lines(comparison: "Comparison") -> list[str]:
    """Return the lines of the summary."""
    lines = []
    for kind, name in (("gouge", "gouges"), ("rest", "rest")):
        of_kind = [one for one in comparison.differences if one.kind == kind]
        count = len(of_kind) + comparison.left_out[of_kind[0].kind] if of_kind else 0
        deepest = f", up to {max(one.depth_mm for one in of_kind):.2f} mm" if of_kind else ""
        volume = f"{comparison.volume_mm3[of_kind[0].kind]:.1f} mm3" if of_kind else "none"
        lines.append(f"  {name:<10} {volume}{f' in {count} places' if count > 1 else ''}{deepest}")
    return lines


def as_dict(comparison: "Comparison") -> dict[str, Any]:
    """Return the figures as JSON has them."""
    return {
        "volume_mm3": dict(comparison.volume_mm3),
        "left_out": dict(comparison.left_out),
        "differences": [
            {
                "kind": difference.kind,
                "volume_mm3": difference.volume_mm3,
                "depth_mm": difference.depth_mm,
                "place_mm": difference.place_mm.tolist(),
            }
            for difference in comparison.differences
        ],
    }


def solids(comparison: "Comparison") -> dict[str, bytes]:
    """Return name and content of an STL file for each kind that there is."""
    import trimesh

    files = {}
    for kind, name in FILES.items():
        meshes = [one.solid for one in comparison.differences if one.kind == kind]
        if meshes:
            both: Any = trimesh.util.concatenate(meshes)
            files[name] = bytes(both.export(file_type="stl"))
    return files


def on_page(comparison: "Comparison") -> dict[str, Any]:
    """Return what the report shows: the same, with nearest samples, corners of triangles (t, 3, 3), a map."""
    import numpy as np

    plain = as_dict(comparison)
    for difference, shown in zip(comparison.differences, plain["differences"], strict=True):
        shown |= {"row": difference.row, "triangles_mm": np.asarray(difference.solid.triangles)}
    return plain | {"above_mm": comparison.above_mm, "at_mm": comparison.at_mm}
