"""Parameters: one frozen model a stage, ranges and units stated, unknown keys refused.

``config/config.yaml`` and its JSON schema are generated from these models. Every default is good enough to run.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class StageParams(BaseModel):
    """Base of all stage parameters: frozen, finite, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class IngestParams(StageParams):
    """Reading a capture into a frame store."""

    max_megapixels: float = Field(40.0, gt=0, le=400, description="largest frame a decoder may open, megapixels")
    frame_rate: float | None = Field(
        None, gt=0, le=1000, description="frames per second of an image folder (a video tells its own); empty: 30"
    )


class TimelineParams(StageParams):
    """Finding dark, hold, rotation and scan."""

    rotation_threshold_deg: float = Field(
        0.5, gt=0, le=5, description="slide angle off its stop that counts as moving, degrees"
    )
    scan_threshold_rad: float = Field(
        0.05, gt=0, le=1, description="pattern phase off the hold that counts as moving, radians"
    )


class CaptureReviewParams(StageParams):
    """QA before phase: limits on what the capture shows."""

    min_object_span: float = Field(
        0.5, ge=0, le=1, description="horizontal extent of the measurable object, share of the image width"
    )
    max_jitter_px: float = Field(1.0, gt=0, description="rms displacement of the object in the worst second, pixels")
    max_jitter_std_px: float = Field(
        0.3, gt=0, description="displacement less sure than this counts as not measured, pixels"
    )
    min_periods: float = Field(0.9, gt=0, description="pattern periods that the crank must scan")
    max_clipped_share: float = Field(0.1, ge=0, le=1, description="share of the object's pixels at the sensor's limit")
    min_contrast: float = Field(5.0, gt=0, description="median modulation over noise of the measurable object")


class SnakesParams(StageParams):
    """Tracking the stripes through rotation and scan (thesis 3.4)."""

    median_px: Literal[1, 3, 5] = Field(3, description="side of the median filter, pixels; 1: none")
    average_pitches: float = Field(
        0.12, ge=0, le=0.4, description="side of the moving average, share of the stripe pitch"
    )
    min_modulation_over_noise: float = Field(
        6.0, gt=0, description="modulation over smoothed noise of a pixel that is lit by the pattern"
    )
    sidelobe_pitches: float = Field(
        0.4, gt=0.1, lt=0.5, description="distance of a peak to its side lobes (PSR), share of the stripe pitch"
    )
    min_psr: float = Field(
        1.25, gt=1, le=3, description="smallest peak to side-lobe ratio of the normalised pattern + 2"
    )
    min_level: float = Field(0.3, ge=-1, lt=1, description="smallest normalised pattern (-1 to 1) at a peak")
    track_pitches: float = Field(
        0.3,
        gt=0,
        lt=0.5,
        description="search up and down from frame to frame about the common motion, share of the pitch",
    )
    grow_gap_pitches: float = Field(
        0.25, ge=0, le=2, description="columns a growing snake may jump, share of the pitch"
    )
    grow_reach_pitches: float = Field(
        0.1,
        gt=0,
        lt=0.5,
        description="rows that a growing snake may be off its straight continuation, share of the pitch",
    )
    spare_snakes: int = Field(8, ge=0, le=100, description="identities kept for stripes that enter from below")
    min_tracked_share: float = Field(
        0.2, ge=0, le=1, description="share of the first frame's snake pixels that must be there at the second hold"
    )


class PhaseParams(StageParams):
    """Wrapped and unwrapped phase (thesis 3.5)."""

    method: Literal["joint", "least_squares", "thesis"] = Field(
        "joint",
        description="joint: every frame at its own step, which varies over the field as the crank tilts the projector; "
        "least_squares: every frame at one step for the whole field; "
        "thesis: one period resampled to even steps, rows blanked at each stripe",
    )
    max_label_residual_stripes: float = Field(
        0.25,
        gt=0,
        lt=0.5,
        description="how far the stripes of the first hold may lie beside the calibration's, before labels are in "
        "doubt, stripes",
    )
    joint_pixels: int = Field(
        1500, ge=200, le=20000, description="pixels that take part in the joint solve of the steps"
    )
    min_modulation_to_noise: float = Field(
        3.0, gt=0, description="stripe amplitude over the noise of a frame, below which nothing is measured"
    )
    outer_reach: float = Field(0.5, ge=0, le=1, description="how far the outermost snake is trusted, stripes")
    growth_px: int = Field(
        40,
        ge=0,
        le=1000,
        description="how far orders are carried beyond the snakes, pixels of an image of 480 rows, more in larger ones",
    )
    growth_tolerance_rad: float = Field(
        1.2, gt=0, lt=3.14, description="largest phase step between neighbours that still continues a surface, radians"
    )
    thesis_blanked_rows: int = Field(
        4, ge=0, le=50, description="rows blanked around each snake by the thesis, whatever the image's size"
    )


class CalibrationParams(StageParams):
    """Camera and projector from the roof target (thesis 2.3)."""

    min_marks: int = Field(14, ge=8, le=18, description="marks of the target that must be recognised, of 18")
    max_camera_rms_px: float = Field(
        0.5, gt=0, le=10, description="rms distance of the marks from the camera model, pixels"
    )
    max_projector_rms_mm: float = Field(
        2.0, gt=0, le=100, description="rms distance of the surface measured on the target from its two planes, mm"
    )
    min_projector_inlier_share: float = Field(
        0.6, ge=0, le=1, description="share of the phase measured between the marks that must agree with the planes"
    )
    max_target_flatness_mm: float = Field(
        1.0, gt=0, le=100, description="rms distance of the table's marks from two planes, mm"
    )
    radial_significance: float = Field(
        4.0, ge=0, le=1000, description="radial distortion is fitted if it is so many standard deviations off zero"
    )


class CloudParams(StageParams):
    """Triangulation, debanding, cleaning and colour."""

    max_phase_std_rad: float = Field(
        0.5, gt=0, le=3.2, description="phase noise above which a pixel is left out, radians"
    )
    deband: bool = Field(True, description="take away the phase error that repeats with the stripes")
    deband_significance: float = Field(
        3.0, ge=0, le=1000, description="a ripple order is taken away if it is so many standard deviations off zero"
    )
    max_slope_deg: float = Field(
        80.0, gt=0, lt=90, description="a steeper slope between two neighbouring pixels is a depth step, degrees"
    )
    min_piece_px: int = Field(
        100,
        ge=1,
        description="smallest loose piece of surface that is kept, pixels of an image of 480 rows, more in larger ones",
    )
    normal_radius_px: int = Field(
        2,
        ge=1,
        le=20,
        description="normals average so many pixels to each side, of an image of 480 rows, more in larger ones",
    )


class ResultReviewParams(StageParams):
    """QA after the cloud: limits on what the result shows."""

    min_measured_share: float = Field(
        0.3, ge=0, le=1, description="measured points for a pixel on which the capture's stripes could be measured"
    )
    max_ripple_rad: float = Field(
        0.05, gt=0, description="ripple left after debanding that is worth a warning, radians"
    )
    max_label_shift_stripes: float = Field(
        0.1, gt=0, description="shift of the first hold's stripes against the calibration's worth a warning, stripes"
    )
    rig_change_warning_rad: float = Field(
        0.03,
        gt=0,
        description="pattern of the first hold beside where the calibration puts it that is worth a warning, radians",
    )
    max_rig_change_rad: float = Field(
        0.6,
        gt=0,
        description="error of the scan's phase by a change of slide, lens or rig since the calibration, radians, rms",
    )
    max_order_disagreement: float = Field(
        0.02, gt=0, le=1, description="share on which snakes and rotation code differ that is worth a warning"
    )
    reject_order_disagreement: float = Field(
        0.2, gt=0, le=1, description="share on which snakes and rotation code differ that is worth a rejection"
    )
    max_compression_cost: float = Field(
        1.25, ge=1, description="growth of the phase's standard deviation by compression that is worth a warning, times"
    )
    depth_step_spacings: float = Field(
        8.0, gt=1, description="height between neighbours that parts two surfaces, in spacings of points"
    )
    bridged_px: int = Field(
        6,
        ge=0,
        le=100,
        description="gap in a column that does not part a surface, pixels of an image of 480 rows, more in larger ones",
    )


class Config(StageParams):
    """The whole of config/config.yaml."""

    ingest: IngestParams = IngestParams()
    timeline: TimelineParams = TimelineParams()
    capture_review: CaptureReviewParams = CaptureReviewParams()
    snakes: SnakesParams = SnakesParams()
    phase: PhaseParams = PhaseParams()
    calibration: CalibrationParams = CalibrationParams()
    cloud: CloudParams = CloudParams()
    result_review: ResultReviewParams = ResultReviewParams()
