"""Quantities of a record: value, interval, source, and the key that decides the interval."""

import json

import pytest

PART = (
    "G21 G90 G17\nT1 M6\nS13000 M3\nG0 G43 H1 Z20\nG0 X-12 Y0\nG0 Z2\nG1 Z-2 F1500\nG1 X30\nG0 Z20\nM5\nM30\n"
)
CELL = (
    'based_on = "demonstration"\n[stock]\nbox_mm = [[0, -20, -20], [20, 20, 0]]\nresolution_mm = 0.8\n'
    "[material]\nrelative_band = {band}\n"
)


def known(run, tmp_path, band, *command):
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    (tmp_path / "cell.toml").write_text(CELL.format(band=band), encoding="utf-8")
    output = "out" if command else "out.src"
    told = json.loads(run(*command, "part.nc", "--cell", "cell.toml", "-o", output, "--json", code=0).out)
    return told, told["quantities"]


def test_an_unmeasured_material_decides_force_and_deflection(run, tmp_path):
    told, found = known(run, tmp_path, 0.75)
    force, bent, time = (found[key] for key in ("max_force_N", "max_deflection_mm", "time_s"))
    assert force["value"] == told["max_force_N"]
    assert force["high"] == pytest.approx(1.75 * force["value"])
    assert force["low"] == pytest.approx(0.25 * force["value"])
    assert (force["key"], force["share"]) == ("material.linear_edge", 1.0)
    assert bent["key"] == "material.linear_edge"
    assert bent["share"] == pytest.approx(0.75**2 / (0.75**2 + 0.1**2))
    assert time["low"] <= told["time_s"] <= time["high"]
    assert "unverified" in time["source"]


def test_a_measured_material_leaves_the_stiffness_of_a_joint(run, tmp_path):
    bent = known(run, tmp_path, 0.02)[1]["max_deflection_mm"]
    assert bent["key"].startswith("compliance.virtual_joints.")
    assert 0.2 < bent["share"] < 1.0


def test_prediction_and_program_say_the_same(run, tmp_path):
    program = known(run, tmp_path, 0.75)[1]
    prediction = known(run, tmp_path, 0.75, "predict")[1]
    for key, each in program.items():
        assert prediction[key]["key"] == each["key"]
        assert prediction[key]["value"] == pytest.approx(each["value"])


def test_the_terminal_names_what_decides(run, tmp_path):
    known(run, tmp_path, 0.75)
    done = run("part.nc", "--cell", "cell.toml", "-o", "out.src")
    assert "100% of the band of the force is material.linear_edge" in done.out
