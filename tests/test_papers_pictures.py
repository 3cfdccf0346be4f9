"""The pictures of the papers are drawn, and the page names each."""

import subprocess
import sys

import pytest

from tests.conftest import ROOT


@pytest.mark.slow
@pytest.mark.parametrize("name", ["haehn_4", "haehn_9"])
def test_a_picture_is_drawn(name, tmp_path):
    command = [sys.executable, "docs/papers_pictures.py", name, "-o", str(tmp_path)]
    subprocess.run(command, check=True, cwd=ROOT)
    assert (tmp_path / f"{name}.png").stat().st_size > 10_000
