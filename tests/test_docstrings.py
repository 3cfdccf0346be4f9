"""Every public name has an example in its docstring, which is run as it stands."""

import doctest
import inspect
import os
import shutil

import numpy as np
import polars as pl
import pytest

import gcode2krl
from gcode2krl import load_cell, predict
from gcode2krl.exchange import ColumnFrame, Findings, Frame, Table, column_units, disk_names
from gcode2krl.gap import Gap
from gcode2krl.krl import VerifyReport, WrittenProgram
from gcode2krl.prediction.plots import Plots

PART = """G21 G90 G17
G54
T1 M6
S13000 M3
G0 G43 H1 Z20
X-20 Y-40
Z2
G1 Z-4 F1500
X120
G0 Z20
X-20 Y40
G1 Z-4
X60 Y60
G0 Z20
M5
M30
"""
CELL = """based_on = "demonstration"

[stock]
box_mm = [[0, -100, -30], [100, 100, 0]]
"""
NO_EXAMPLE = {"__version__"}
"""A text, which has no docstring of its own."""
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
FURTHER = (Frame, Table, ColumnFrame, Findings, Plots, Gap, VerifyReport, WrittenProgram)
"""Classes that public functions return; their examples run, too."""


def own_members(owner):
    """Yield name and object of what a class offers to the public and this package has written."""
    for kind in reversed(owner.__mro__):
        if kind.__module__.startswith("gcode2krl"):
            for name, member in list(vars(kind).items()):
                found = getattr(member, "fget", None) or getattr(member, "__func__", member)
                if not name.startswith("_") and inspect.isfunction(found):
                    yield f"{owner.__name__}.{name}", found


def public():
    """Return name and object of everything in ``gcode2krl.__all__``, and of the methods of its classes."""
    found = {}
    for name in gcode2krl.__all__:
        if name not in NO_EXAMPLE:
            found[name] = getattr(gcode2krl, name)
            if inspect.isclass(found[name]):
                found |= dict(own_members(found[name]))
    return found


def examples_of(name, thing, namespace=None):
    """Return the doctest of one docstring, None where it has no example."""
    text = inspect.getdoc(thing) or ""
    test = doctest.DocTestParser().get_doctest(text, dict(namespace or {}), name, None, 0)
    return test if test.examples else None


PUBLIC = public()
RUN = {
    **PUBLIC,
    **{name: thing for owner in FURTHER for name, thing in own_members(owner)},
    **{owner.__name__: owner for owner in FURTHER},
    "unit_of": column_units.unit_of,
    "column_names": disk_names.column_names,
}
EXAMPLES = {name: test for name, thing in RUN.items() if (test := examples_of(name, thing)) is not None}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with what the examples name: a part, a cell, a prediction and two runs."""
    folder = tmp_path_factory.mktemp("docstrings")
    (folder / "part.nc").write_text(PART, encoding="ascii")
    (folder / "cell.toml").write_text(CELL, encoding="ascii")
    cell = load_cell(folder / "cell.toml")
    predict(folder / "part.nc", cell).save(folder / "prediction")
    loose = predict(folder / "part.nc", cell, dt_s=0.004, effects=["backlash:target=A2,gap_deg=0.02"])
    generator = np.random.default_rng(1)
    for number in (1, 2):
        measure(loose.samples(), folder / f"run-{number}", generator)
    return folder


def measure(true, folder, generator):
    """Write what instruments would have recorded of a robot, every third sample."""
    folder.mkdir()
    (folder / "run.toml").write_text("", encoding="ascii")

    def noisy(values, sigma):
        return (values + generator.normal(0.0, sigma, len(values)))[::3]

    time_s = true["time_s"][::3]
    joints = range(1, 7)
    command = {f"q{n}_cmd_deg": np.degrees(true[f"q{n}_rad"])[::3] for n in joints}
    actual = {f"q{n}_act_deg": noisy(np.degrees(true[f"q{n}_act_rad"]), 3e-4) for n in joints}
    tip = {f"{a}_mm": noisy(true[f"position_{a}_mm"] + true[f"deflection_base_{a}_mm"], 0.02) for a in "xyz"}
    tables = {"controller": {**command, **actual}, "tracker": tip}
    for name, columns in tables.items():
        pl.DataFrame({"t_s": time_s, **columns}).write_csv(folder / f"{name}.csv")


def marked(name):
    """Return a name as a parameter; what draws or diagnoses is slow."""
    slow = name == "diagnose" or name.startswith(("Gap", "Plots"))
    return pytest.param(name, marks=[pytest.mark.slow] if slow else [])


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_has_an_example(name):
    assert name in EXAMPLES, f"{name} has no example in its docstring"


@pytest.mark.parametrize("name", [marked(name) for name in EXAMPLES])
def test_the_example_is_right(name, files, tmp_path, monkeypatch):
    folder = tmp_path / "files"
    shutil.copytree(files, folder)
    monkeypatch.chdir(folder)
    words = []
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    result = runner.run(EXAMPLES[name], out=words.append)
    assert result.failed == 0, "".join(words)
    assert os.getcwd() == str(folder)  # noqa: PTH109 - what the example left behind
