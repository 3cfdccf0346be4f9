"""Shares of the joints, deflection along $BASE, the tip and its direction of travel."""

import math
import runpy

import numpy as np
from hypothesis import given, settings

from gcode2krl.cell import resolve_cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.compliance import (
    deflection_magnitude,
    deflection_of,
    displace,
    feed_direction,
    joint_shares,
    project_normal,
    tip_position,
    tip_velocity,
)
from gcode2krl.compliance.deflection import deflection_along
from tests.compliance import independent
from tests.compliance.loads import HOME, NONE, OTHER_GEOMETRY, other_cell, poses, random_load, vectors
from tests.conftest import ROOT


class TestShares:
    def test_holder_by_hand(self, cell):
        """At HOME a force along x bends the holder about y alone: lever (194, 0, -250) mm, k_B = 6.7e7."""
        force_N = 0.75
        angle = -250.0 * force_N / 6.7e7
        shares = joint_shares(HOME, [force_N, 0, 0], NONE, cell)
        np.testing.assert_allclose(shares[0, 9], [-250 * angle, 0, -194 * angle], rtol=0, atol=1e-9)

    def test_sum_is_the_whole_to_second_order(self, cell):
        q, force, moment = random_load(500, seed=8, force_N=10.0, moment_Nmm=500.0)
        shares = joint_shares(q, force, moment, cell)
        assert shares.shape == (500, len(VIRTUAL_JOINTS), 3)
        whole = displace(q, force, moment, cell)[0]
        np.testing.assert_allclose(shares.sum(axis=1), whole, rtol=0, atol=2e-5)
        shares = joint_shares(q, 0.01 * force, 0.01 * moment, cell)
        whole = displace(q, 0.01 * force, 0.01 * moment, cell)[0]
        np.testing.assert_allclose(shares.sum(axis=1), whole, rtol=0, atol=2e-9)

    def test_no_share_works_against_the_force(self, cell):
        q, force, _ = random_load(500, seed=9, force_N=100.0)
        shares = joint_shares(q, force, NONE, cell)
        assert np.einsum("ij,ikj->ik", force, shares).min() > -1e-6


class TestDeflection:
    def test_along_joints_that_move_the_correction_is_normal_to_the_way_of_the_tip(self):
        q, force, moment = random_load(1000, seed=20)
        qd = np.random.default_rng(21).normal(size=(1000, 6))
        qd[::7] = 0.0
        cell = other_cell()
        ahead, behind = (tip_position(q + step_s * qd, cell) for step_s in (1e-6, -1e-6))
        way = (ahead - behind) @ cell.base_matrix()[:3, :3]
        tool = np.full(1000, next(iter(cell.tool)), dtype=np.int32)
        bent, correction = deflection_along(q, qd, force, moment, cell, tool)
        expected, normal = deflection_of(q, force, moment, way, cell)
        np.testing.assert_array_equal(bent, expected)
        np.testing.assert_allclose(correction, normal, rtol=0, atol=1e-7)
        np.testing.assert_array_equal(correction[::7], -bent[::7])

    def test_is_along_base_and_the_correction_normal_to_the_feed(self):
        q, force, moment = random_load(1000, seed=10)
        feed = np.random.default_rng(11).normal(size=(1000, 3))
        feed[::7] = 0.0
        turn = other_cell().base_matrix()[:3, :3]
        deflection, correction = deflection_of(q, force, moment, feed, other_cell())
        in_root = displace(q, force @ turn.T, moment @ turn.T, other_cell())[0]
        np.testing.assert_allclose(deflection, in_root @ turn, rtol=0, atol=1e-12)
        np.testing.assert_allclose(correction, -project_normal(deflection, feed), rtol=0, atol=0)
        np.testing.assert_array_equal(correction[::7], -deflection[::7])

    @settings(max_examples=25, deadline=None)
    @given(poses, vectors, vectors, vectors)
    def test_turning_base_changes_no_physics(self, cell, q, force, feed, abc):
        degrees = dict(zip(("a_deg", "b_deg", "c_deg"), 180 * np.array(abc), strict=True))
        turned_cell = resolve_cell(
            {
                "based_on": "demonstration",
                "frames": {"base": {"x_mm": 100.0, "y_mm": 0.0, "z_mm": 0.0, **degrees}},
            }
        )
        turn = turned_cell.base_matrix()[:3, :3]
        force, feed = 1000 * np.array([force]), np.round([feed], 3)
        moment = 30 * force[:, ::-1]
        plain = deflection_of([q], force, moment, feed, cell)  # its $BASE is parallel to the root
        turned = deflection_of([q], force @ turn, moment @ turn, feed @ turn, turned_cell)
        for wanted, found in zip(plain, turned, strict=True):
            np.testing.assert_allclose(found @ turn.T, wanted, rtol=0, atol=1e-9)

    def test_air_is_exactly_zero(self, cell):
        q, _, _ = random_load(300, seed=12)
        for values in deflection_of(q, NONE, NONE, [1.0, 2.0, 3.0], cell):
            assert not values.any()
            assert not np.signbit(values).any()

    def test_any_number_of_threads_gives_the_same_bits(self):
        q, force, moment = random_load(41_000, seed=13)
        one = deflection_of(q, force, moment, force[::-1], other_cell(), threads=1)
        two = deflection_of(q, force, moment, force[::-1], other_cell(), threads=2)
        for wanted, found in zip(one, two, strict=True):
            np.testing.assert_array_equal(found, wanted)

    def test_magnitude_for_maps(self, cell):
        q, force, _ = random_load(100, seed=14)
        q[3] = math.nan
        deflection, correction = deflection_of(q, force, NONE, [0, 0, 1.0], cell)
        normal = deflection_magnitude(q, force, [0, 0, 1.0], cell)
        np.testing.assert_allclose(normal, np.linalg.norm(correction, axis=1), rtol=1e-14)
        np.testing.assert_allclose(normal, np.hypot(*deflection[:, :2].T), rtol=1e-12)
        whole = deflection_magnitude(q, force, NONE, cell)
        np.testing.assert_allclose(whole, np.linalg.norm(deflection, axis=1), rtol=1e-14)
        assert np.flatnonzero(np.isnan(normal)).tolist() == [3]
        along_x = deflection_magnitude(q, [500.0, 0, 0], [1.0, 0, 0], cell)
        assert along_x.shape == (100,)


class TestTip:
    def test_velocity_is_the_difference_quotient_of_the_oracle(self):
        q, _, _ = random_load(200, seed=15)
        qd = np.random.default_rng(16).normal(size=(200, 6))
        tool = other_cell().tool_matrix(1)[:3, 3]
        step_s = 1e-5
        ahead, behind = (
            independent.displaced(q + s * step_s * qd, NONE, NONE, geometry=OTHER_GEOMETRY, tool=tool)[0]
            for s in (1, -1)
        )
        wanted = (ahead - behind) / (2 * step_s) @ other_cell().base_matrix()[:3, :3]
        # cubic term of the quotient: 2500 mm·(rad/s)³·step²/6 of some tens
        np.testing.assert_allclose(tip_velocity(q, qd, other_cell()), wanted, rtol=0, atol=2e-5)

    def test_direction_has_length_1_or_0(self, cell):
        q, _, _ = random_load(50, seed=17)
        qd = np.random.default_rng(18).normal(size=(50, 6))
        qd[::5] = 0.0
        qd[1] = 1e-11  # rounding of a joint at rest
        direction = feed_direction(q, qd, cell)
        length = np.linalg.norm(direction, axis=1)
        rests = (np.arange(50) % 5 == 0) | (np.arange(50) == 1)
        assert (length[rests] == 0).all()
        np.testing.assert_allclose(length[~rests], 1.0, rtol=1e-14)
        velocity = tip_velocity(q, qd, cell)[~rests]
        assert ((velocity * direction[~rests]).sum(axis=1) > 0).all()

    def test_unknown_joint_speeds_have_no_direction(self, cell):
        assert np.isnan(feed_direction(HOME, np.full((1, 6), math.nan), cell)).all()


def test_validation_of_the_paper(cell):
    """Section 3.1 of Haehn & Weigold 2020: 60 cases of 750 N, with our end effector."""
    benchmark = runpy.run_path(str(ROOT / "benchmarks" / "compliance_paper.py"))
    index, q, force = benchmark["cases"](cell)
    wanted_tip = np.array(benchmark["POSITIONS_MM"])[index[:, 1]]
    np.testing.assert_allclose(tip_position(q, cell), wanted_tip, rtol=0, atol=1e-9)
    magnitude = np.linalg.norm(displace(q, force, NONE, cell)[0], axis=1)
    assert 1.66 <= magnitude.mean() <= 1.90  # paper: 1.72 calculated, 1.83 measured
    oracle = np.linalg.norm(independent.displaced(q, force, np.zeros((60, 3)))[1], axis=1)
    np.testing.assert_allclose(magnitude, oracle, rtol=0, atol=1e-9)
    means = [magnitude[index[:, 0] == k].mean() for k in range(3)]
    np.testing.assert_allclose([magnitude.mean(), *means], [1.7235, 1.239, 2.167, 1.764], atol=6e-4)
    np.testing.assert_allclose([magnitude.min(), magnitude.max()], [0.374, 2.817], atol=6e-4)
