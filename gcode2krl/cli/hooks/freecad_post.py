"""Post processor of FreeCAD: a job becomes a verified KUKA KRL program.

`gcode2krl install-hook freecad` copies this file into FreeCAD's macro folder and fills in the settings below.
It runs in FreeCAD's Python (3.8 or newer), so it imports nothing of gcode2krl: FreeCAD's own LinuxCNC post
writes the G-code, from paths whose drilling cycles are written out, and gcode2krl runs in the Python in which
it is installed. Cutters, stock and name of the job are handed over in a job file.
"""

import importlib.util
import os
import pathlib
import re
import shlex
import struct
import subprocess
import tempfile

import FreeCAD
import Path

# settings, filled in by install-hook
PYTHON = ""
PACKAGES = ""
CELL = ""

TOOLTIP = "Verified KUKA KRL program by gcode2krl"
TOOLTIP_ARGS = "Options of `gcode2krl translate`, for example --cell C:/cells/cell.toml --strict"
UNITS = "G21"
MACHINE_NAME = "KUKA robot (gcode2krl)"

KINDS = {
    "endmill": "flat",
    "ballend": "ball",
    "bullnose": "bull-nose",
    "drill": "drill",
    "vbit": "tapered",
    "chamfer": "tapered",
}
OURS = ("-o", "--output", "--job", "--json", "--name", "-q", "--quiet")
FINDING = re.compile(r"^(?P<file>.*?)(?::(?P<line>\d+))?: (?P<severity>error|warning|note): ")
OPERATION = re.compile(r"^\(begin operation: (.*)\)\s*$")
MESH_TOLERANCE_MM = 0.05
SAME = 1e-6
CYCLES = ("G73", "G81", "G82", "G83")
OF_CYCLES = ("G80", "G98", "G99")
BACK_MM = 0.254
"""How far LinuxCNC stays off the bottom between two pecks: 0.010 inch."""
CLEARED = ("PYTHONHOME", "PYTHONPATH", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")


class PostFailedError(Exception):
    """The program was refused or could not be made; nothing was written."""


def export(objectslist, filename, argstring):
    """Write the KRL program of a job; return its text. Raises `PostFailedError` where it is refused.

    FreeCAD 0.2x names the file; FreeCAD 1.x says "-" and writes the returned text itself.
    """
    job = job_of(objectslist)
    alone = filename == "-"
    place = planned_file(job) if alone else pathlib.Path(filename).absolute()
    stem, program = place.stem, place.with_suffix(".src")
    folder = place.with_suffix(".gcode2krl")  # stays: line numbers of findings are those of the G-code in it
    folder.mkdir(parents=True, exist_ok=True)
    gcode = linuxcnc_gcode(objectslist)
    (folder / f"{stem}.nc").write_bytes(gcode.encode("utf-8"))
    (folder / "job.toml").write_bytes(job_file(job, objectslist, folder, stem).encode("utf-8"))
    target = ["-o", "-", "--name", krl_name(stem)] if alone else ["-o", str(program)]
    done = run([f"{stem}.nc", *target, "--job", "job.toml", *options(argstring)], folder)
    findings = shown(done.stderr.decode("utf-8", "replace"), gcode)
    (folder / "findings.txt").write_bytes("\n".join(findings).encode("utf-8"))
    if done.returncode != 0:
        errors = [line for line in findings if ": error: " in line or line.startswith("error: ")]
        raise PostFailedError(
            "gcode2krl refused the program, nothing was written:\n" + "\n".join(errors or findings)
        )
    if alone:
        if krl_name(stem) != stem:
            say("warning", f"the controller wants the name {krl_name(stem)}.src: name the output file so")
        return done.stdout.decode("ascii").replace("\r\n", "\n")
    for line in done.stdout.decode("utf-8", "replace").splitlines():
        say("note", line)
    return program.read_text(encoding="ascii")


def job_of(objectslist):
    """Return the job that operations belong to."""
    for thing in objectslist:
        for candidate in [thing, *getattr(thing, "InListRecursive", [])]:
            if hasattr(candidate, "Operations") and hasattr(candidate, "Stock"):
                return candidate
    raise PostFailedError("gcode2krl: select a job, or operations of one")


# --- G-code -----------------------------------------------------------------------------------------------


def linuxcnc_gcode(objectslist):
    """Return what FreeCAD's own LinuxCNC post writes."""
    written_out = [WrittenOut(thing) if hasattr(thing, "Path") else thing for thing in objectslist]
    gcode = linuxcnc_post().export(written_out, "-", "--no-show-editor")
    if not gcode:
        raise PostFailedError("gcode2krl: FreeCAD's LinuxCNC post wrote nothing; its message stands above")
    return gcode


def linuxcnc_post():
    """Return FreeCAD's LinuxCNC post as a fresh module: it keeps settings in global variables."""
    for folder in post_folders():
        for name in ("linuxcnc_legacy_post", "linuxcnc_post"):
            file = folder / f"{name}.py"
            if file.is_file():
                spec = importlib.util.spec_from_file_location(name, str(file))
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
                if hasattr(module, "export"):
                    return module
    raise PostFailedError("gcode2krl: this FreeCAD has no LinuxCNC post that it could use")


def post_folders():
    """Return where FreeCAD keeps its posts: CAM of 1.x, Path of 0.2x."""
    folders = []
    for module, below in (("Path.Post", "scripts"), ("PathScripts", "post")):
        try:
            spec = importlib.util.find_spec(module)
        except (ImportError, ValueError):
            continue
        for folder in spec.submodule_search_locations if spec is not None else ():
            folders.append(pathlib.Path(folder) / below)
    return folders


class WrittenOut:
    """A path object of FreeCAD whose drilling cycles are plain moves."""

    def __init__(self, thing):
        self.thing = thing
        self.Path = Path.Path(moves_of(thing.Path.Commands))

    def __getattr__(self, name):
        return getattr(self.thing, name)


def moves_of(commands):
    """Return commands with each drilling cycle written out as G0 and G1, as LinuxCNC drills."""
    moves, at, cycle, leaves_high, start_mm = [], {}, {}, True, None
    for command in commands:
        values = command.Parameters
        if command.Name in OF_CYCLES:
            leaves_high = {"G98": True, "G99": False}.get(command.Name, leaves_high)
            cycle, start_mm = ({}, None) if command.Name == "G80" else (cycle, start_mm)
        elif command.Name in CYCLES:
            cycle.update(values)
            hole = dict(cycle, X=values.get("X", at.get("X")), Y=values.get("Y", at.get("Y")))
            start_mm = at.get("Z", hole["R"]) if start_mm is None else start_mm
            top_mm = max(start_mm, hole["R"]) if leaves_high else hole["R"]
            moves += drilled(command.Name, hole, at.get("Z"), top_mm)
            at.update(X=hole["X"], Y=hole["Y"], Z=top_mm)
        else:
            moves.append(command)
            at.update({axis: values[axis] for axis in "XYZ" if axis in values})
    return moves


def drilled(cycle, hole, z_mm, top_mm):
    """Return the moves of one hole: there above it, down to R, down to the bottom, up."""
    high_mm, low_mm, feed = hole["R"], hole["Z"], hole["F"]
    moves = [rapid(Z=high_mm)] if z_mm is None or z_mm < high_mm else []
    moves += [rapid(X=hole["X"], Y=hole["Y"]), rapid(Z=high_mm)]
    depth_mm, step_mm = high_mm, hole.get("Q") or 0.0
    while cycle in ("G73", "G83") and step_mm > 0.0 and depth_mm - step_mm > low_mm:
        depth_mm -= step_mm
        moves.append(Path.Command("G1", {"Z": depth_mm, "F": feed}))
        moves += [rapid(Z=high_mm)] if cycle == "G83" else []
        moves.append(rapid(Z=depth_mm + BACK_MM))
    moves.append(Path.Command("G1", {"Z": low_mm, "F": feed}))
    if cycle == "G82":
        moves.append(Path.Command("G4", {"P": hole.get("P", 0.0)}))
    return [*moves, rapid(Z=top_mm)]


def rapid(**place):
    """Return a rapid move to a place."""
    return Path.Command("G0", place)


# --- what the job knows -----------------------------------------------------------------------------------


def job_file(job, objectslist, folder, name):
    """Return the text of the job file; a stock that is no box is written as a mesh beside it."""
    offset = (list(job.Fixtures) or ["G54"])[0]
    lines = [f"name = {quoted(name)}", f"work_offset = {quoted(offset)}", ""]
    lines += stock_lines(job, folder, name)
    for number, cutter in sorted(cutters(job, objectslist).items()):
        lines.append(f"[tool.{number}]")
        lines += [f"{key} = {quoted(value)}" for key, value in cutter.items()]
        lines.append("")
    return "\n".join(lines)


def cutters(job, objectslist):
    """Return number -> cutter of the tools that the operations use."""
    controllers = [thing for thing in objectslist if hasattr(thing, "ToolNumber") and hasattr(thing, "Tool")]
    known = {}
    for controller in controllers or job.Tools.Group:
        number, cutter = int(controller.ToolNumber), cutter_of(controller.Tool)
        if cutter is None:
            say(
                "note",
                f"T{number} ({controller.Tool.Label}): the description of this tool in the cell is used",
            )
            continue
        if known.setdefault(number, cutter) != cutter:
            raise PostFailedError(
                f"gcode2krl: the job has two different cutters as T{number}: give them different numbers"
            )
    return known


def cutter_of(tool):
    """Return the sizes of a tool bit, None where its kind is none that gcode2krl knows."""
    kind = KINDS.get(shape_of(tool))
    diameter_mm = size(tool, "TipDiameter" if kind == "tapered" else "Diameter")
    if kind is None or not diameter_mm:
        return None
    radius_mm = size(tool, "CornerRadius") or size(tool, "FlatRadius")
    sizes = {
        "kind": kind,
        "diameter_mm": diameter_mm,
        "teeth": int(getattr(tool, "Flutes", 0)) or None,
        "corner_radius_mm": radius_mm if kind == "bull-nose" else None,
        "flute_length_mm": size(tool, "CuttingEdgeHeight"),
        "shank_diameter_mm": size(tool, "ShankDiameter"),
        "overall_length_mm": size(tool, "Length"),
        "taper_deg": (size(tool, "CuttingEdgeAngle") or 0.0) / 2.0 if kind == "tapered" else None,
        "point_deg": size(tool, "TipAngle") if kind == "drill" else None,
    }
    return {key: value for key, value in sizes.items() if value is not None}


def shape_of(tool):
    """Return the shape of a tool bit as a plain word: the property has had several names."""
    for name in ("ShapeID", "ShapeType", "ShapeName"):
        word = re.sub(r"[^a-z]", "", str(getattr(tool, name, "") or "").lower())
        if word in KINDS:
            return word
    return ""


def size(thing, name):
    """Return a length in mm or an angle in degrees, None where there is none."""
    value = getattr(thing, name, None)
    number = float(getattr(value, "Value", value) or 0.0)
    return round(number, 6) if number > 0.0 else None


def stock_lines(job, folder, name):
    """Return the lines of the stock: a box by its corners, everything else as a mesh."""
    shape = getattr(job.Stock, "Shape", None)
    if shape is None or shape.isNull() or not shape.Volume > 0.0:
        say("note", "the job has no stock: that of the cell is used")
        return []
    box = shape.BoundBox
    if len(shape.Faces) == 6 and abs(shape.Volume / (box.XLength * box.YLength * box.ZLength) - 1.0) < SAME:
        corners = (box.XMin, box.YMin, box.ZMin, box.XMax, box.YMax, box.ZMax)
        low, high = ([round(value, 6) for value in corner] for corner in (corners[:3], corners[3:]))
        return ["[stock]", f"box_mm = [{low}, {high}]", ""]
    mesh = f"{name}.stock.stl"
    (folder / mesh).write_bytes(stl(*shape.tessellate(MESH_TOLERANCE_MM)))
    return ["[stock]", f"mesh = {quoted(mesh)}", ""]


def stl(points, triangles):
    """Return a binary STL."""
    parts = [b"stock".ljust(80), struct.pack("<I", len(triangles))]
    for corners in triangles:
        values = [value for corner in corners for value in points[corner]]
        parts.append(struct.pack("<12fH", 0.0, 0.0, 0.0, *values, 0))
    return b"".join(parts)


# --- gcode2krl --------------------------------------------------------------------------------------------


def run(words, folder):
    """Run gcode2krl in its own Python."""
    if not pathlib.Path(PYTHON).is_file():
        raise PostFailedError(
            f"gcode2krl is no longer at {PYTHON}: install it again, then run `gcode2krl install-hook freecad`"
        )
    environment = {key: value for key, value in os.environ.items() if key not in CLEARED}
    environment.update(PYTHONPATH=PACKAGES, PYTHONUTF8="1", PYTHONIOENCODING="utf-8", NO_COLOR="1")
    return subprocess.run(
        [PYTHON, "-m", "gcode2krl", *words],
        cwd=str(folder),
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        check=False,
    )


def options(argstring):
    """Return the user's options; a backslash is part of a path, not an escape."""
    lexer = shlex.shlex(argstring or "", posix=True)
    lexer.whitespace_split, lexer.escape, lexer.commenters = True, "", ""
    words = list(lexer)
    for word in words:
        if word.split("=")[0] in OURS:
            raise PostFailedError(f"gcode2krl: the hook sets {word} itself; leave it out of the arguments")
    return words if "--cell" in words or not CELL else ["--cell", CELL, *words]


def shown(text, gcode):
    """Show findings in the report view, each with its operation; return them."""
    lines = []
    for line in text.splitlines():
        finding = FINDING.match(line)
        if finding is not None and finding["line"]:
            operation = operation_at(gcode, int(finding["line"]))
            if operation:
                line = f"{line[: finding.end('line')]}, {operation}{line[finding.end('line') :]}"
        say(finding["severity"] if finding is not None else "note", line)
        lines.append(line)
    return lines


def operation_at(gcode, number):
    """Return the label of the operation that a line of G-code belongs to."""
    for line in reversed(gcode.splitlines()[:number]):
        operation = OPERATION.match(line)
        if operation is not None:
            return operation[1]
    return ""


def say(severity, text):
    """Print a line in FreeCAD's report view."""
    console = FreeCAD.Console
    printer = {"error": console.PrintError, "warning": console.PrintWarning}
    printer.get(severity, console.PrintMessage)(text + "\n")


# --- files ------------------------------------------------------------------------------------------------


def planned_file(job):
    """Return where FreeCAD 1.x is going to write; by the job's label where it does not say."""
    try:
        from Path.Post.Utils import FilenameGenerator

        return pathlib.Path(next(FilenameGenerator(job=job).generate_filenames())).absolute()
    except Exception:  # a private part of FreeCAD, which changes
        return pathlib.Path(tempfile.gettempdir()) / "gcode2krl" / f"{job.Label}.src"


def krl_name(stem):
    """Return a name that a controller takes."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", stem).strip("_")[:24]
    return name if re.match(r"[A-Za-z]", name) else f"P_{name}"[:24]


def quoted(value):
    """Return a value as TOML."""
    if not isinstance(value, str):
        return repr(value)
    plain = "".join(sign for sign in value if sign.isprintable())
    escaped = plain.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
