"""Runs in FreeCAD: make a job of six kinds of operations and post it with the hook.

The arguments come as JSON in GCODE2KRL_JOB: ``stock`` (box or cylinder), ``drill_tool`` (tool number of the
drill), ``output`` (the program, or "-"), ``arguments`` of the post, ``result`` (file for what happened).
"""

import json
import os
import pathlib
import sys
import traceback

import FreeCAD
import Part
from FreeCAD import Placement, Rotation, Vector
from PathScripts import (
    PathAdaptive,
    PathDrilling,
    PathHelix,
    PathJob,
    PathMillFace,
    PathPocketShape,
    PathPost,
    PathPostProcessor,
    PathPreferences,
    PathProfile,
    PathStock,
    PathToolBit,
    PathToolController,
    PathUtils,
)

WANTED = json.loads(os.environ["GCODE2KRL_JOB"])
CUTTERS = {
    1: ("endmill.fcstd", {"Diameter": 10.0, "Length": 72.0, "CuttingEdgeHeight": 22.0,
                          "ShankDiameter": 10.0}, 3),
    2: ("drill.fcstd", {"Diameter": 6.0, "Length": 80.0}, 2),
    3: ("bullnose.fcstd", {"Diameter": 8.0, "FlatRadius": 1.0, "Length": 60.0, "CuttingEdgeHeight": 26.0,
                           "ShankDiameter": 8.0}, 4),
}  # fmt: skip


def part(document):
    """Return a block of 100 x 60 x 20 mm with a pocket, a round hole and two small holes."""
    solid = Part.makeBox(100, 60, 20)
    solid = solid.cut(Part.makeBox(30, 25, 6, Vector(10, 15, 14)))
    solid = solid.cut(Part.makeBox(20, 25, 5, Vector(46, 15, 15)))
    solid = solid.cut(Part.makeCylinder(9, 20, Vector(82, 30, 0)))
    for y in (10, 50):
        solid = solid.cut(Part.makeCylinder(3, 20, Vector(92, y, 0)))
    thing = document.addObject("Part::Feature", "Body")
    thing.Shape = solid
    document.recompute()
    return thing


def faces(thing, test):
    return [f"Face{number}" for number, face in enumerate(thing.Shape.Faces, 1) if test(face)]


def hole(radius_mm):
    return lambda face: (
        face.Surface.TypeId == "Part::GeomCylinder" and abs(face.Surface.Radius - radius_mm) < 1e-6
    )


def floor(z_mm):
    return lambda face: (
        face.Surface.TypeId == "Part::GeomPlane"
        and abs(face.BoundBox.ZMax - z_mm) < 1e-6
        and (abs(face.BoundBox.ZLength) < 1e-6)
    )


def controllers(job):
    """Return number -> tool controller of the cutters; the job's default tool is removed."""
    shapes = pathlib.Path(FreeCAD.getHomePath()) / "Mod" / "Path" / "Tools" / "Shape"
    for old in list(job.Tools.Group):
        job.Document.removeObject(old.Name)
    made = {}
    for number, (shape, sizes, flutes) in CUTTERS.items():
        bit = PathToolBit.Factory.Create(f"cutter {number}", str(shapes / shape))
        for name, value in sizes.items():
            setattr(bit, name, value)
        bit.Flutes = flutes
        number = WANTED["drill_tool"] if number == 2 else number
        controller = PathToolController.Create(f"TC{number}", bit, number)
        controller.HorizFeed = controller.VertFeed = 10.0  # mm/s
        controller.HorizRapid = controller.VertRapid = 100.0
        controller.SpindleSpeed, controller.SpindleDir = 8000, "Forward"
        job.Proxy.addToolController(controller)
        made[number] = controller
    return made


def add(module, label, controller, base=None, **settings):
    """Add an operation with a tool, faces and settings."""
    # without a window FreeCAD cannot ask which of several tools is meant: let it find only this one
    PathUtils.getToolControllers = lambda *_: [controller]
    operation = module.Create(label)
    operation.ToolController = controller
    if base is not None:
        operation.Base = base
    for name, value in settings.items():
        setattr(operation, name, value)
    operation.recompute()
    return operation


def make():
    """Return the document's job."""
    document = FreeCAD.newDocument("part")
    body = part(document)
    job = PathJob.Create("Job", [body], None)
    if WANTED["stock"] == "cylinder":
        job.Stock = PathStock.CreateCylinder(job, 64.0, 23.0, Placement(Vector(50.0, 30.0, -2.0), Rotation()))
    else:
        job.Stock = PathStock.CreateBox(
            job, Vector(106.0, 66.0, 23.0), Placement(Vector(-3.0, -3.0, -2.0), Rotation())
        )
    document.recompute()
    model = job.Model.Group[0]
    tools = controllers(job)
    mill, bull, drill = tools[1], tools[3], tools[WANTED["drill_tool"]]
    add(PathMillFace, "Facing", mill, [(model, faces(model, floor(20.0)))], StepOver=60,
        BoundaryShape="Stock")  # fmt: skip
    add(PathPocketShape, "Pocket", mill, [(model, faces(model, floor(14.0)))], StepDown=3.0, StepOver=40)
    add(PathAdaptive, "Adaptive", mill, [(model, faces(model, floor(15.0)))], StepDown=5.0, Side="Inside",
        OperationType="Clearing")  # fmt: skip
    add(PathHelix, "Helix", mill, [(model, faces(model, hole(9.0)))], StepDown=2.0)
    add(PathProfile, "Profile", bull, StepDown=5.0)
    add(PathDrilling, "Drilling", drill, [(model, faces(model, hole(3.0)))])
    document.recompute()
    return job


def posted(job):
    """Return what FreeCAD's own post command does with the job, without its dialogs."""
    job.PostProcessor = "gcode2krl"
    job.PostProcessorArgs = WANTED["arguments"]
    job.PostProcessorOutputFile = WANTED["output"]
    command = PathPost.CommandPathPost()
    (objects,) = command.buildPostList(job)
    if WANTED["output"] == "-":
        return PathPostProcessor.PostProcessor.load("gcode2krl").export(objects, "-", WANTED["arguments"])
    failed, text, _ = command.exportObjectsWith(objects, job)
    return None if failed else text


result = {"listed": "gcode2krl" in PathPreferences.allEnabledPostProcessors()}
try:
    job = make()
    result["moves"] = {each.Label: len(each.Path.Commands) for each in job.Operations.Group}
    result["text"] = posted(job)
except Exception as error:
    result["error"] = str(error)
    result["trace"] = traceback.format_exc()
pathlib.Path(WANTED["result"]).write_text(json.dumps(result), encoding="utf-8")
sys.stdout.flush()
os._exit(0)  # FreeCAD would wait for commands
