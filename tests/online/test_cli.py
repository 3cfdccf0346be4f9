"""``gcode2krl online``."""

import json
import threading

import numpy as np
import pytest

from tests.online.krc import Krc
from tests.online.test_replay import write_run
from tests.online.test_server import Wire, exchange, free_port
from tests.online.test_twin import SLOT

STOCK = (
    'based_on = "demonstration"\n' + "[stock]\nbox_mm = [[0, -20, -30], [40, 20, 0]]\nresolution_mm = 0.2\n"
)


@pytest.fixture
def online(run, tmp_path):
    (tmp_path / "slot.nc").write_text(SLOT)
    (tmp_path / "cell.toml").write_text(STOCK)
    return lambda *arguments: run("online", *arguments)


def simulate(online, *options):
    outcome = online("simulate", "slot.nc", "--cell", "cell.toml", "--json", *options)
    assert outcome.code == 0, outcome.err
    return json.loads(outcome.out)


def test_simulate_gives_the_four_figures_and_its_settings(online):
    found = simulate(online)
    assert found["uncompensated_mm"] > found["cartesian_mm"] > found["pilot_mm"]
    assert found["axis_mm"] >= found["pilot_mm"] - 1e-3
    assert found["reduction_percent"] >= 78.0
    assert found["settings"]["lead_ms"] == 40.0


def test_options_change_the_figures_and_are_echoed(online):
    options = {
        "--lead-ms": ("lead_ms", 10),
        "--threshold-N": ("threshold_N", 400),
        "--blend-ms": ("blend_ms", 160),
        "--filter-ms": ("filter_ms", 30),
        "--robot-delay-ms": ("robot_delay_ms", 60),
        "--feed-scale": ("feed_scale", 0.98),
        "--pilot-scale": ("pilot_scale", 0.8),
    }
    plain = simulate(online)
    for option, (key, value) in options.items():
        found = simulate(online, option, value)
        assert found["settings"][key] == pytest.approx(value)
        figures = ("cartesian_mm", "pilot_mm")
        assert any(abs(found[name] - plain[name]) > 1e-4 for name in figures), option
    assert simulate(online, "--robot-delay-ms", 60)["settings"]["lead_ms"] == pytest.approx(60 + 0.2 * 80)


def test_simulate_says_it_to_a_person_and_draws(online, tmp_path):
    outcome = online("simulate", "slot.nc", "--cell", "cell.toml", "--plot", "figures")
    assert outcome.code == 0, outcome.err
    assert "Cartesian with pilot" in outcome.out
    for name in ("deviation", "signals"):
        assert (tmp_path / "figures" / f"{name}.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", "nothing.nc"),
        ("simulate", "slot.nc", "--feed-scale", "0"),
        ("simulate", "slot.nc", "--filter-ms", "0"),
        ("simulate", "slot.nc", "--lead-ms", "-1"),
        ("simulate", "slot.nc", "--blend-ms", "0"),
        ("simulate", "slot.nc", "--pilot-scale", "nan"),
        ("simulate", "slot.nc", "--plot", "a/b/c"),
        ("replay", "nothing"),
        ("serve", "--port", "0"),
        ("serve", "--address", "203.0.113.1"),
        ("serve", "--pilot", "nothing.csv"),
        ("serve", "--files", "a", "--name", "much too long a name"),
        ("serve", "--address", "the robot"),
        ("serve", "--tool", "99"),
        ("serve", "--files", "a/b/c"),
        ("serve", "--most-mm", "99"),
        ("serve", "--address", "0.0.0.0"),
        ("serve", "--robot-address", "192.168.1.20"),
        ("serve", "--files", "a", "--address", "0.0.0.0", "--robot-address", "192.168.1.20"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(online, arguments):
    outcome = online(*arguments)
    assert outcome.code == 2
    assert "Traceback" not in outcome.err
    assert outcome.err.count("error") == 1


def test_a_part_that_cuts_nothing_is_said(online, tmp_path):
    (tmp_path / "air.toml").write_text(
        STOCK.replace("[[0, -20, -30], [40, 20, 0]]", "[[0, 90, -30], [9, 99, 0]]")
    )
    outcome = online("simulate", "slot.nc", "--cell", "air.toml", "--json")
    assert outcome.code == 0
    found = json.loads(outcome.out)
    assert found["pilot_mm"] is None
    assert "nothing-judged" in [issue["code"] for issue in found["issues"]]


def test_replay(online, tmp_path, cell):
    write_run(tmp_path / "run", cell)
    outcome = online("replay", "run", "--json", "-o", "corrections.csv")
    assert outcome.code == 0, outcome.err
    found = json.loads(outcome.out)
    assert found["after_mm"] < found["before_mm"]
    assert len((tmp_path / "corrections.csv").read_text().splitlines()) == found["cycles"] + 1
    assert online("replay", "run").code == 0


def test_serve_writes_the_controllers_files(online, tmp_path):
    outcome = online("serve", "--files", "sensor", "--name", "PART_1", "--json")
    assert outcome.code == 0, outcome.err
    assert len(json.loads(outcome.out)["files"]) == 2
    assert {file.name for file in (tmp_path / "sensor").iterdir()} == {"PART_1_ETH.xml", "PART_1.rsi.xml"}


def test_every_command_reads_the_section_of_the_cell(online, tmp_path):
    section = (
        '[online]\nlead_s = 0.055\nmost_mm = 1.5\n[online.link]\nport = 50123\naddress = "192.168.7.3"\n'
    )
    (tmp_path / "cell.toml").write_text(STOCK + section)
    assert simulate(online)["settings"]["lead_ms"] == pytest.approx(55.0)
    outcome = online("serve", "--cell", "cell.toml", "--files", "sensor", "--name", "A")
    assert outcome.code == 0, outcome.err
    config = (tmp_path / "sensor" / "A_ETH.xml").read_text()
    assert "<PORT>50123</PORT>" in config
    assert "<IP_NUMBER>192.168.7.3</IP_NUMBER>" in config
    assert 'Name="UpperLimX" ParamID="4" ParamValue="1.5"' in (tmp_path / "sensor" / "A.rsi.xml").read_text()
    outcome = online("serve", "--cell", "cell.toml", "--files", "sensor", "--name", "B", "--port", "50200")
    assert outcome.code == 0
    assert "<PORT>50200</PORT>" in (tmp_path / "sensor" / "B_ETH.xml").read_text()


@pytest.mark.parametrize(("controller", "flow"), [('kss = "8.7"', "A.rsix"), ('rsi = "4"', "A.rsix")])
def test_the_signal_flow_is_that_of_the_cells_controller(online, tmp_path, controller, flow):
    (tmp_path / "cell.toml").write_text(f"{STOCK}[controller]\n{controller}\n")
    outcome = online("serve", "--cell", "cell.toml", "--files", "sensor", "--name", "A")
    assert outcome.code == 0, outcome.err
    assert {file.name for file in (tmp_path / "sensor").iterdir()} == {"A_ETH.xml", flow}


def test_no_files_for_iiqka(online, tmp_path):
    (tmp_path / "cell.toml").write_text(f'{STOCK}[controller]\nkss = "iiqka"\n')
    outcome = online("serve", "--cell", "cell.toml", "--files", "sensor", "--name", "A")
    assert outcome.code == 2
    assert "kss-iiqka" in outcome.err
    assert not (tmp_path / "sensor").exists()


def test_the_sensors_calibration_is_that_of_the_cell(online, tmp_path):
    """The file is named in the section, and found beside the cell file."""
    (tmp_path / "cell.toml").write_text(STOCK + '[online]\ncalibration = "sensor.toml"\n')
    outcome = online("serve", "--cell", "cell.toml", "--port", free_port())
    assert outcome.code == 2
    assert str(tmp_path / "sensor.toml") in outcome.err


def test_serve_answers_until_the_peer_is_silent_and_records_a_run(online, tmp_path, cell):
    port = free_port()
    krc = Krc(cell, stands_s=0.4)
    krc.load = np.zeros(6)
    early = []  # asked before the server listened, or before it was quick enough

    def controller():
        wire = Wire(port, 1.0)
        while (first := wire.ask(krc.telegram())) is None:
            krc.take(None)
            early.append(None)
        krc.take(first)
        wire.socket.settimeout(5.0)
        exchange(wire, krc, 149)

    thread = threading.Thread(target=controller)
    thread.start()
    outcome = online("serve", "--port", port, "-o", "run", "--json")
    thread.join()
    assert outcome.code == 0, outcome.err
    found = json.loads(outcome.out)
    assert (found["phase"], found["reason"]) == ("closed", "silence")
    assert 150 <= found["answered"] <= 150 + len(early)
    assert found["log_dropped"] == found["log_unwritten"] == 0
    from gcode2krl.runs import load_run

    run = load_run(tmp_path / "run")
    assert len(run.controller) == len(run.force) == found["answered"]
    assert ",running,," in (tmp_path / "run" / "events.csv").read_text()
