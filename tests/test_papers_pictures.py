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


def test_the_page_shows_each_picture():
    page = (ROOT / "docs" / "papers.md").read_text(encoding="utf-8")
    for name in ("haehn_4", "haehn_9", "haehn_13", "bigliardi_4", "bigliardi_5"):
        assert f"(images/{name}.png)" in page
        assert f"papers_pictures.py {name}" in page or name == "haehn_13"
