"""Every quantity once: what it is called, how it is shaped, its unit and what it means. Data, not code.

``docs/vocabulary.md`` is generated from here (``python -m rahas.report.glossary``); stores, pages and test builders
take names, units and meanings from here. Ranges are closed intervals in the stated unit; ``None`` is unbounded.
Sign conventions: image x to the right, y down, pixel centres at integers; world frame = target's frame, x right,
y up, z towards the camera; phase grows downwards in the image.
"""

# ruff: noqa: E501 - one row a quantity: a table is read by its columns, unbroken
from __future__ import annotations

from typing import NamedTuple


class Quantity(NamedTuple):
    """One stored quantity.

    ``symbol`` is the one used in this project's formulas, ``thesis_symbol`` Crane's (2011) where there is one;
    ``found_in`` names the file; ``dims`` its named dimensions in order.
    """

    name: str
    symbol: str
    thesis_symbol: str
    found_in: str
    dims: tuple[str, ...]
    unit: str
    dtype: str
    low: float | None
    high: float | None
    definition: str


class Metric(NamedTuple):
    """One number of a scan's review, as it stands in qa.json and scans.csv."""

    name: str
    label: str
    unit: str
    definition: str


_FRAMES, _TIMELINE, _SNAKES, _PHASE = "frames.zarr", "timeline.json", "snakes.zarr", "phase.zarr"
_CALIBRATION, _CLOUD = "calibration.json", "cloud.zarr"
_F, _YX, _FYX, _FSX = ("frame",), ("y", "x"), ("frame", "y", "x"), ("frame", "snake", "x")
_XYZ = ("y", "x", "axis")
_PI = 3.141592653589793

QUANTITIES: tuple[Quantity, ...] = (
    # name, symbol, thesis symbol, found in, dims, unit, dtype, low, high, definition
    Quantity("frames", "I", "I_n", _FRAMES, _FYX, "grey level", "uint8|uint16", 0, None, "luma of every frame as shot; interlaced frames whole"),
    Quantity("time_s", "t", "", _FRAMES, _F, "s", "float64", None, None, "presentation time of the frame (interlaced: of its first field)"),
    Quantity("mean_level", "", "", _FRAMES, _F, "grey level", "float32", 0, None, "mean luma of the frame"),
    Quantity("clipped_low_share", "", "", _FRAMES, _F, "1", "float32", 0, 1, "share of pixels at the sensor's lower limit"),
    Quantity("clipped_high_share", "", "", _FRAMES, _F, "1", "float32", 0, 1, "share of pixels at the sensor's upper limit"),
    Quantity("change", "", "", _FRAMES, _F, "grey level", "float32", 0, None, "mean absolute difference from the frame before"),
    Quantity("thumbnail", "", "", _FRAMES, ("frame", "y_thumb", "x_thumb"), "grey levels / scale", "uint16", 0, None, "mean over blocks of 4 × 4 pixels times the attribute scale; interlaced: 2 rows of the first field × 4 columns"),
    Quantity("slide_angle_deg", "θ_n", "", _TIMELINE, _F, "°", "float", -5, 95, "angle of the slide: 0 at the lever's first stop (epipolar alignment), 90 at its second (phase alignment); null in the dark"),
    Quantity("phase_step_rad", "δ_n", "α_n", _TIMELINE, _F, "rad", "float", None, None, "phase step at the field's centre, 0 at the hold before the scan; null outside the scan"),
    Quantity("periods", "", "", _TIMELINE, (), "periods", "float", 0, None, "how far the crank moved the pattern"),
    Quantity("snake_identity", "Si", "Si", _SNAKES, _FSX, "1", "int16", 0, None, "stripe that the snake follows at this column, 1 = topmost, 0 = blank"),
    Quantity("snake_y", "Sy", "Sy", _SNAKES, _FSX, "px", "float32", None, None, "row of the stripe's peak on the un-rotated canvas; NaN where blank"),
    Quantity("snake_value", "Sp", "Sp", _SNAKES, _FSX, "grey level", "float32", None, None, "normalised luma at the stripe's peak"),
    Quantity("unrotation_deg", "", "", _SNAKES, _F, "°", "float32", -95, 95, "angle by which the canvas is turned about the image's centre so that stripes lie level: rotation sense × (90 − slide angle)"),
    Quantity("wrapped_phase", "φ", "φ_w", _PHASE, _YX, "rad", "float32", -_PI, _PI, "phase of the pattern at the reference slide position, modulo 2π; 0 at the pattern's maxima"),
    Quantity("unwrapped_phase", "Φ", "φ_uw", _PHASE, _YX, "rad", "float32", None, None, "φ + 2π·m: 2π per stripe, growing downwards, the same zero for a scan and its calibration (thesis: θ_k + φ_w/M_s)"),
    Quantity("fringe_order", "m", "k", _PHASE, _YX, "1", "int16", -32768, 32767, "(Φ − φ)/2π; −32768 where nothing was measured"),
    Quantity("order_confidence", "", "", _PHASE, _YX, "1", "float32", 0, 1, "confidence in the fringe order, 1 = certain"),
    Quantity("background", "a", "A", _PHASE, _YX, "grey level", "float32", None, None, "unpatterned brightness"),
    Quantity("modulation", "b", "B", _PHASE, _YX, "grey level", "float32", 0, None, "amplitude of the pattern at the pixel"),
    Quantity("phase_std", "σ_φ", "", _PHASE, _YX, "rad", "float32", 0, None, "standard deviation of the wrapped phase from the fit's residuals"),
    Quantity("chi2", "χ²", "", _PHASE, _YX, "1", "float32", 0, None, "squared residual of the fit over that of pixels of like brightness"),
    Quantity("quality", "Q", "Q", _PHASE, _YX, "grey level", "float32", 0, None, "quality image of the phase-shifting solve (eq. 3.19)"),
    Quantity("phase_step", "δ_n", "α_n", _PHASE, _F, "rad", "float32|float64", None, None, "phase step at the field's centre, so that frame n shows cos(Φ + δ_n); NaN outside the scan"),
    Quantity("camera_matrix", "M^c", "M^c", _CALIBRATION, ("row", "column"), "mm → px", "float", None, None, "3 × 4 perspective matrix, m12 = 1 (eq. 2.9)"),
    Quantity("projector_matrix", "M^p", "M^p", _CALIBRATION, ("row", "column"), "mm → periods", "float", None, None, "2 × 4: rows m5…m8 and m9…m12, world point → Φ/2π"),
    Quantity("xyz", "X", "X^w Y^w Z^w", _CLOUD, _XYZ, "mm", "float32", None, None, "world coordinates of the surface seen at the pixel, after debanding; NaN where nothing was measured"),
    Quantity("xyz_before_debanding", "", "", _CLOUD, _XYZ, "mm", "float32", None, None, "the same before debanding"),
    Quantity("z_std", "σ_Z", "", _CLOUD, _YX, "mm", "float32", 0, None, "standard deviation of the height that the phase's noise gives"),
    Quantity("rgb", "", "", _CLOUD, ("y", "x", "channel"), "1", "uint8", 0, 255, "colour from the texture photo, else from the background"),
)  # fmt: skip

METRICS: tuple[Metric, ...] = (
    Metric("object_span", "object span", "of the width", "horizontal extent of the region where stripes can be measured (modulation ≥ 5 σ), 95th percentile over rows that have any; after the cloud: of the connected surface at the image's centre"),
    Metric("jitter", "jitter", "px", "largest rms displacement of the object in the image within any second from the start of the rotation to the end of the scan"),
    Metric("periods", "pattern scanned", "periods", "periods of the pattern that the crank moved through"),
    Metric("contrast", "contrast", "× noise", "median modulation over noise of the measurable object"),
    Metric("clipped_share", "clipped pixels", "of the object", "share of the object's pixels at either limit of the sensor"),
    Metric("clipped_high_share", "clipped bright", "of the object", "share of the object's pixels at the sensor's upper limit"),
    Metric("clipped_low_share", "clipped dark", "of the object", "share of the object's pixels at the sensor's lower limit"),
    Metric("frames", "frames", "", "frames in the capture"),
    Metric("rotation_frames", "frames of the rotation", "", "from 0.5° off the lever's first stop to 0.5° off its second"),
    Metric("scan_frames", "frames of the scan", "", "from 0.05 rad off the hold before the crank to 0.05 rad off the hold after it"),
    Metric("duplicated_frames", "doubled frames", "", "frames that repeat the one before"),
    Metric("dropped_frames", "dropped frames", "", "frames that the camera lost"),
    Metric("damaged_frames", "damaged frames", "", "frames that the decoder could not read whole"),
    Metric("noise_grey_levels", "noise", "grey levels", "standard deviation of a pixel from frame to frame, median over the object"),
    Metric("pitch_px", "stripe pitch", "px", "rows from stripe to stripe at the reference slide position"),
    Metric("jitter_std_px", "jitter measurement", "px", "predicted standard deviation of one frame's displacement, median"),
    Metric("object_found_share", "object followed", "of the frames", "share of the frames from rotation to scan in which the object's displacement could be measured"),
    Metric("measured_share", "surface measured", "of the measurable", "share of the measurable pixels that are points of the cloud"),
    Metric("marks_found", "marks recognised", "", "marks of the target that were found and identified"),
    Metric("camera_rms_px", "camera residual", "px", "rms distance of the marks from the camera model"),
    Metric("camera_max_px", "largest camera residual", "px", "of any mark"),
    Metric("projector_rms_rad", "projector residual", "rad", "rms phase residual on the target's planes"),
    Metric("projector_rms_mm", "flatness of the target as measured", "mm", "rms distance of the measured surface from the target's two planes"),
    Metric("projector_points", "points of the projector fit", "", "pixels on the target's planes that the projector model was fitted to"),
    Metric("projector_inlier_share", "phase that agrees", "of the points", "share of the phase measured between the marks that agrees with the planes"),
    Metric("mark_radius_mm", "radius of the marks", "mm", "as seen by the camera"),
    Metric("target_flatness_mm", "flatness of the target's table", "mm", "rms distance of the marks in config/target.csv from two planes"),
    Metric("texture_camera_rms_px", "texture camera residual", "px", "rms distance of the marks from the texture camera's model"),
    Metric("texture_marks_found", "marks in the texture photo", "", "marks found in the target's photo"),
    Metric("points", "points", "", "points of the cloud"),
    Metric("point_spacing_mm", "point spacing", "mm", "median distance of neighbouring points across the line of sight"),
    Metric("measurable_share", "measurable", "of the image", "share of the image in which stripes can be measured (modulation ≥ 5 σ)"),
    Metric("label_residual_stripes", "labels against the calibration", "stripes", "median distance of the first hold's stripes from where they lay in the calibration"),
    Metric("calibration_phase_offset_rad", "slide and rig against the calibration", "rad", "mean phase of the first hold's pattern beside where the calibration puts it"),
    Metric("calibration_phase_gradient_rad", "the same, varying over the field", "rad", "rms of what is left besides the mean: tilt, scale and keystone"),
    Metric("calibration_depth_error_mm", "depth error by it", "mm", "rms error of Z by the simplest change of slide, lens or rig that explains it"),
    Metric("first_stop_residual", "first hold's residual", "of the modulation", "image of the first hold beside the model of the projector at the first stop"),
    Metric("order_disagreement", "snakes against rotation code", "of the pixels", "share of the pixels to which both give an order, but not the same"),
    Metric("compression_cost", "cost of the video's compression", "×", "growth of the phase's standard deviation by errors that last over several frames"),
    Metric("ripple_before_rad", "ripple before debanding", "rad", "largest rms amplitude of a phase-locked error order before debanding"),
    Metric("ripple_after_rad", "ripple after debanding", "rad", "the same after debanding"),
)  # fmt: skip
