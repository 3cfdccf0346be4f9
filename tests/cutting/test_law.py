import math

import numpy as np
import pytest

from gcode2krl.cell.library import names, read_model
from gcode2krl.cell.sections import Kienzle, Material, Tool
from gcode2krl.cutting.force import cutting_load
from gcode2krl.cutting.law import (
    feed_per_tooth,
    law_array,
    linear_edge_law,
    spindle_power,
)
from gcode2krl.errors import NotUnderstoodError

pi = math.pi


@pytest.mark.parametrize("model", names("materials"))
def test_every_material_of_the_library_validates_and_cuts(model):
    data = read_model("materials", model)
    material = Material.model_validate(data)
    assert (material.linear_edge is None) != (material.kienzle is None)
    assert material.model == model
    assert material.source
    assert material.name
    assert "sure" in data
    assert 0.3 <= material.relative_band <= 1.5
    tool = Tool(diameter_mm=16, teeth=3)
    force = cutting_load(tool, law_array(material), [[0, pi]], 1.0, 0.05).force_N[0]
    assert force[0] < 0 < force[1]  # a slot: held back, and pushed to the left


def test_what_is_recalled_or_reinterpreted_says_so():
    sure = {model: read_model("materials", model)["sure"] for model in names("materials")}
    assert {m for m, s in sure.items() if s == "memory"} == {"cast iron GG25", "C45", "42CrMo4", "Ti6Al4V"}
    assert {m for m, s in sure.items() if s == "assumption"} == {"AW-2017A", "AlMgSi0.5"}


def test_coefficients_as_the_source_has_them():
    al = Material.model_validate(read_model("materials", "al 7075-t6"))
    np.testing.assert_array_equal(law_array(al), [0, 796.1, 168.8, 222.0, 27.7, 30.8, 1.4, 0])
    steel = Material.model_validate(read_model("materials", "steel D12 z4"))
    ks_sin, ks_cos = 2160 * math.sin(math.radians(68)), 2160 * math.cos(math.radians(68))
    np.testing.assert_allclose(law_array(steel)[1:3], [ks_sin, ks_cos], rtol=1e-4)
    wrought = Material.model_validate(read_model("materials", "Al wrought"))
    np.testing.assert_array_equal(law_array(wrought), [1, 641, 0.27, 0.4, 0.2, 0, 0, 0])


@pytest.mark.parametrize("model", ["AW-2017A", "Al 6082-T6", "Al wrought"])
def test_the_papers_546_N_are_a_slot_of_plausible_depth(model):
    """Haehn and Weigold 2020 give no depth: with published sets of aluminium it is about 8 to 15 mm."""
    law = law_array(Material.model_validate(read_model("materials", model)))
    tool = Tool.model_validate(read_model("tools", "flat 16 z3"))
    f_z = feed_per_tooth(25.0, 13_000 * 2 * pi / 60, 3)
    depth = np.linspace(1, 20, 400)
    force = np.linalg.norm(cutting_load(tool, law, [0, pi], depth, f_z).force_N, axis=1)
    assert 8 < np.interp(546.0, force, depth) < 15.5


def test_kienzle_at_one_millimetre():
    """At h = 1 mm on one mm of edge the tangential force is kc1.1: a tooth that only plunges."""
    law = law_array(Material(kienzle=Kienzle(kc11=641, mc=0.27)))
    tool = Tool(kind="drill", diameter_mm=2, point_deg=90, teeth=1, flute_length_mm=30)
    lip = math.sqrt(2)  # of a 90° point of 1 mm radius; the chip is f·cos(kappa)
    load = cutting_load(tool, law, [[0, 2 * pi]], 5.0, math.sqrt(2), pi / 2)
    assert load.torque_Nmm[0] == pytest.approx(641 * lip * 0.5)


def test_material_without_a_law_is_refused():
    with pytest.raises(NotUnderstoodError, match="neither linear_edge nor kienzle"):
        law_array(Material(model="foam"))


def test_feed_per_tooth():
    omega = 13_000 * 2 * pi / 60  # the paper's cut: 25 mm/s at 13,000 rpm, three teeth
    f_z = feed_per_tooth([25.0, 25.0, 0.0, 25.0], [omega, -omega, omega, 0.0], 3)
    np.testing.assert_allclose(f_z, [0.0385, 0.0385, 0, 0], atol=5e-5)


def test_power():
    np.testing.assert_allclose(spindle_power([4703.0, 0.0], [-100.0, 100.0]), [470.3, 0.0])


def test_linear_edge_law_needs_six():
    with pytest.raises(NotUnderstoodError, match="six finite numbers"):
        linear_edge_law([1.0, 2.0])
