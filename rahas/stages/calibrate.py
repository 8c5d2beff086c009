"""Camera, projector and texture camera from a scan of the roof target (thesis 2.3)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.camera import CameraFit
from rahas.kernels.projector import phase_at_mark
from rahas.kernels.projector_lens import phase_without_lens
from rahas.kernels.rig_uncertainty import rig_covariance
from rahas.kernels.roof import Roof, fit_roof, points_on_roof
from rahas.kernels.triangulation import pixel_grid, rays_of_camera, triangulate
from rahas.params import CalibrationParams
from rahas.stages.first_hold import FirstHold
from rahas.stages.projection import Projection, TargetImages, fit_projection
from rahas.stages.rig import ImagingCamera, Rig, rig_as_json
from rahas.stages.sighting import Sighting, Target, TooFewMarks, sight_target
from rahas.typing import AnyArray, FloatArray


class Calibration(NamedTuple):
    """A calibrated rig and how well it fits."""

    rig: Rig
    residuals: dict[str, float]
    marks: list[dict[str, Any]]
    warnings: list[str]

    def as_json(self) -> dict[str, Any]:
        """The whole of calibration.json but the scan's id."""
        return {**rig_as_json(self.rig), "residuals": self.residuals, "marks": self.marks, "warnings": self.warnings}


def calibrate(
    *,
    background: AnyArray,
    unwrapped_phase: AnyArray,
    target: Target,
    photo: AnyArray | None,
    params: CalibrationParams,
    modulation: AnyArray | None = None,
    hold: FirstHold | None = None,
) -> Calibration:
    """Calibrate the rig.

    ``background`` (y, x) the stripe-free image of the camera, ``unwrapped_phase`` (y, x) rad with NaN where not
    measured, ``photo`` (y, x) grey from the texture camera or ``None``. With ``modulation`` (y, x) and the first
    ``hold`` the projector at the slide's first stop is fitted too, by which scans are compared with their calibration.

    Raises
    ------
    CaptureProblem
        (rule ``calibration``) Too few marks, too little phase on the target, or residuals above the limits.
    """
    roof = _roof_of(target, params)
    sighting = _sighting_of(background, target, roof, params)
    if sighting.rms_px > params.max_camera_rms_px:
        raise _too_large(
            "camera_rms_px",
            sighting.rms_px,
            params.max_camera_rms_px,
            "px",
            f"The target's marks lie {sighting.rms_px:.2f} px (rms) from where the camera model puts them. Measure the "
            "marks of config/target.csv again, or scan the target again without touching it or the rig.",
        )
    mark_phase = _phases_at_marks(unwrapped_phase, sighting, roof)
    images = TargetImages(unwrapped_phase, background, modulation, hold)
    fitted = fit_projection(images, sighting, target, roof, mark_phase, params)
    sighting, dense = fitted.sighting, fitted.dense
    residual_rad = dense.fit.residual[dense.fit.used]
    residual_mm = _residual_in_mm(fitted)
    rms_mm = float(np.sqrt(np.mean(residual_mm**2)))
    if rms_mm > params.max_projector_rms_mm:
        raise _too_large(
            "projector_rms_mm",
            rms_mm,
            params.max_projector_rms_mm,
            "mm",
            f"The surface measured on the target lies {rms_mm:.2f} mm (rms) off its two planes. Scan the target again: "
            "hold the rig still, turn the crank slowly and evenly, and keep the target flat.",
        )
    warnings: list[str] = []
    texture_fit, texture_residual = _texture_camera_of(
        photo, target, roof, params, warnings, video_width_px=background.shape[1]
    )
    residuals = {
        "marks_found": float(len(sighting.row)),
        "camera_rms_px": sighting.rms_px,
        "camera_max_px": float(np.sqrt(np.max(np.sum(sighting.fit.residual**2, axis=1)))),
        "projector_rms_rad": float(np.sqrt(np.mean(residual_rad**2))),
        "projector_rms_mm": rms_mm,
        "projector_points": float(len(residual_rad)),
        "projector_inlier_share": dense.inlier_share,
        "mark_radius_mm": sighting.radius_mm,
        "target_flatness_mm": roof.rms_mm,
        **({} if fitted.first_stop is None else {"first_stop_residual": fitted.first_stop.residual_std}),
        **texture_residual,
    }
    covariance = rig_covariance(
        sighting.fit,
        roof,
        dense.pixels[dense.fit.used],
        dense.fit.matrix,
        dense.fit.covariance,
        reach_mm=target.world,
        lens=fitted.lens,
        lens_covariance=fitted.lens_covariance,
        first_stop=fitted.first_stop,
    )
    height, width = unwrapped_phase.shape
    rig = Rig(
        ImagingCamera(sighting.fit.camera, width, height),
        dense.fit.matrix,
        None if texture_fit is None or photo is None else ImagingCamera(texture_fit.camera, *photo.shape[1::-1]),
        covariance,
        fitted.lens,
        None if fitted.first_stop is None else fitted.first_stop.matrix,
        None if texture_fit is None else texture_fit.covariance,
    )
    return Calibration(rig, residuals, _marks_as_json(target, sighting, mark_phase), warnings)


def _roof_of(target: Target, params: CalibrationParams) -> Roof:
    roof = fit_roof(target.world)
    if roof.rms_mm > params.max_target_flatness_mm:
        raise _too_large(
            "target_flatness_mm",
            roof.rms_mm,
            params.max_target_flatness_mm,
            "mm",
            f"The marks of config/target.csv lie {roof.rms_mm:.2f} mm (rms) off two planes: check its coordinates "
            "(x right, y up, z towards the camera, in mm from mark 1).",
        )
    return roof


def _sighting_of(image: AnyArray, target: Target, roof: Roof, params: CalibrationParams) -> Sighting:
    try:
        return sight_target(
            image, target, roof, min_marks=params.min_marks, radial_significance=params.radial_significance
        )
    except TooFewMarks as few:
        raise CaptureProblem(
            "calibration",
            "marks_found",
            f"Only {few.found} of the target's {len(target.mark)} marks were recognised ({few.dark_spots} dark round "
            "spots in the image). Scan the target again: upright, all marks in view and in the lamp's light, none "
            "covered; and check config/target.csv.",
            value=few.found,
            limit=params.min_marks,
            unit="marks",
        ) from None


def _phases_at_marks(unwrapped_phase: AnyArray, sighting: Sighting, roof: Roof) -> FloatArray:
    """Phase (k,) at the marks' centres, each from its surroundings on its own slope; NaN where too little is seen."""
    height, width = unwrapped_phase.shape
    step = 4
    grid = pixel_grid(height, width, step=step)
    points, _ = points_on_roof(sighting.fit.camera, roof, grid.reshape(-1, 2))
    distance = np.abs(points @ roof.normal.T - roof.offset)
    on_right = np.repeat(np.repeat((distance[:, 1] < distance[:, 0]).reshape(grid.shape[:2]), step, 0), step, 1)
    on_right = on_right[:height, :width]
    return np.array(
        [
            phase_at_mark(unwrapped_phase, centre, axes, usable=on_right if roof.slope[row] else ~on_right)
            for row, centre, axes in zip(sighting.row, sighting.ellipse_centre, sighting.semi_axes, strict=True)
        ]
    )


def _residual_in_mm(fitted: Projection) -> FloatArray:
    """Phase residuals of the used points as distances along their rays, mm."""
    dense, used = fitted.dense, fitted.dense.fit.used
    origin, direction = rays_of_camera(fitted.sighting.fit.camera, dense.pixels[used])
    plain = phase_without_lens(origin, direction, fitted.phase[used], dense.fit.matrix, fitted.lens)
    measured = triangulate(origin, direction, plain, dense.fit.matrix)
    per_radian = np.linalg.norm(measured.per_radian, axis=-1)
    residual: FloatArray = dense.fit.residual[used] * per_radian
    return residual[np.isfinite(residual)]


def _texture_camera_of(
    photo: AnyArray | None,
    target: Target,
    roof: Roof,
    params: CalibrationParams,
    warnings: list[str],
    *,
    video_width_px: int,
) -> tuple[CameraFit | None, dict[str, float]]:
    if photo is None:
        return None, {}
    try:
        sighting = sight_target(
            photo,
            target,
            roof,
            min_marks=params.min_marks,
            radial_significance=params.radial_significance,
            quarter_turns=(0, 1, 3, 2),  # cameras do not always note how they were held
        )
    except TooFewMarks as few:
        warnings.append(
            f"The texture photo of the target cannot be used: {few}. Clouds take their grey from the video."
        )
        return None, {}
    # a photo is finer than the video: its limit grows with its pixels
    limit = params.max_camera_rms_px * max(1.0, photo.shape[1] / video_width_px)
    if sighting.rms_px > limit:
        warnings.append(
            f"The texture photo of the target cannot be used: its marks lie {sighting.rms_px:.2f} px (rms) off the "
            "camera model. Clouds take their grey from the video."
        )
        return None, {}
    return sighting.fit, {"texture_camera_rms_px": sighting.rms_px, "texture_marks_found": float(len(sighting.row))}


def _marks_as_json(target: Target, sighting: Sighting, mark_phase: FloatArray) -> list[dict[str, Any]]:
    return [
        {
            "mark": int(target.mark[row]),
            "x_px": float(centre[0]),
            "y_px": float(centre[1]),
            "unwrapped_phase": float(phase) if np.isfinite(phase) else None,
            "residual_x_px": float(residual[0]),
            "residual_y_px": float(residual[1]),
        }
        for row, centre, phase, residual in sorted(
            zip(sighting.row, sighting.centre, mark_phase, sighting.fit.residual, strict=True),
            key=lambda seen: int(target.mark[seen[0]]),
        )
    ]


def _too_large(metric: str, value: float, limit: float, unit: str, message: str) -> CaptureProblem:
    return CaptureProblem("calibration", metric, message, value=round(value, 4), limit=limit, unit=unit)
