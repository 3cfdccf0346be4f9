"""The figures of a prediction: those of ``predict --plot``, and a clear error without their stage."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from gcode2krl import Gcode2KrlError
from gcode2krl.figures import figures_of
from gcode2krl.prediction.plots import FIGURES, Plots
from gcode2krl.report.drawing import look
from tests.conftest import ROOT

pytestmark = pytest.mark.slow


def test_every_figure_has_a_method_and_every_method_is_a_figure():
    methods = {name for name in vars(Plots) if not name.startswith("_")}
    assert methods == set(FIGURES)


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_one_of_matplotlib(prediction, name):
    figure = getattr(prediction.plot, name)()
    assert isinstance(figure, Figure)
    assert figure.axes
    assert figure._repr_png_().startswith(b"\x89PNG")  # what Jupyter asks for without pyplot


@pytest.mark.slow
def test_the_command_draws_the_same(prediction, run, tmp_path):
    run(
        "predict", ROOT / "examples" / "test_piece.nc", "-o", "out", "--plot", "--quiet", "--isolated", code=0
    )
    assert {file.stem for file in (tmp_path / "out").glob("*.png")} == set(FIGURES)
    with look():
        prediction.plot.force().savefig(tmp_path / "force.png", dpi=150)
    np.testing.assert_array_equal(imread(tmp_path / "force.png"), imread(tmp_path / "out" / "force.png"))


@pytest.mark.parametrize(
    ("missing", "names"),
    [
        ("forces", ("force", "force_path", "deflection_joints", "part")),
        ("deflection", ("deflection", "deflection_path", "deflection_joints")),
        ("joints", ("joints", "spin", "deflection_joints")),
        ("motion", FIGURES),
    ],
)
def test_without_its_stage_one_line_says_why(prediction, missing, names):
    without = replace(prediction, **{missing: None})
    for name in names:
        with pytest.raises(Gcode2KrlError) as caught:
            getattr(without.plot, name)()
        assert name in str(caught.value)
        assert len(str(caught.value).splitlines()) == 1
    assert set(figures_of(without)) == set(FIGURES) - set(names)
