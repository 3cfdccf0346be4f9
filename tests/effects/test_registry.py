"""The library, effects by text and by cell file, and files of one's own."""

import contextlib
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode2krl import load_cell
from gcode2krl.cell.sections import EffectEntry
from gcode2krl.effects import Applied, Effect, Parameter, from_cell, library, parse, resolve, simulate
from gcode2krl.effects.effect import LINKS
from gcode2krl.errors import NotUnderstoodError
from tests.conftest import ROOT
from tests.effects import KNOWN

CELL = load_cell()
DOCS = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
OWN = next(block for block in re.findall(r"```python\n(.*?)```", DOCS, re.DOTALL) if "EFFECT =" in block)


def told(text):
    """Return the parameters of each effect in the rows of a table."""
    rows = [row.split("|")[1:4] for row in text.splitlines() if re.match(r"\| `[a-z]", row)]
    words = [(re.findall(r"\w+", names), re.findall(r"`([^`]*)`", given)) for names, _, given in rows]
    return {name: set(" ".join(given).split()) for names, given in words for name in names}


TABLE = re.search(r"\| effect \| targets .*?\n\n", DOCS, re.DOTALL)[0]
CAUSES, SLIPS = map(told, TABLE.split("| **set-up slips** |"))
TOLD = CAUSES | SLIPS | {"base_number": CAUSES["base_frame"]}


def test_the_documentation_has_every_effect():
    assert {name for name, effect in KNOWN.items() if effect.kind == "cause"} == set(CAUSES)
    assert {name for name, effect in KNOWN.items() if effect.kind == "slip"} == set(SLIPS)


@pytest.mark.parametrize("name", KNOWN)
def test_the_documentation_has_every_parameter(name):
    """By itself, or by the name under which several are given at once."""
    effect = KNOWN[name]
    given = {each for word in TOLD[name] for each in effect.vectors.get(word, (word,))}
    assert set(effect.names) <= given
    at_targets = [effect.at(target) for target in effect.targets(CELL)]
    assert TOLD[name] <= {word for one in at_targets for word in (*one.names, *one.vectors)}


def test_every_effect_says_what_a_diagnosis_needs(cell):
    for name, effect in KNOWN.items():
        assert effect.family, name
        assert effect.links <= set(LINKS), name
        assert effect.links, name
        assert type(effect).__doc__, name
        for p in effect.parameters:
            assert p.source, f"{name} {p.name}"
            assert p.low < p.high, f"{name} {p.name}"
            assert p.minimum <= p.low, f"{name} {p.name}"
            assert all(p.low <= value <= p.high for value in p.grid), f"{name} {p.name}"
        for target in effect.targets(cell):
            assert effect.links_at(target) <= effect.links, name


@pytest.mark.parametrize(
    ("text", "target", "values"),
    [
        ("backlash:target=A2,gap_deg=0.02", "A2", {"gap_deg": 0.02}),
        (" friction : target = A1 , spike_deg = 0.01 ", "A1", {"spike_deg": 0.01, "decay_s": 0.15}),
        ("base_frame:x_mm=1e-1", None, {"x_mm": 0.1, "y_mm": 0.0, "a_deg": 0.0}),
        ("thermal:mm_per_h=0.1,direction=0/1/0", None, {"direction_y": 1.0, "direction_z": 0.0}),
        ("stiffness:scale=0.8,target=linked_arm", "linked_arm", {"scale": 0.8}),
    ],
)
def test_texts(cell, text, target, values):
    applied = parse(text, KNOWN, cell)
    assert applied.target == target
    assert values.items() <= applied.values.items()
    assert set(applied.values) == set(applied.effect.names)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("backlsh:target=A2,gap_deg=0.02", "did you mean backlash"),
        ("", "found effect ''"),
        ("backlash:target=A7,gap_deg=0.02", "allowed for backlash: A1, A2, A3, A4, A5, A6"),
        ("backlash:gap_deg=0.02", "found no target"),
        ("backlash:target=A2", "no parameter of backlash is given, it has gap_deg"),
        ("backlash:target=A2,gap=0.02", "did you mean gap_deg"),
        ("backlash:target=A2,gap_deg=much", "found 'much', allowed: a number"),
        ("backlash:target=A2,gap_deg=-0.1", "allowed: 0 or more"),
        ("backlash:target=A2,gap_deg=nan", "a finite number|0 or more"),
        ("backlash:target=A2,gap_deg", "allowed: key=value"),
        ("backlash:target=A2,gap_deg=1,gap_deg=2", "stands twice"),
        ("gravity:target=A2,payload_kg=3", "has no target"),
        ("thermal:mm_per_h=1,direction=1/0", "found 2 numbers, allowed: 3"),
        ("servo_lag:target=A1,tau_s=-0.01", "plausible: 0 to 0.1 s"),
        ("clock:target=scanner,offset_s=1", "tracker, force, controller, q_load, q_cmd"),
    ],
)
def test_errors_say_what_is_allowed(cell, text, said):
    with pytest.raises(NotUnderstoodError, match=said) as caught:
        parse(text, KNOWN, cell)
    assert caught.value.exit_code == 2
    assert text.strip() in str(caught.value)


@given(st.text(max_size=40))
def test_any_text_is_understood_or_refused(text):
    for start in ("", "backlash:", "thermal:mm_per_h=", "gravity:payload_kg=1,"):
        with contextlib.suppress(NotUnderstoodError):
            assert isinstance(parse(start + text, KNOWN, CELL), Applied)


def test_text_of_an_effect_is_read_back(cell):
    for text in (
        "hose_pack:h0_N=1/2/3",
        "velocity_rule:k_s=0.2",
        "tool_number:target=3",
        "tool_wear:growth_per_m=0.1",
    ):
        applied = parse(text, KNOWN, cell)
        again = parse(str(applied), KNOWN, cell)
        assert (again.effect, again.target) == (applied.effect, applied.target)
        assert str(again) == str(applied)


def test_the_cell_file_states_effects(cell):
    entries = (
        EffectEntry(name="backlash", target="A2", parameters={"gap_deg": 0.02}, source="diagnosed"),
        EffectEntry(name="thermal", parameters={"mm_per_h": 0.2, "direction": (0.0, 0.0, 1.0)}),
    )
    found = from_cell(cell.model_copy(update={"effects": entries}), KNOWN)
    assert [one.label for one in found] == ["backlash A2", "thermal"]
    assert found[1]["direction_z"] == 1.0
    wrong = (*entries, EffectEntry(name="backlash", target="A2", parameters={"gap": 1.0}))
    with pytest.raises(NotUnderstoodError, match=r"\[\[effects\]\] 3.*gap_deg"):
        from_cell(cell.model_copy(update={"effects": wrong}), KNOWN)
    assert resolve([found[0], "backlash:target=A1,gap_deg=0.1"], KNOWN, cell)[1].label == "backlash A1"


def test_an_effect_of_ones_own_takes_part(tmp_path, swinging, cell):
    (tmp_path / "sag.py").write_text(OWN, encoding="utf-8")
    (tmp_path / "_helper.py").write_text("raise RuntimeError", encoding="utf-8")
    known = library([tmp_path])
    assert {"sag", "backlash"} <= set(known)
    signals = simulate(swinging, [parse("sag:um_per_N=0.5", known, cell)])
    moved = signals.tcp_base_mm - simulate(swinging).tcp_base_mm
    np.testing.assert_allclose(moved[:, 2], 0.0005 * swinging.force_base_N[:, 2], atol=1e-12)
    assert not moved[:, :2].any()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = (", "own.py:1: error: SyntaxError"),
        ("\n\nimport nothing_like_this", "own.py:3: error: ModuleNotFoundError"),
        ("x = 1", "EFFECT: found nothing"),
        ("EFFECT = 3", "EFFECT: found int"),
        (OWN.replace('"sag"', '"backlash"'), "the name 'backlash' is taken"),
        (OWN.replace('"mechanics"', '"mechanic"'), "links: found mechanic, allowed: timing"),
        (OWN.replace("start=0.5", "start=9.0"), "start 9 is not within 0 to 5"),
        (
            OWN.replace("Role.SIZE", "Role.PHASE"),
            "own.py: error: effect 'sag': um_per_N: a phase has no nominal",
        ),
        (
            OWN.replace("Dependence.FORCE", "'force'"),
            "depends_on: found .*, allowed: a frozenset of Dependence",
        ),
    ],
)
def test_errors_of_ones_own_file(tmp_path, text, said):
    (tmp_path / "own.py").write_text(text, encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match=said):
        library([tmp_path])


def test_a_folder_that_is_none(tmp_path):
    with pytest.raises(NotUnderstoodError, match="is not a folder"):
        library([tmp_path / "missing"])


def test_a_shape_has_no_nominal_value():
    shape = Parameter("decay_s", "s", 0.0, 1.0, nominal=None, start=0.1, source="x")
    assert shape.is_shape
    assert not Effect().parameters
