"""Meshes as exact solids: closed where they have cracks, bodies that overlap made into one."""

from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cutting.mesh_file import MeshError

if TYPE_CHECKING:
    import manifold3d
    import trimesh

CRACK_MM = 1e-3
"""Points along open edges that lie this close are one: what rounding in an STL file leaves."""


def solid_of(mesh: "trimesh.Trimesh") -> "manifold3d.Manifold":
    """Return a mesh in mm as one solid; raises `MeshError` where it encloses none.

    Cracks of up to `CRACK_MM` are closed, a surface that is inside out is turned, and bodies are united.
    """
    import manifold3d

    points, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
    solid = _closed(points, faces)
    if solid is None:
        solid = _closed(*_without_cracks(points, faces))
    if solid is None:
        raise MeshError("the mesh is not closed")
    if solid.volume() < 0.0:
        solid = _closed(points, faces[:, ::-1]) or solid
    bodies = solid.decompose()
    if len(bodies) > 1 and all(body.volume() > 0.0 for body in bodies):  # else one is the wall of a hollow
        solid = manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)
    return solid


def _closed(points_mm: Floats, faces: Ints) -> "manifold3d.Manifold | None":
    """Return the solid of a mesh, None where its surface has an edge or is empty."""
    import manifold3d

    solid = manifold3d.Manifold(
        manifold3d.Mesh64(
            vert_properties=np.ascontiguousarray(points_mm),
            tri_verts=np.ascontiguousarray(faces, dtype=np.uint64),
        )
    )
    return None if solid.status() != manifold3d.Error.NoError or solid.is_empty() else solid


def _without_cracks(points_mm: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Return points and faces with points that lie within `CRACK_MM` of each other made one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    near = cKDTree(points_mm).query_pairs(CRACK_MM, output_type="ndarray")
    links = coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(points_mm),) * 2)
    _, group = connected_components(links, directed=False)
    _, first = np.unique(group, return_index=True)
    a, b, c = joined = group[faces].T
    return points_mm[first], joined.T[(a != b) & (b != c) & (c != a)]


def mesh_of(solid: "manifold3d.Manifold") -> "trimesh.Trimesh":
    """Return a solid as a mesh."""
    import trimesh

    surface = solid.to_mesh64()
    return trimesh.Trimesh(
        np.array(surface.vert_properties)[:, :3], np.array(surface.tri_verts), process=False
    )
