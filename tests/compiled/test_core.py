"""The compiled core: built from these sources, of one mind with the Python modules, refusing wrong arrays."""

import ctypes
import importlib.util
import os
import subprocess
import sys
import threading
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode2krl.compiled import core
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import FLOAT, FLOATS, INT, OUT_FLOATS, StructOf
from gcode2krl.compiled.inputs import contiguous, locked, shaped

ROOT = Path(__file__).parents[2]


def native(name):
    spec = importlib.util.spec_from_file_location(f"native_{name}", ROOT / "native" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_constants_of_the_core_are_those_of_the_python_modules():
    constants = native("constants")
    if not constants.HEADER.exists():
        pytest.skip("the core was built elsewhere")
    assert constants.HEADER.read_text(encoding="ascii") == constants.header()


def test_a_view_has_the_shape_of_the_array():
    for shape, seen in (((5,), (5, 1)), ((4, 3), (4, 3)), ((2, 3, 4), (2, 12)), ((0, 3), (0, 1))):
        view = FLOATS.from_param(np.zeros(shape))
        assert (view.rows, view.columns) == seen


def test_another_type_or_order_is_refused():
    for array in (np.zeros(3, np.float32), np.zeros((4, 4))[:, :2], np.zeros((3, 2)).T):
        with pytest.raises(TypeError, match="contiguous array of float64"):
            FLOATS.from_param(array)


def test_an_array_that_must_not_be_written_to_is_no_output():
    array = np.zeros(3)
    array.flags.writeable = False
    assert FLOATS.from_param(array).rows == 3
    with pytest.raises(TypeError, match="not writeable"):
        OUT_FLOATS.from_param(array)


def test_a_named_tuple_becomes_a_struct_of_views_and_numbers():
    record = namedtuple("Record", "last values first")(2.5, np.zeros((4, 3)), 7)
    taken = StructOf(first=INT, values=FLOATS, last=FLOAT).from_param(record)._obj
    assert (taken.first, taken.values.rows, taken.values.columns, taken.last) == (7, 4, 3, 2.5)
    assert taken.values.at == record.values.ctypes.data
    locked = record._replace(values=np.frombuffer(bytes(8)))
    with pytest.raises(TypeError, match="not writeable"):
        StructOf(values=OUT_FLOATS).from_param(locked)


@pytest.mark.parametrize(
    ("build", "expected"),
    [("plain", "core"), ("", "core_wide" if core._library().core_is_wide() else "core")],
)
def test_the_processor_or_the_environment_chooses_the_build(build, expected):
    code = "from gcode2krl.compiled import core; print(core._library()._name)"
    environment = os.environ | {core.BUILD_VARIABLE: build}
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True
    )
    assert Path(run.stdout.strip()).stem == expected


def test_a_core_of_other_sources_is_refused_with_the_remedy(monkeypatch):
    monkeypatch.setattr(core, "sources_digest", lambda: "another")
    library = ctypes.CDLL(core._library()._name)
    if not (core._NATIVE / "core.h").exists():
        pytest.skip("no sources beside the installed package")
    with pytest.raises(core.InstallationError, match="older than its sources"):
        core._refuse_other_sources(library)


def test_a_missing_core_is_one_clear_line(monkeypatch, tmp_path):
    monkeypatch.setattr(core, "_BUILT", tmp_path)
    with pytest.raises(core.InstallationError, match="is missing from"):
        core._loaded("core")


def test_a_change_of_any_source_of_the_core_is_noticed():
    made = native("constants")
    modules = {
        *made.MODULES.values(),
        made.FINDINGS,
        *(name for name, _ in (*made.RECORDS.values(), *made.ARGUMENTS.values())),
    }
    sources = {path.relative_to(core._NATIVE.parent).as_posix() for path in core._sources()}
    assert {f"{name.replace('.', '/')}.py" for name in modules} <= sources
    assert {"native/core.c", "native/gcode/block.h", "gcode2krl/gcode/findings.toml"} <= sources
    assert "native/constants.h" not in sources  # it is made of the others


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands in for the compiler")
def test_a_compiler_that_finds_no_headers_is_passed_over(tmp_path):
    build = native("build")
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o755)
    assert not build._works(str(broken))


@pytest.mark.parametrize("target", native("build").TARGETS)
def test_every_platform_of_a_wheel_has_a_library_of_its_own_kind(target):
    machine = native("build").Machine.named(target)
    names = [name for name, _ in native("build")._variants(machine, checked=False, by_zig=True)]
    assert names == (
        ["core", "core_wide"] if target in ("x86_64-windows-gnu", "x86_64-linux-gnu") else ["core"]
    )
    assert machine.flags[0] == "-target"


@given(st.integers(0, 200), st.integers(1, 50))
def test_every_row_once_and_in_order(count, rows):
    spans = in_chunks(lambda start, end: (start, end), chunk_borders(count, rows))
    assert [row for start, end in spans for row in range(start, end)] == list(range(count))
    assert all(0 < end - start <= rows for start, end in spans)


def test_results_do_not_depend_on_who_is_first():
    second_may_end = threading.Event()

    def work(start, end):
        if start == 0:
            second_may_end.wait(0.05)
        else:
            second_may_end.set()
        return np.arange(start, end)

    assert np.concatenate(in_chunks(work, chunk_borders(30, 10))).tolist() == list(range(30))


def test_an_error_in_a_chunk_comes_out():
    def work(start, end):
        if start == 20:
            raise ValueError("row 20")

    with pytest.raises(ValueError, match="row 20"):
        in_chunks(work, chunk_borders(30, 10))


def test_locked_is_a_view_and_leaves_the_array_itself_open():
    array = np.zeros(3)
    view = locked(array)
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0
    array[0] = 2.0
    assert view[0] == 2.0


@pytest.mark.parametrize("values", [[1, 2, 3], np.arange(6)[::2], np.zeros(3, dtype=np.float32)])
def test_contiguous_is_one_type_whatever_comes_in(values):
    found = contiguous(values)
    assert found.dtype == np.float64
    assert found.flags.c_contiguous
    assert found.tolist() == np.asarray(values).tolist()


def test_contiguous_does_not_copy_what_fits():
    array = np.zeros((4, 3))
    assert np.shares_memory(contiguous(array), array)


def test_shaped_takes_any_length_where_minus_one_stands():
    assert shaped("force", np.zeros((5, 3)), -1, 3).shape == (5, 3)


@pytest.mark.parametrize(
    ("shape", "wanted", "words"),
    [
        ((5, 2), (-1, 3), r"force has shape \(5, 2\), not \(n, 3\)"),
        ((3,), (-1, 3), r"force has shape \(3,\), not \(n, 3\)"),
        ((4, 3), (5, 3), r"force has shape \(4, 3\), not \(5, 3\)"),
    ],
)
def test_a_wrong_shape_is_named(shape, wanted, words):
    with pytest.raises(ValueError, match=words):
        shaped("force", np.zeros(shape), *wanted)
