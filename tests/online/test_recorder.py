"""Recorded lines: all are written, or counted as lost."""

import io
import threading

import numpy as np
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.online.recorder import Recorder
from gcode2krl.runs import load_run
from tests.online.krc import Krc

LOAD = np.array([1.0, 2.0, 3.0, 4000.0, 5000.0, 6000.0])
HEAD = '[frames]\nforce = "base"\n'


def fill(recorder, cell, cycles=100):
    krc = Krc(cell, stands_s=0.1)
    for _ in range(cycles):
        answer = b'<Sen Type="ImFree"><RKorr X="0.1" Y="0" Z="0" A="0" B="0" C="0"/><IPOC>%d</IPOC></Sen>'
        recorder.telegram(krc.telegram(), answer % krc.ipoc)
        recorder.load(krc.ipoc, LOAD)
        krc.take(None)


def test_the_folder_is_a_run_with_every_telegram(cell, tmp_path):
    with Recorder(tmp_path / "run", HEAD) as recorder:
        fill(recorder, cell)
        recorder.event(1, "running", "", "open", 0, 0)
    run = load_run(tmp_path / "run")
    assert len(run.controller) == len(run.force) == 100
    np.testing.assert_allclose(run.force.force_N[0], LOAD[:3])
    np.testing.assert_allclose(run.force.moment_Nmm[0], LOAD[3:])
    np.testing.assert_allclose(run.controller.correction_mm[:, 0], 0.1)
    assert (recorder.dropped, recorder.unwritten, recorder.written) == (0, 0, 201)
    assert (tmp_path / "run" / "events.csv").read_text().splitlines()[1] == "1,running,,open,0,0"


class Full(io.RawIOBase):
    """A disk that is full."""

    def write(self, data):
        raise OSError(28, "No space left on device")

    def close(self):
        raise OSError(28, "No space left on device")


class AlmostFull(io.RawIOBase):
    """A disk that takes half of each line."""

    def write(self, data):
        return len(data) // 2


@pytest.mark.parametrize("disk", [Full, AlmostFull])
def test_a_full_disk_is_counted_and_stops_nothing(cell, tmp_path, disk):
    recorder = Recorder(tmp_path / "run", HEAD)
    recorder._files["rsi.log"] = disk()
    fill(recorder, cell)
    recorder.close()
    assert recorder.unwritten >= 100
    assert recorder.written == 100  # the forces


def test_what_does_not_fit_into_the_queue_is_counted(cell, tmp_path):
    recorder = Recorder(tmp_path / "run", HEAD, most_waiting=10)
    gate = threading.Event()

    class Slow(io.RawIOBase):
        def write(self, data):
            gate.wait()
            return len(data)

    recorder._files["rsi.log"] = Slow()
    recorder._files["force.csv"] = Slow()
    fill(recorder, cell, 50)
    assert recorder.dropped >= 100 - 12
    gate.set()
    recorder.close()
    assert recorder.written + recorder.dropped == 100


def test_a_folder_that_cannot_be_written_is_an_error_of_one_line(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(NotUnderstoodError, match="cannot write"):
        Recorder(tmp_path / "file", HEAD)


def test_without_a_folder_nothing_is_written(cell):
    with Recorder(None) as recorder:
        fill(recorder, cell, 3)
    assert recorder.written == recorder.dropped == 0
