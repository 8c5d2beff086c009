"""Depth steps, spikes and crumbs leave the surface; normals stand on it."""

from __future__ import annotations

import numpy as np

from rahas.kernels.surface import normals_of_grid, surface_mask


def mask_of(distance: np.ndarray, noise: float = 0.05) -> np.ndarray:
    return surface_mask(
        distance, pixel_angle=0.001, distance_std=np.full(distance.shape, noise), max_slope_deg=80.0, min_piece_px=30
    )


def test_step_loses_its_two_sides_only() -> None:
    distance = np.full((60, 80), 600.0)
    distance[:, 40:] = 620.0
    mask = mask_of(distance)
    assert not mask[:, 39:41].any()
    assert mask[:, :39].all()
    assert mask[:, 41:].all()


def test_spikes_and_crumbs() -> None:
    rng = np.random.default_rng(1)
    distance = 600.0 + rng.normal(0, 0.05, (60, 80))
    distance[20, 30] += 30.0
    distance[40:44, 50:54] += 25.0
    distance[:, 70:] = np.nan
    mask = mask_of(distance)
    assert not mask[20, 30]
    assert not mask[40:44, 50:54].any()
    assert not mask[:, 70:].any()
    assert mask[:, :70].mean() > 0.98


def test_normals_of_a_slope() -> None:
    y, x = np.mgrid[0:40, 0:50].astype(float)
    slope = np.stack([x, -y, 0.3 * x - 0.2 * y], axis=-1)
    slope[10:14, 20:25] = np.nan
    normals = normals_of_grid(slope, np.array([0.0, 0.0, 500.0]))
    truth = np.array([-0.3, -0.2, 1.0]) / np.linalg.norm([-0.3, -0.2, 1.0])
    inner = normals[3:-3, 3:-3]
    seen = np.isfinite(inner[..., 0])
    assert np.isnan(normals[11, 22]).all()
    np.testing.assert_allclose(inner[seen] @ truth, 1.0, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(normals[np.isfinite(normals[..., 0])], axis=-1), 1.0, atol=1e-9)
