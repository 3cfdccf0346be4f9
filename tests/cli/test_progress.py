"""Progress: a bar a stage on a terminal, nothing elsewhere, and a callback that costs next to nothing."""

import io
import os
import re
import subprocess
import time
from itertools import pairwise

import pytest
from rich.console import Console as Terminal

from gcode2krl.cli.console import Console
from gcode2krl.cli.terminal_bars import bars
from gcode2krl.progress import LEAST_S, Paced, unheard, unseen
from tests.cli import on_a_terminal
from tests.conftest import ROOT

PART = ROOT / "examples" / "test_piece.nc"
STAGES = ("reading", "planning", "motion", "joints", "material, forces, deflection")


def test_paced_passes_on_few_calls_and_the_last():
    shown, now = [], [0.0]
    progress = Paced(lambda done, total: shown.append((done, total)), clock=lambda: now[0])
    for done in range(1, 1001):
        now[0] = done / 1000.0  # a second of a thousand calls
        progress(done, 1000)
    assert shown[0] == (1, 1000)
    assert shown[-1] == (1000, 1000)
    assert 1.0 / LEAST_S <= len(shown) <= 1.0 / LEAST_S + 2
    times_s = [done / 1000.0 for done, _ in shown[:-1]]
    assert min(b - a for a, b in pairwise(times_s)) >= LEAST_S - 1e-9


def test_a_stage_of_unknown_length_is_paced_too():
    shown = []
    progress = Paced(lambda *told: shown.append(told), clock=lambda: 0.0)
    for done in range(100):
        progress(done, 0)
    assert len(shown) == 1


def test_a_call_costs_less_than_two_microseconds():
    progress = Paced(unheard)
    costs_s = []
    for _ in range(5):
        begun_s = time.process_time()
        for done in range(20_000):
            progress(done, 1_000_000)
        costs_s.append((time.process_time() - begun_s) / 20_000)
    assert min(costs_s) < 2e-6


def test_bars_show_share_and_remaining_time():
    text = io.StringIO()
    terminal = Terminal(file=text, force_terminal=True, width=100, legacy_windows=False, _environ={})
    with bars(terminal) as begin:
        progress = begin("first")
        for tenth in range(6):
            progress(tenth, 10)
            time.sleep(0.15)
        begin("second")
        time.sleep(0.3)
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text.getvalue())
    assert re.search(r"first +\S+ +50% 0:00:00 0:00:0[01] left", plain)
    assert re.search(r"first +\S+ +100%", plain)  # over, as the second has begun
    assert re.search(r"second +\S+ +0:00:00 *(\r|\n|$)", plain)  # says nothing of how far it is


@pytest.mark.parametrize("quiet", [True, False])
def test_nothing_is_shown_in_a_pipe_or_where_it_shall_be_quiet(quiet, capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: quiet, raising=False)
    with Console(quiet).stages() as begin:
        assert begin is unseen
        begin("stage")(1, 2)
    assert capsys.readouterr() == ("", "")


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo terminals here")
@pytest.mark.parametrize(
    ("words", "seen"),
    [
        ((str(PART), "-o", "part.src", "--json"), (*STAGES, "writing and reading back")),
        ((str(PART), "-o", "part.src", "-q"), ()),
    ],
)
def test_each_stage_has_its_bar_on_a_terminal(words, seen, tmp_path):
    code, text, out = on_a_terminal(tmp_path, *words, stdout=subprocess.PIPE)
    result = out.decode("utf-8")
    assert code == 0
    missing = [name for name in seen if name not in text]
    assert not missing
    assert seen or not re.search("|".join(STAGES), text)
    assert not any(f"{name} " in result and "left" in result for name in STAGES)
