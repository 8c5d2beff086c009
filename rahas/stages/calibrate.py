"""Camera, projector and texture camera from a scan of the roof target (thesis 2.3)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.mark_identity import mark_spacing
from rahas.kernels.projector import MIN_POINTS, fit_projector, phase_at_mark
from rahas.kernels.radial_profile import fit_radial
from rahas.kernels.rig_uncertainty import rig_covariance
from rahas.kernels.roof import Roof, fit_roof, points_on_roof
from rahas.kernels.target_phase import TargetPhaseFit, fit_projector_on_roof
from rahas.kernels.triangulation import pixel_grid, rays_of_camera, triangulate
from rahas.params import CalibrationParams
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
) -> Calibration:
    """Calibrate the rig.

    ``background`` (y, x) the stripe-free image of the camera, ``unwrapped_phase`` (y, x) rad with NaN where not
    measured, ``photo`` (y, x) grey from the texture camera or ``None``.

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
    dense = _projector_of(unwrapped_phase, sighting, target, roof, mark_phase, params)
    sighting = _with_radial(sighting, dense, target, roof, params)
    dense = _projector_of(unwrapped_phase, sighting, target, roof, mark_phase, params)
    residual_rad = dense.fit.residual[dense.fit.used]
    residual_mm = _residual_in_mm(dense, sighting)
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
    texture_camera, texture_residual = _texture_camera_of(
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
        **texture_residual,
    }
    covariance = rig_covariance(
        sighting.fit,
        roof,
        dense.pixels[dense.fit.used],
        dense.fit.matrix,
        dense.fit.covariance,
        reach_mm=target.world,
    )
    height, width = unwrapped_phase.shape
    rig = Rig(ImagingCamera(sighting.fit.camera, width, height), dense.fit.matrix, texture_camera, covariance)
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


def _projector_of(
    unwrapped_phase: AnyArray,
    sighting: Sighting,
    target: Target,
    roof: Roof,
    mark_phase: FloatArray,
    params: CalibrationParams,
) -> TargetPhaseFit:
    known = np.isfinite(mark_phase)
    start = None
    if known.sum() > MIN_POINTS + 2:
        start = fit_projector(target.world[sighting.row[known]], mark_phase[known]).matrix
    try:
        dense = fit_projector_on_roof(
            unwrapped_phase,
            sighting.fit.camera,
            roof,
            target.world,
            mark_radius_mm=sighting.radius_mm,
            margin_mm=0.3 * float(np.median(mark_spacing(target.world))),
            start=start,
        )
    except ValueError as error:
        raise CaptureProblem(
            "calibration",
            "projector_points",
            f"Too little phase was measured on the target ({error}). Scan it again with the lamp's stripes sharp and "
            "bright on both slopes.",
            value=0,
            limit=100,
            unit="points",
        ) from None
    if dense.inlier_share < params.min_projector_inlier_share:
        raise _too_large(
            "projector_inlier_share",
            dense.inlier_share,
            params.min_projector_inlier_share,
            "",
            f"Only {100 * dense.inlier_share:.0f} % of what was measured between the target's marks agrees with its "
            "two planes. Scan the target again, turning lever and crank slowly and evenly.",
        )
    return dense


def _with_radial(
    sighting: Sighting, dense: TargetPhaseFit, target: Target, roof: Roof, params: CalibrationParams
) -> Sighting:
    """The sighting with a camera whose radial term suits the dense phase as well."""
    fit = fit_radial(
        target.world[sighting.row],
        sighting.centre,
        roof,
        dense.pixels[dense.fit.used],
        _phase_on(dense)[dense.fit.used],
        dense.fit.matrix,
        centre=sighting.fit.camera.centre,
        start=sighting.fit.camera.radial,
        significance=params.radial_significance,
    )
    return sighting._replace(fit=fit)


def _residual_in_mm(dense: TargetPhaseFit, sighting: Sighting) -> FloatArray:
    """Phase residuals of the used points as distances along their rays, mm."""
    used = dense.fit.used
    origin, direction = rays_of_camera(sighting.fit.camera, dense.pixels[used])
    measured = triangulate(
        origin,
        direction,
        _phase_on(dense)[used],
        dense.fit.matrix,
    )
    per_radian = np.linalg.norm(measured.per_radian, axis=-1)
    residual: FloatArray = dense.fit.residual[used] * per_radian
    return residual[np.isfinite(residual)]


def _phase_on(dense: TargetPhaseFit) -> FloatArray:
    top, bottom = np.moveaxis(dense.points @ dense.fit.matrix[:, :3].T + dense.fit.matrix[:, 3], -1, 0)
    phase: FloatArray = 2.0 * np.pi * top / bottom + dense.fit.residual
    return phase


def _texture_camera_of(
    photo: AnyArray | None,
    target: Target,
    roof: Roof,
    params: CalibrationParams,
    warnings: list[str],
    *,
    video_width_px: int,
) -> tuple[ImagingCamera | None, dict[str, float]]:
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
    imaging = ImagingCamera(sighting.fit.camera, photo.shape[1], photo.shape[0])
    return imaging, {"texture_camera_rms_px": sighting.rms_px, "texture_marks_found": float(len(sighting.row))}


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
