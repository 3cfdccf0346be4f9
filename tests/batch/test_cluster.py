"""A cluster: what is sent is enough, what comes back is the same, and a killed worker loses nothing."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import trimesh

from gcode2krl.batch.cluster import Cluster, make_shipped, pack
from gcode2krl.batch.work import Task, make
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.translation import Order
from tests.cli.test_batch import GOOD, NOT_UNDERSTOOD, many, parts, programs, records  # noqa: F401 (a fixture)
from tests.conftest import ROOT

CLUSTER = """
import os, sys
from distributed import Client, LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            print(cluster.scheduler_address, *client.run(os.getpid).values(), flush=True)
            sys.stdin.read()
"""


@pytest.fixture
def shop(tmp_path):
    """A part, and a cell with a base in a folder above it, a mesh, and a job."""
    for name in ("shop/parts", "shop/cells", "shop/meshes"):
        (tmp_path / name).mkdir(parents=True)
    part = tmp_path / "shop" / "parts" / "Größe 1.nc"
    part.write_text(GOOD.format(x=60), encoding="ascii")
    trimesh.creation.box(bounds=[[-50, -50, -30], [300, 100, 0]]).export(tmp_path / "shop/meshes/stock.stl")
    (tmp_path / "shop" / "base.toml").write_text(
        'based_on = "demonstration"\n[stock]\nmesh = "meshes/stock.stl"\n', encoding="utf-8"
    )
    cell = tmp_path / "shop" / "cells" / "cell.toml"
    cell.write_text('based_on = "../base.toml"\nname = "Halle 3"\n', encoding="utf-8")
    job = tmp_path / "shop" / "job.toml"
    job.write_text('name = "job"\n', encoding="utf-8")
    return Task(Order(part, cell_path=cell, job_path=job), "page.html")


def test_a_shipment_names_nothing_outside_itself(shop):
    shipment = pack(shop)
    assert set(shipment.contents) == {
        "parts/Größe 1.nc",
        "cells/cell.toml",
        "base.toml",
        "meshes/stock.stl",
        "job.toml",
    }
    assert shipment.task.order.part == "parts/Größe 1.nc"
    assert shipment.task.order.cell_path == "cells/cell.toml"


def test_what_is_made_of_a_shipment_is_the_same(shop):
    here, there = make(shop), make_shipped(pack(shop))
    assert here.record["exit_code"] == 0
    assert there.files == here.files
    assert there.record == here.record


def test_findings_name_the_files_of_the_batch(shop):
    Path(shop.order.part).write_text(NOT_UNDERSTOOD)
    mesh = Path(shop.order.cell_path).parent.parent / "meshes" / "stock.stl"
    for damage in (lambda: None, lambda: mesh.write_bytes(b"no mesh")):
        damage()
        here, there = make(shop), make_shipped(pack(shop))
        assert here.record["exit_code"] == 2
        assert there.record == here.record


def test_a_part_without_a_cell(shop):
    alone = replace(shop, order=Order(shop.order.part))
    assert set(pack(alone).contents) == {"Größe 1.nc"}
    assert make_shipped(pack(alone)).files == make(alone).files


def test_no_scheduler_is_an_error(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("gcode2krl.batch.cluster._CONNECT_S", 1)
    with pytest.raises(NotUnderstoodError, match="no scheduler answers"), Cluster("tcp://127.0.0.1:1"):
        pass


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(NotUnderstoodError, match=r"dask\[distributed\]"), Cluster("tcp://127.0.0.1:1"):
        pass


@pytest.fixture
def cluster(tmp_path):
    """A Dask cluster of two worker processes: its address, and their numbers."""
    pytest.importorskip("distributed")
    (tmp_path / "local_cluster.py").write_text(CLUSTER, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, tmp_path / "local_cluster.py"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        text=True,
    )
    address, *workers = process.stdout.readline().split()
    yield address, [int(worker) for worker in workers]
    process.stdin.close()
    process.wait(60)


@pytest.mark.slow
def test_a_cluster_makes_the_same_bytes_and_a_killed_worker_loses_nothing(parts, run, cluster, tmp_path):  # noqa: F811
    many(parts, 12)
    (parts / "no.nc").write_text(NOT_UNDERSTOOD)
    address, workers = cluster
    assert run("batch", parts, "-o", "here", "--no-cache").code == 1
    assert run("batch", parts, "-o", "there", "--no-cache", "--scheduler", address).code == 1
    assert programs("there") == programs("here")
    for part, record in records("there").items():
        assert record | {"seconds": 0} == records("here")[part] | {"seconds": 0}
    command = [sys.executable, "-m", "gcode2krl", "batch", str(parts), "-o", "again", "--no-cache"]
    disturbed = subprocess.Popen(
        [*command, "--scheduler", address],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    disturbed.stderr.readline()  # the first part is finished
    os.kill(workers[0], getattr(signal, "SIGKILL", signal.SIGTERM))
    disturbed.communicate(timeout=300)
    assert disturbed.returncode == 1
    assert programs(tmp_path / "again") == programs("here")
