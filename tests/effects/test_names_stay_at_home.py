"""Names of effects and parameters stay in their own files: a diagnosis asks what an effect states."""

import ast
from pathlib import Path

from tests.conftest import ROOT
from tests.effects import KNOWN

PACKAGE = ROOT / "gcode2krl"
NAMES = {
    *KNOWN,
    *(name for effect in KNOWN.values() for name in (*effect.names, *effect.vectors)),
}
FILES = [
    *(
        file
        for room in ("compare", "noise", "posterior")
        for file in sorted((PACKAGE / "gap" / room).rglob("*.py"))
        if file.name not in ("slips.py", "set_up.py")  # a slip is an effect with a name
    ),
    PACKAGE / "gap" / "components.py",
    PACKAGE / "gap" / "diagnosis.py",
    *sorted((PACKAGE / "effects").glob("*.py")),
]
ALLOWED = {
    # words that mean something else there
    "gap/compare/links.py": {"mm", "diameter_mm"},  # a unit, and a key of a tool
    "gap/posterior/geometry.py": {"mm"},
    "gap/posterior/likelihood.py": {"scale"},  # the field of `Free`
    "effects/coefficients.py": {"diameter_mm"},  # of a cell's tool
    # names that several effects share, and words of roles
    "effects/parameter.py": {"direction_x", "direction_y", "direction_z", "direction", "phase", "count"},
    "effects/frame_effect.py": {"x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "mm"},
}


def literals(text):
    """Return the string literals of a source that are no docstrings."""
    tree = ast.parse(text)
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said
    }


def of(file: Path) -> str:
    return file.relative_to(PACKAGE).as_posix()


def test_no_effect_and_no_parameter_is_known_by_name():
    assert {"backlash", "gap_deg", "phase", "direction"} <= NAMES
    for file in FILES:
        found = literals(file.read_text(encoding="utf-8")) & NAMES
        assert found <= ALLOWED.get(of(file), set()), file
