"""What a processed case says beside its truth."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.phase_shifting import wrap
from rahas.simulate.specs import CaptureSpec
from rahas.stores.arrays import open_store
from rahas.stores.layout import ScanFolder
from rahas.typing import AnyArray, BoolArray, FloatArray
from tests.accuracy.bound import phase_bound, ripple

EDGE_PX = 2
KEPT = 0.997  # VDI/VDE 2634-2: 3 ‰ may be left out


class Score(NamedTuple):
    """One case with one method."""

    over_bound: float  # phase rms over the rms of the Cramér–Rao bound
    phase_rms_rad: float
    ripple_mrad: tuple[float, ...]  # orders 1 … 4
    wrong_orders: float  # share of the measured pixels
    coverage: float  # of lit pixels with an arc of 0.75 period or more, more than 2 px from a depth edge
    depth_rms_mm: float
    depth_median_mm: float
    diagonal_mm: float
    normalised_68: float  # of |dZ|/σ
    depth_error_mm: FloatArray  # (y, x), NaN where not measured or not lit
    form: str = ""  # flatness or sphere, where asked for


def score(scan: ScanFolder, capture: CaptureSpec, truth: dict[str, AnyArray], asks: str) -> Score:
    """Measure a scan that was accepted."""
    phase, cloud = open_store(scan.phase), open_store(scan.cloud)
    unwrapped, z_std = phase["unwrapped_phase"][...], cloud["z_std"][...]
    lit = truth["lit"] & (truth["albedo"] > 0.1)
    eligible = lit & _away_from_edges(truth["world_target"][..., 2], lit)
    error = unwrapped - truth["unwrapped_phase"]
    measured = np.isfinite(error) & eligible
    error = error - 2 * np.pi * np.rint(np.median(error[measured]) / (2 * np.pi))
    right = measured & (np.abs(error) < np.pi)
    bound = _bound(phase, capture, truth, right)
    depth = cloud["xyz"][..., 2] - truth["world_target"][..., 2]
    seen = np.isfinite(depth) & eligible
    own = wrap(error[right])
    return Score(
        over_bound=float(np.sqrt(np.mean(own**2)) / bound),
        phase_rms_rad=float(np.sqrt(np.mean(own**2))),
        ripple_mrad=tuple(1e3 * a for a in ripple(own - own.mean(), truth["unwrapped_phase"][right])),
        wrong_orders=float(1 - right.sum() / measured.sum()),
        coverage=float(seen.sum() / eligible.sum()),
        depth_rms_mm=float(np.sqrt(np.mean(depth[seen] ** 2))),
        depth_median_mm=float(np.median(np.abs(depth[seen]))),
        diagonal_mm=_diagonal(truth["world_target"]),
        normalised_68=float(np.quantile(np.abs(depth[seen]) / z_std[seen], 0.68)),
        depth_error_mm=np.where(lit, depth, np.nan),
        form=_form(
            asks,
            capture.scene.size_mm / 2,
            cloud["xyz"][...],
            truth,
            z_std,
            float(bound),
            phase["phase_std"][...],
            seen,
        ),
    )


def _bound(phase: AnyArray, capture: CaptureSpec, truth: dict[str, AnyArray], where: BoolArray) -> float:
    """Rms of the bound over a few thousand pixels, with the true steps of the scan's frames."""
    rows, columns = np.nonzero(where)
    some = np.random.default_rng(0).choice(len(rows), min(3000, len(rows)), replace=False)
    at = rows[some], columns[some]
    stage = [str(s) for s in truth["interval_stage"]].index("scan")
    scan = slice(int(truth["interval_first"][stage]), int(truth["interval_last"][stage]) + 1)
    std = phase_bound(
        background=phase["background"][...][at].astype(float),
        modulation=phase["modulation"][...][at].astype(float),
        phase=truth["unwrapped_phase"][at].astype(float),
        steps=truth["phase_step"][scan][:, None],
        camera=capture.camera,
    )
    return float(np.sqrt(np.mean(std**2)))


def _away_from_edges(depth: AnyArray, lit: BoolArray) -> BoolArray:
    steps = np.zeros(depth.shape, bool)
    steps[:, 1:] |= np.abs(np.diff(depth, axis=1)) > 1.5
    steps[1:] |= np.abs(np.diff(depth, axis=0)) > 1.5
    near = cv2.dilate((steps | ~lit).astype(np.uint8), np.ones((2 * EDGE_PX + 1,) * 2, np.uint8)) > 0
    return ~near


def _diagonal(points: AnyArray) -> float:
    """Of the field at the surface, mm."""
    return float(np.linalg.norm(points[0, 0] - points[-1, -1]))


def _form(
    asks: str,
    radius: float,
    xyz: AnyArray,
    truth: dict[str, AnyArray],
    z_std: AnyArray,
    bound: float,
    std: AnyArray,
    seen: BoolArray,
) -> str:
    if asks == "flatness":
        points = xyz[seen].astype(float)
        normal, middle = _plane(points)
        off = np.abs((points - middle) @ normal)
        kept = np.sort((points - middle) @ normal)
        cut = round(len(kept) * (1 - KEPT) / 2)
        spread = kept[len(kept) - 1 - cut] - kept[cut]
        noise = 6.0 * bound * float(np.median(z_std[seen] / std[seen]))
        return f"flatness {spread:.3f} mm = {spread / noise:.2f} × 6σ at the bound; mean |off| {off.mean():.4f} mm"
    if asks == "sphere":
        true = truth["world_target"][seen].astype(float)
        points = xyz[seen].astype(float)
        top = _cap(truth["world_target"], seen, radius)
        centre, found = _sphere(points[top])
        true_centre, true_radius = _sphere(true[top])
        off = np.sort(np.linalg.norm(points[top] - centre, axis=1) - found)
        cut = round(len(off) * (1 - KEPT) / 2)
        form = off[len(off) - 1 - cut] - off[cut]
        return (
            f"sphere form {form:.3f} mm (1:{_diagonal(truth['world_target']) / form:.0f}), "
            f"size {2 * (found - true_radius):+.4f} mm, centre off {np.linalg.norm(centre - true_centre):.4f} mm"
        )
    return ""


def _plane(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    middle = points.mean(axis=0)
    return np.linalg.svd((points - middle)[:: max(1, len(points) // 20000)], full_matrices=False)[2][2], middle


def _cap(points: AnyArray, seen: BoolArray, radius: float) -> BoolArray:
    """Which of the ``seen`` points lie well on the sphere's cap: less than 0.6 radii beside its true top."""
    own = points[seen]
    top = own[np.argmax(own[:, 2])]
    return np.asarray(np.hypot(*(own - top)[:, :2].T) < 0.6 * radius)


def _sphere(points: FloatArray) -> tuple[FloatArray, float]:
    """Least-squares sphere: centre and radius, refined on the geometric distance."""
    columns = np.column_stack([2 * points, np.ones(len(points))])
    solution = np.linalg.lstsq(columns, np.sum(points**2, axis=1), rcond=None)[0]
    centre, radius = solution[:3], float(np.sqrt(solution[3] + solution[:3] @ solution[:3]))
    for _ in range(10):
        ray = points - centre
        length = np.linalg.norm(ray, axis=1)
        change = np.linalg.lstsq(
            np.column_stack([ray / length[:, None], np.ones(len(points))]), length - radius, rcond=None
        )[0]
        centre, radius = centre + change[:3], radius + change[3]
    return centre, float(radius)
