"""What an effect states of itself: roles, usual bounds, where it is a nuisance, what it depends on."""

import re

import pytest

from gcode2krl import load_cell
from gcode2krl.effects import Dependence, Effect, Mismatch, Parameter, Role, Where, library
from gcode2krl.effects.effect import LINKS
from gcode2krl.effects.registry import what_is_wrong
from gcode2krl.units import DEG_PER_RAD
from tests.conftest import ROOT

KNOWN, CELL = library(), load_cell()
EVERY = frozenset(LINKS)


def size(name="much", **more):
    return Parameter(name, "mm", 0.0, 1.0, nominal=0.0, start=0.5, source="test", **more)


def form(name, role=None, unit="", **more):
    return Parameter(name, unit, 0.0, 1.0, nominal=None, start=0.5, source="test", role=role, **more)


def effect_of(*parameters, **stated):
    made = type("Own", (Effect,), {"name": "own", "parameters": parameters, **stated})
    return made()


def test_a_role_that_is_not_stated_follows_from_the_nominal_value():
    assert size().role is Role.SIZE
    assert form("decay_s").role is Role.SHAPE
    assert (size().is_shape, form("decay_s").is_shape) == (False, True)
    assert (size().unset, form("decay_s").unset) == (0.0, 0.5)


def test_roles_of_the_library_are_stated_once():
    found = {
        role: {(e.name, p.name) for e in KNOWN.values() for p in e.parameters if p.role is role}
        for role in (Role.PHASE, Role.COUNT, Role.FREQUENCY, Role.MOMENT)
    }
    assert found == {
        Role.PHASE: {
            ("transmission", "phase"),
            ("encoder_interpolation", "phase"),
            ("joint_eccentricity", "phase"),
            ("floor_vibration", "phase"),
            ("bearing_wobble", "phase"),
        },
        Role.COUNT: {
            ("transmission", "harmonic"),
            ("encoder_interpolation", "periods"),
            ("pedestal_compliance", "own_weight"),
        },
        Role.MOMENT: {("step", "at_s"), ("collision", "at_s")},
        Role.FREQUENCY: {("vibration", "hz"), ("floor_vibration", "hz")},
    }
    for effect in KNOWN.values():
        directions = [p.name for p in effect.parameters if p.role is Role.DIRECTION]
        assert directions == list(effect.direction or ()), effect.name
        assert what_is_wrong(effect) == ""
    assert KNOWN["transmission"].phase.name == "phase"
    assert KNOWN["vibration"].frequency.name == "hz"
    assert KNOWN["backlash"].phase is KNOWN["backlash"].frequency is None


SINE = form("turn", Role.PHASE, "rad")
BEAT = form("beat", Role.FREQUENCY, "Hz")
WAYS = tuple(form(name, Role.DIRECTION) for name in "xyz")


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        (effect_of(SINE), "a phase needs exactly one size, its amplitude; found 0"),
        (effect_of(size(), size("more"), SINE), "a phase needs exactly one size, its amplitude; found 2"),
        (
            effect_of(size(), SINE, form("other", Role.PHASE, "rad")),
            "2 parameters with Role.PHASE",
        ),
        (
            effect_of(size(), BEAT, form("other", Role.FREQUENCY, "Hz")),
            "2 parameters with Role.FREQUENCY, allowed: one",
        ),
        (effect_of(size(), form("turn", Role.PHASE, "deg")), "turn: a phase is in rad, found 'deg'"),
        (effect_of(size(), form("beat", Role.FREQUENCY, "rad/s")), "beat: a frequency is in Hz"),
        (effect_of(size(), form("at", Role.MOMENT, "h")), "at: a moment is in s, found 'h'"),
        (
            effect_of(size(), form("at", Role.MOMENT, "s"), form("off", Role.MOMENT, "s")),
            "2 parameters with Role.MOMENT, allowed: one",
        ),
        (effect_of(size(), BEAT, form("at", Role.MOMENT, "s")), "a frequency and a moment"),
        (effect_of(form("much", Role.SIZE)), "much: a size needs a nominal value"),
        (effect_of(size(role=Role.SHAPE)), "much: a shape has no nominal value"),
        (effect_of(size(role="size")), "much: role: found 'size', allowed: Role.SIZE, Role.SHAPE"),
        (effect_of(size(), *WAYS), "x: has Role.DIRECTION, but the effect's direction does not name it"),
        (
            effect_of(*WAYS, direction=("x", "y", "z")),
            "a direction needs exactly one size, its length",
        ),
        (effect_of(size(), SINE, *WAYS, direction=("x", "y", "z")), "cannot be fitted together"),
        (effect_of(form("decay_s", usual=lambda m: m.lag_s)), "only a size has a usual bound, it is a shape"),
        (effect_of(size(usual=lambda m: m.nothing_like_it)), "usual: AttributeError: .*nothing_like_it"),
        (effect_of(size(), is_nuisance=True), "is_nuisance: no size of it has a usual bound"),
        (
            effect_of(size(), where=frozenset({"tip"})),
            "where: found .*, allowed: a frozenset of Where",
        ),
        (
            effect_of(size(), depends_on=Dependence.PLACE),
            "depends_on: found .*, allowed",
        ),
    ],
)
def test_what_contradicts_itself_is_said_in_one_line(effect, said):
    wrong = what_is_wrong(effect)
    assert re.search(said, wrong)
    assert "\n" not in wrong


def test_what_goes_together_is_taken():
    assert what_is_wrong(effect_of(size(usual=lambda m: m.lag_s), SINE, BEAT, is_nuisance=True)) == ""
    assert what_is_wrong(effect_of(size(), *WAYS, direction=("x", "y", "z"))) == ""
    assert what_is_wrong(effect_of()) == ""


# Usual bounds


def test_usual_bounds_are_those_of_the_table():
    m = Mismatch(stiffness=0.1, lag_s=1e-3, play_rad=1e-5, clock_s=3e-3)

    def usual(name, duration_s=20.0, clocks=1):
        return KNOWN[name].usual(m, duration_s, clocks)

    assert usual("stiffness") == {"scale": 0.1}
    assert usual("servo_lag") == {"tau_s": 1e-3}
    assert usual("backlash") == {"gap_deg": 1e-5 * DEG_PER_RAD}
    assert usual("transmission") == {"amplitude_deg": 1e-5 * DEG_PER_RAD}
    assert usual("clock", clocks=2) == {"offset_s": 6e-3, "skew": pytest.approx(3e-4)}
    assert usual("force_delay") == {"delay_s": 3e-3}
    assert usual("tracker_filter", clocks=2) == {"tau_s": 6e-3}
    assert usual("dead_time") == {"delay_s": 1e-3}
    assert usual("servo_gain") == {"missing_share": pytest.approx(1e-3 * 30.0)}
    assert usual("velocity_rule") == {"k_s": m.k_s, "acc_cp_m_s2": m.acc_m_s2}
    for name in ("base_frame", "tool_frame"):
        assert usual(name)["x_mm"] == m.frame_mm
        assert usual(name)["c_deg"] == m.frame_rad * DEG_PER_RAD
    for name in ("friction", "mastering", "base_number", "vibration", "tool_wear"):
        assert usual(name) == {}


@pytest.mark.parametrize(
    ("name", "target", "unmeasured", "links"),
    [
        ("servo_lag", "A1", frozenset(), {"servo"}),
        ("servo_lag", "A1", frozenset({"servo"}), {"servo", "gear"}),
        ("servo_lag", "A1", frozenset({"servo", "gear"}), {"servo", "gear", "mechanics", "part"}),
        ("backlash", "A2", frozenset({"servo"}), {"gear"}),
        # six lags of their own stand for what they share
        ("servo_lag", "all", EVERY, set()),
        ("backlash", "all", EVERY, set()),
        ("backlash", "A2", frozenset({"gear"}), {"gear", "mechanics", "part"}),
        # a measured force does not replace the predicted one that bends the arm
        ("force_scale", "radial", frozenset(), {"force", "mechanics", "part"}),
        ("edge_force", None, EVERY, {"force", "mechanics", "part"}),
        ("stiffness", "A3", frozenset(), {"mechanics", "part"}),
        ("friction", "A1", EVERY, set()),
        ("clock", "tracker", EVERY, set()),
    ],
)
def test_a_nuisance_goes_down_the_chain_to_the_first_measured_joints(name, target, unmeasured, links):
    assert set(KNOWN[name].disturbed(target, unmeasured)) == links


# What effects depend on


def test_every_effect_of_the_library_says_what_it_depends_on():
    for name, effect in KNOWN.items():
        assert effect.where, name
        assert effect.depends_on, name


def words(effect):
    """Return place and inputs in the order of their lists, as the documentation has them."""
    forms = [effect.at(target) for target in effect.targets(CELL)]
    places = {each for form in forms for each in form.where}
    inputs = {each for form in forms for each in form.depends_on}
    where = ", ".join(each.value for each in Where if each in places)
    return f"{where}: {', '.join(each.value for each in Dependence if each in inputs)}"


def test_the_documentation_says_what_each_depends_on():
    text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in row.strip("|").split("|")] for row in text.splitlines() if row[:1] == "|"
    ]
    header = next(i for i, row in enumerate(rows) if row[0] == "effect")
    assert rows[header][4] == "depends on"
    told = {name: row[4] for row in rows[header:] if len(row) == 5 for name in re.findall(r"`(\w+)`", row[0])}
    assert told == {name: words(effect) for name, effect in KNOWN.items()}
