"""Clouds as PLY: readable by others, nothing lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from rahas.stores.ply import write_cloud


def test_others_read_what_was_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(0, 50, (6, 7, 3)).astype(np.float32)
    points[2, 3] = np.nan
    mask = np.isfinite(points[..., 0])
    normals = np.broadcast_to(np.float32([0, 0.6, 0.8]), points.shape)
    colour = rng.integers(0, 255, (6, 7, 3)).astype(np.uint8)
    spread = rng.uniform(0, 1, (6, 7)).astype(np.float32)
    spread[0, 0] = np.nan
    path = tmp_path / "cloud.ply"
    write_cloud(
        path,
        points,
        mask=mask,
        normals=normals,
        colour=colour,
        scalars={"modulation": np.full((6, 7), 3.5), "z_std": spread},
        comment="mm\nend_header ä",
    )
    cloud = trimesh.load(path)
    np.testing.assert_array_equal(np.asarray(cloud.vertices, np.float32), points[mask])
    np.testing.assert_array_equal(np.asarray(cloud.colors)[:, :3], colour[mask])
    vertex = cloud.metadata["_ply_raw"]["vertex"]
    names = ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "scalar_modulation", "scalar_z_std"]
    assert list(vertex["properties"]) == names
    np.testing.assert_array_equal(vertex["data"]["nz"], np.full(41, 0.8, np.float32))
    np.testing.assert_array_equal(vertex["data"]["scalar_z_std"], np.nan_to_num(spread[mask]))


def test_empty_cloud_is_a_file(tmp_path: Path) -> None:
    nothing = np.full((2, 2, 3), np.nan, np.float32)
    path = tmp_path / "empty.ply"
    write_cloud(
        path, nothing, mask=np.zeros((2, 2), bool), normals=nothing, colour=np.zeros((2, 2, 3), np.uint8), scalars={}
    )
    assert b"element vertex 0" in path.read_bytes()
