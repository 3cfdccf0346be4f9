"""Scans of the finished part: CSV and PLY, by other writers and broken."""

import numpy as np
import pytest
import trimesh

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs import load_run
from tests.runs import maker


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "run-1"


def points(count=50):
    return np.random.default_rng(6).uniform(-50.0, 120.0, (count, 3))


def test_scan_as_csv(folder):
    cloud = points()
    table = {f"{axis}_mm": cloud[:, i].copy() for i, axis in enumerate("xyz")}
    table["y_mm"][7] = np.nan
    maker.write(maker.run_folder(folder), "scan.csv", table)
    scan = load_run(folder).scan
    assert np.array_equal(scan.position_mm, np.delete(cloud, 7, axis=0))
    assert scan.dropped_rows == 1
    del table["y_mm"]
    maker.write(folder, "scan.csv", table)
    with pytest.raises(NotUnderstoodError, match="column y_mm: missing"):
        load_run(folder)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_scan_as_ply_by_another_writer(folder, encoding):
    cloud = points().astype(np.float32)
    data = trimesh.PointCloud(cloud, colors=np.full((len(cloud), 4), 200, dtype=np.uint8)).export(
        file_type="ply", encoding="ascii" if encoding == "ascii" else "binary"
    )
    maker.run_folder(folder)
    (folder / "scan.ply").write_bytes(data if isinstance(data, bytes) else data.encode("ascii"))
    assert np.allclose(load_run(folder).scan.position_mm, cloud, atol=1e-4)


def test_scan_as_ply_of_a_mesh_and_big_endian(folder):
    box = trimesh.creation.icosphere(subdivisions=2, radius=30.0)
    maker.run_folder(folder)
    (folder / "scan.ply").write_bytes(box.export(file_type="ply"))
    assert np.allclose(load_run(folder).scan.position_mm, box.vertices, atol=1e-4)
    cloud = points()
    header = "ply\r\nformat binary_big_endian 1.0\r\ncomment by hand\r\nelement vertex 50\r\n"
    header += "property double x\r\nproperty double y\r\nproperty double z\r\nend_header\r\n"
    (folder / "scan.ply").write_bytes(header.encode() + cloud.astype(">f8").tobytes())
    assert np.array_equal(load_run(folder).scan.position_mm, cloud)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "no PLY header"),
        (b"ply\nformat ascii 1.0\nend_header\n", "no vertices with x, y, z"),
        (
            b"ply\nformat ascii 1.0\nelement face 2\nproperty list uchar int i\n"
            b"element vertex 20\nend_header\n",
            "face stands before the vertices",
        ),
        (b"ply\nformat ascii 1.0\nelement vertex 20\nproperty list uchar float x\nend_header\n", "property"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 20\nproperty float x\nproperty float y\n"
            b"property float z\nend_header\n1 2 3\n",
            "20 vertices announced, 1 there",
        ),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
            b"end_header\n1 2 up\n",
            "'1 2 up' is not a vertex",
        ),
        (
            b"ply\nformat binary_little_endian 1.0\nelement vertex 90000000000\nproperty float x\n"
            b"property float y\nproperty float z\nend_header\n1234",
            "90000000000 vertices announced, 0 there",
        ),
    ],
)
def test_a_broken_ply(folder, text, words):
    maker.run_folder(folder)
    (folder / "scan.ply").write_bytes(text)
    with pytest.raises(NotUnderstoodError, match=r"scan\.ply") as caught:
        load_run(folder)
    assert words in str(caught.value)
