"""Findings on samples that come some at a time, against a plain loop over all of them."""

from dataclasses import fields, replace

import numpy as np
import pytest

from gcode2krl.cell import resolve_cell
from gcode2krl.cutting.findings import Cut, Findings
from gcode2krl.cutting.law import THICK_CHIP_MM, THIN_CHIP_MM
from gcode2krl.tables import Forces, rows_of

SPEEDS_RPM = np.array([0.0, -600.0, 600.0, 590.0, 6000.0, 12000.0])
CYCLE_S = 0.012


def cell_with_modes():
    return resolve_cell({"based_on": "demonstration", "compliance": {"modes_hz": [10.0, 21.0, 100.0]}})


def random_cut(seed, count, cell):
    """Samples in runs of one spindle speed and tool; some arcs are missing, some rows have no feed."""
    random = np.random.default_rng(seed)
    run = np.cumsum(random.random(count) < 5.0 / max(count, 1))
    speeds = random.choice(SPEEDS_RPM, count + 1) * (2.0 * np.pi / 60.0)
    tools = random.choice(sorted(cell.tool), count + 1).astype(np.int32)
    phi = np.sort(random.uniform(0.0, np.pi, (count, 4)), axis=1)
    phi[random.random(count) < random.random()] = np.nan
    phi[random.random(count) < 0.5, 2:] = np.nan
    zero = np.zeros(count)
    feed = random.choice([0.0, 0.5 * THIN_CHIP_MM, 0.05, 3.0 * THICK_CHIP_MM], count)
    cut = Cut(
        source_line=np.arange(10, count + 10, dtype=np.int32),
        rapid=zero > 0,
        engaged=np.isfinite(phi[:, 0]),
        spindle_rad_s=speeds[run],
        f_z_mm=feed,
        ramp_rad=random.uniform(-0.5, 0.5, count),
        centre_mm=zero,
        overlap_mm=np.zeros((count, 2)),
        step_mm=zero,
        descent_mm=zero,
    )
    three = np.zeros((count, 3))
    forces = Forces(
        force_base_N=three,
        moment_base_Nmm=three,
        peak_N=zero,
        torque_Nmm=zero,
        a_p_mm=zero,
        a_e_mm=zero,
        phi_rad=phi,
        tool=tools[run],
    )
    return cut, forces


def found_in(cut, forces, cell, codes, rows=7_000):
    """Return the findings of these codes on samples that are taken so many rows at a time."""
    findings = Findings(cell, sorted(cell.tool), guessed=False, blend_mm=0.0, cycle_s=CYCLE_S)
    for start in range(0, len(forces), rows):
        columns = {spec.name: getattr(cut, spec.name)[start : start + rows] for spec in fields(cut)}
        findings.take(Cut(**columns), rows_of(forces, start, start + rows))
    return [issue for issue in findings.issues() if issue.code in codes]


CHIPS, MODES = {"chip-thin", "chip-thick"}, {"near-mode"}


def shares(phi, ramp):
    """Return the largest chips (n,) over arcs (n, 4) in the front of the cutter, in feeds per tooth."""
    first, last = phi[:, ::2], phi[:, 1::2]
    sine = np.where((first <= np.pi / 2) & (last >= np.pi / 2), 1.0, np.fmax(np.sin(first), np.sin(last)))
    sine = np.fmax.reduce(sine, axis=1, initial=0.0)
    return np.maximum(np.maximum(sine * np.cos(ramp), np.sin(ramp)), 0.0)


@pytest.mark.parametrize(
    ("arcs", "gamma", "share"),
    [
        ([0.0, np.pi], 0.0, 1.0),
        ([0.0, np.pi / 6], 0.0, 0.5),
        ([5 * np.pi / 6, np.pi], 0.0, 0.5),
        ([0.0, np.pi / 6, 2 * np.pi / 3, np.pi], 0.0, np.sqrt(0.75)),
        ([np.nan, np.nan, 2.0, 2.5 * np.pi], 0.0, 1.0),
        ([0.0, 2 * np.pi], np.pi / 2, 1.0),
        ([0.0, np.pi / 6], 0.3, 0.5 * np.cos(0.3)),
        ([0.0, np.pi / 6], 0.8, np.sin(0.8)),
        ([np.pi, 2 * np.pi], 0.0, 0.0),
        ([np.nan, np.nan], 0.3, 0.0),
        ([0.0, 2 * np.pi], -np.pi / 2, 0.0),
    ],
)
def test_the_largest_chip_of_arcs_is_at_its_limit_where_its_share_says(arcs, gamma, share):
    cut, forces = random_cut(1, 100, cell_with_modes())
    phi = np.tile(arcs, (100, 1))
    for beside in (0.999_999, 1.000_001):
        thin, thick = (limit / max(share, 0.01) * beside for limit in (THIN_CHIP_MM, THICK_CHIP_MM))
        for feed, code, is_wrong in ((thin, "chip-thin", beside < 1.0), (thick, "chip-thick", beside > 1.0)):
            columns = {"f_z_mm": np.full(100, feed), "ramp_rad": np.full(100, gamma)}
            cuts = replace(cut, engaged=np.full(100, True), **columns)
            codes = {
                issue.code for issue in found_in(cuts, replace(forces, phi_rad=phi), cell_with_modes(), CHIPS)
            }
            assert codes == ({code} if is_wrong else set()) if share else codes == {"chip-thin"}


def test_cuts_beyond_what_was_measured_are_told_with_their_range():
    material = {"measured_f_z_mm": [0.02, 0.1], "measured_a_p_mm": [1.0, 4.0]}
    cell = resolve_cell({"based_on": "demonstration", "material": material})
    cut, forces = random_cut(2, 20_000, cell)
    forces = replace(forces, a_p_mm=np.random.default_rng(3).uniform(0.0, 6.0, 20_000))
    cutting = cut.engaged & (cut.f_z_mm > 0.0)
    ranges, wrong = [], np.zeros(20_000, dtype=bool)
    for name, values, low, high in (("f_z", cut.f_z_mm, 0.02, 0.1), ("a_p", forces.a_p_mm, 1.0, 4.0)):
        beyond = cutting & ((values < low * 0.99) | (values > high * 1.01))
        ranges.append(f"{name} {values[beyond].min():.3f}..{values[beyond].max():.3f} mm")
        wrong |= beyond
    (issue,) = found_in(cut, forces, cell, {"force-unmeasured"})
    assert issue.line == np.argmax(wrong) + 10
    assert f"cuts with {', '.join(ranges)}, for" in issue.message
    assert f"in {wrong.sum() / cutting.sum():.0%} of the time" in issue.message


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("count", [1, 300, 40_000])
def test_chips_are_counted_as_one_by_one(seed, count):
    cut, forces = random_cut(seed, count, cell_with_modes())
    rows = [row for row in range(count) if np.isfinite(forces.phi_rad[row, 0]) and cut.f_z_mm[row] > 0.0]
    chip = cut.f_z_mm * shares(forces.phi_rad, cut.ramp_rad)
    expected = []
    for code, wrong in (
        ("chip-thin", [row for row in rows if chip[row] < THIN_CHIP_MM]),
        ("chip-thick", [row for row in rows if chip[row] > THICK_CHIP_MM]),
    ):
        if wrong and len(wrong) * CYCLE_S >= 0.1 and len(wrong) >= 0.05 * len(rows):
            expected.append((code, wrong[0] + 10, f"in {len(wrong) / len(rows):.0%} of the time"))
    found = found_in(cut, forces, cell_with_modes(), CHIPS)
    expected.sort(key=lambda entry: entry[1])
    assert [(issue.code, issue.line) for issue in found] == [(code, line) for code, line, _ in expected]
    for issue, (_, _, words) in zip(found, expected, strict=True):
        assert words in issue.message


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("count", [0, 1, 300, 40_000])
def test_modes_are_found_for_each_speed_and_tool_at_the_first_cut_with_it(seed, count):
    cell = cell_with_modes()
    cut, forces = random_cut(seed, count, cell)
    first_of_speed, pairs = {}, set()
    for row in np.flatnonzero(np.isfinite(forces.phi_rad[:, 0])).tolist():
        speed = abs(float(cut.spindle_rad_s[row]))
        first_of_speed.setdefault(speed, row)
        pairs.add((speed, int(forces.tool[row])))
    expected = []
    for speed, tool in sorted(pairs):
        turns_hz = speed / (2.0 * np.pi)
        teeth = cell.tool[tool].teeth
        for mode in (10.0, 21.0, 100.0):
            orders = {1, 2, 3, teeth, 2 * teeth, 3 * teeth}
            if any(abs(order * turns_hz - mode) <= 0.15 * mode for order in orders):
                expected.append((first_of_speed[speed] + 10, f" of T{tool} (", f" {mode:g} Hz"))
    found = found_in(cut, forces, cell, MODES)
    expected.sort(key=lambda entry: entry[0])
    assert [issue.line for issue in found] == [line for line, _, _ in expected]
    for issue, (_, tool_words, mode_words) in zip(found, expected, strict=True):
        assert tool_words in issue.message
        assert mode_words in issue.message


def test_the_constructed_cuts_meet_modes_and_wrong_chips():
    cell = cell_with_modes()
    cuts = [random_cut(seed, 40_000, cell) for seed in range(8)]
    assert sum(len(found_in(*cut, cell, MODES)) for cut in cuts) >= 8
    assert {issue.code for cut in cuts for issue in found_in(*cut, cell, CHIPS)} == CHIPS
