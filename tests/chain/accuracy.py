"""What a processed scan says beside the truth: phase, depth, timeline, snakes."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.unrotation import canvas_columns
from rahas.simulate.pattern import pattern_phase
from rahas.simulate.specs import RigSpec
from rahas.stores.arrays import open_store
from rahas.stores.atomic import read_json
from rahas.stores.layout import ScanFolder
from rahas.typing import AnyArray, BoolArray, FloatArray

MIN_ALBEDO = 0.1  # the black marks of the target reflect too little to be measured


class PhaseScore(NamedTuple):
    """Unwrapped phase against truth, over the pixels that the lamp lights."""

    coverage: float
    """Share of the lit pixels that are measured."""
    wrong_orders: float
    """Share of the measured ones that are half a stripe or more off."""
    rms_rad: float
    """Of the others."""
    normalised_68: float
    """68th percentile of |error|/σ: 1 where the stated error is the true one."""


class DepthScore(NamedTuple):
    """Z of the cloud against truth, over the pixels that the lamp lights."""

    coverage: float
    median_mm: float
    """Median |error|."""
    rms_mm: float
    normalised_68: float

    def __str__(self) -> str:
        return (
            f"coverage {self.coverage:.3f}, median |dZ| {self.median_mm:.4f} mm, rms {self.rms_mm:.4f} mm, "
            f"|dZ|/σ 68 % {self.normalised_68:.2f}"
        )


def score_phase(scan: ScanFolder, true_phase: AnyArray, lit: BoolArray) -> PhaseScore:
    """``true_phase`` (y, x) in radians, up to whole turns of its zero."""
    store = open_store(scan.phase)
    unwrapped, std = store["unwrapped_phase"][...], store["phase_std"][...]
    measured = np.isfinite(unwrapped) & lit
    error = (unwrapped - true_phase)[measured]
    error -= 2 * np.pi * np.rint(np.median(error) / (2 * np.pi))
    wrong = np.abs(error) > np.pi
    return PhaseScore(
        float(measured.sum() / lit.sum()),
        float(wrong.mean()),
        float(np.sqrt(np.mean(error[~wrong] ** 2))),
        float(np.quantile(np.abs(error) / std[measured], 0.68)),
    )


def score_depth(scan: ScanFolder, true_points: AnyArray, lit: BoolArray) -> DepthScore:
    """``true_points`` (y, x, 3), mm in the target's frame."""
    store = open_store(scan.cloud)
    error = store["xyz"][..., 2] - true_points[..., 2]
    measured = np.isfinite(error) & lit
    left = error[measured]
    return DepthScore(
        float(measured.sum() / lit.sum()),
        float(np.median(np.abs(left))),
        float(np.sqrt(np.mean(left**2))),
        float(np.quantile(np.abs(left) / store["z_std"][...][measured], 0.68)),
    )


def timeline_errors(scan: ScanFolder, truth: dict[str, AnyArray]) -> list[tuple[str, int, int]]:
    """(stage, error of its first frame, of its last) for each interval; the stages must be the true ones."""
    found = read_json(scan.timeline)["intervals"]
    assert [i["stage"] for i in found] == [str(s) for s in truth["interval_stage"]]
    return [
        (i["stage"], i["first"] - int(first), i["last"] - int(last))
        for i, first, last in zip(found, truth["interval_first"], truth["interval_last"], strict=True)
    ]


class SnakeScore(NamedTuple):
    """Snakes of all frames looked at, beside the pattern's true maxima."""

    swapped: int
    """Snake pixels that lie nearer to another stripe than to the one whose identity they bear."""
    p95_px: float
    """95th percentile of the distance to the true maximum, rows of the canvas."""
    least_coverage: float
    """Snake pixels over true maxima of labelled stripes on the lit surface, in the worst frame …"""
    most_coverage: float
    """… and in the best."""
    frames: int


def score_snakes(scan: ScanFolder, rig: RigSpec, truth: dict[str, AnyArray], *, every: int = 5) -> SnakeScore:
    """Snakes of every n-th frame from the first hold to the end of the scan; depth edges are left out."""
    store = open_store(scan.snakes)
    identities, rows, unrotation = store["snake_identity"], store["snake_y"], store["unrotation_deg"][...]
    pitch = float(store.attrs["pitch_px"])
    u, v = truth["u"].astype(np.float64), truth["v"].astype(np.float64)
    plain = _plain(u, v, truth["lit"] & (truth["albedo"] > MIN_ALBEDO), rig, pitch)
    shift: int | None = None
    swapped, off, coverage = 0, [], []
    numbers = np.flatnonzero(np.isfinite(unrotation) & truth["lamp_on"])[::every]
    for n in numbers:
        theta, crank = float(truth["theta"][n]), float(truth["crank"][n])
        image = pattern_phase(rig, u, v, theta=theta, crank=crank) / (2 * np.pi)
        turns = canvas_columns(image.astype(np.float32), unrotation[n])
        seen = canvas_columns(plain.astype(np.float32), unrotation[n]) > 0.999
        snake, x = np.nonzero(identities[int(n)])
        y = rows[int(n)][snake, x]
        whole = np.clip(np.rint(y).astype(int), 2, turns.shape[1] - 3)
        good = seen[x, whole]
        snake, x, y, whole = snake[good], x[good], y[good], whole[good]
        slope = (turns[x, whole + 2] - turns[x, whole - 2]) / 4
        at = turns[x, whole] + slope * (y - whole)
        order = np.rint(at)
        shift = int(np.median(snake - order)) if shift is None else shift
        swapped += int(np.count_nonzero(snake - order != shift))
        off.append(np.abs(at - order) / np.maximum(slope, 0.25 / pitch))
        step = np.floor(turns)
        maxima = (step[:, 1:] == step[:, :-1] + 1) & seen[:, 1:] & seen[:, :-1] & (step[:, 1:] + shift >= 0)
        coverage.append(len(snake) / max(1, int(maxima.sum())))
    return SnakeScore(
        swapped, float(np.percentile(np.concatenate(off), 95)), min(coverage), max(coverage), len(numbers)
    )


def _plain(u: FloatArray, v: FloatArray, lit: BoolArray, rig: RigSpec, pitch_px: float) -> BoolArray:
    """Lit pixels 3 px and more from a shadow's rim or a jump of a third of a stripe."""
    jump = 0.33 * 2 / rig.stripes + 2 / rig.stripes / pitch_px
    steps = np.zeros(lit.shape, bool)
    for part in (u, v):
        steps[:, 1:] |= np.abs(np.diff(part, axis=1)) > jump
        steps[1:] |= np.abs(np.diff(part, axis=0)) > jump
    return ~(cv2.dilate((steps | ~lit).astype(np.uint8), np.ones((7, 7), np.uint8)) > 0)
