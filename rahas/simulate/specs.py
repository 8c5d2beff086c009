"""What is rendered: rig, scene, hand, camera and encoding of a capture, as strict models with units in the names."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class Spec(BaseModel):
    """Base of all specifications: frozen, finite, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class RigSpec(Spec):
    """Camera below, slide projector above; the baseline is vertical in the image but for ``baseline_tilt_deg``."""

    width_px: int = Field(720, ge=64, le=4096)
    height_px: int = Field(480, ge=64, le=4096)
    focal_widths: float = Field(2.03, gt=0.3, description="camera's focal length in image widths")
    radial_k1: float = Field(0.0, ge=-0.5, le=0.5, description="distorted = ideal·(1 + k1·r²), r in focal lengths")
    working_distance_mm: float = Field(610.0, gt=50)
    baseline_mm: float = Field(200.0, gt=1)
    baseline_tilt_deg: float = Field(0.0, ge=-15, le=15, description="turn of rig's baseline in the image")
    toe_in_deg: float | None = Field(None, description="projector's downward pitch; empty: aimed at the scene's origin")
    projector_yaw_deg: float = Field(0.0, ge=-5, le=5, description="turn of the projector about its own upright axis")
    projector_roll_deg: float = Field(0.0, ge=-5, le=5, description="turn of the projector about its optical axis")
    projector_radial_k1: float = Field(
        0.0, ge=-0.5, le=0.5, description="slide point = ideal·(1 + k1·r²), r tangent of the angle off the axis"
    )
    half_field_deg: float = Field(17.0, gt=2, lt=45, description="from the projector's axis to slide coordinate 1")
    stripes: int = Field(24, ge=2, le=200, description="pattern periods over slide coordinates −1 to 1")
    centre_u: float = Field(0.0, description="slide's centre of rotation")
    centre_v: float = 0.0
    slide_shift_rad: float = Field(0.0, description="slide moved in its holder across its stripes, pattern phase")
    first_stop_deg: float = Field(0.0, ge=-5, le=5, description="slide angle at the first stop")
    second_stop_deg: float = Field(90.0, ge=80, le=100)
    crank: Literal["tilt", "translation"] = Field(
        "tilt", description="the cam tilts the projector, or the slide slides"
    )
    contrast: float = Field(0.95, gt=0, le=1, description="of the projected cosine")
    second_harmonic: float = Field(0.0, ge=-0.3, le=0.3, description="of the projected cosine: the slide's density")
    aperture: float = Field(1.0, gt=0.1, description="half width of the lit square, slide coordinates")
    texture_offset_mm: float = Field(60.0, description="texture camera to the right of the video camera")
    texture_scale: float = Field(3.0, gt=0, description="pixels of the photo for one of the video")


class PoseSpec(Spec):
    """Where the calibration target stood: its middle in the scene's frame, then yaw, pitch and roll."""

    x_mm: float = 0.0
    y_mm: float = 0.0
    z_mm: float = 10.0
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0


SceneKind = Literal["circle", "monkey", "tricircle", "metate", "roof", "plane", "sphere", "steps"]


class SceneSpec(Spec):
    """What stands before the rig."""

    kind: SceneKind
    seed: int = Field(1, ge=0, description="of the rock's texture and relief")
    size_mm: float = Field(260.0, gt=5, description="width of the carving or the object")
    relief: float = Field(1.0, ge=0, description="factor on the surface's roughness and undulation")
    turn_deg: float = Field(0.0, description="turn of the object in the image")
    lean_deg: float = Field(0.0, ge=-40, le=40, description="lean of the surface: its top away from the camera")
    texture: float = Field(1.0, ge=0, le=2, description="factor on the albedo's fine contrast")


class BumpSpec(Spec):
    """A knock on the rig: the object jumps in the image and rings down."""

    at_s: float = Field(ge=0)
    peak_px: float = Field(description="first swing")
    frequency_hz: float = Field(4.0, gt=0)
    decay_s: float = Field(0.7, gt=0)
    direction_deg: float = Field(0.0, description="0 sideways, 90 downwards in the image")


class PauseSpec(Spec):
    """A stall of the crank, or a slip back when ``back`` is above zero."""

    at: float = Field(ge=0, le=1, description="share of the crank's time gone")
    length: float = Field(0.08, gt=0, lt=1, description="share of the crank's time")
    back: float = Field(0.0, ge=0, le=2, description="speed backwards, in mean speeds")


class HandSpec(Spec):
    """What the operator does, in seconds from the start of the film."""

    dark_before_s: float = Field(0.8, ge=0)
    hold_before_s: float = Field(1.4, ge=0)
    rotation_s: float = Field(5.2, ge=0)
    hold_between_s: float = Field(1.3, ge=0)
    crank_s: float = Field(4.2, ge=0)
    hold_after_s: float = Field(1.3, ge=0)
    dark_after_s: float = Field(0.8, ge=0)
    periods: float = Field(1.6, description="pattern periods that pass the field's centre; negative: upwards")
    jerk: float = Field(0.35, ge=0, le=1, description="unevenness of the hand's speed")
    pauses: tuple[PauseSpec, ...] = ()
    bumps: tuple[BumpSpec, ...] = ()
    tremor_px: float = Field(0.0, ge=0, description="rms displacement while a hand is on the rig")

    @property
    def duration_s(self) -> float:
        """Length of the film."""
        return (
            self.dark_before_s
            + self.hold_before_s
            + self.rotation_s
            + self.hold_between_s
            + self.crank_s
            + self.hold_after_s
            + self.dark_after_s
        )


class CameraSpec(Spec):
    """Sensor and electronics; light is in units of the sensor's full scale."""

    frame_rate: float = Field(30.0, gt=0)
    exposure_s: float = Field(1 / 60, gt=0)
    readout_s: float = Field(0.0, ge=0, description="rolling shutter: from the first row to the last")
    fields: Literal["progressive", "top_first", "bottom_first"] = "progressive"
    peak: float = Field(0.62, gt=0, description="brightest lamp light in the scene (99.5th percentile)")
    shot_noise: float = Field(2.5e-4, ge=0, description="variance per light")
    read_noise: float = Field(0.004, ge=0)
    ambient: float = Field(0.012, ge=0, description="stray light on a white surface")
    ambient_drift: float = Field(0.0, description="relative change of the stray light over the film")
    flicker: float = Field(0.0, ge=0, lt=1, description="relative swing of the lamp")
    flicker_hz: float = Field(4.3, gt=0)
    auto_exposure: float = Field(0.0, ge=0, le=1, description="share of a change of brightness that is regulated away")
    gamma: float = Field(1.1, ge=0.4, le=3, description="code = light^(1/gamma)")
    pedestal: float = Field(0.01, ge=0, lt=0.5, description="code of no light, share of full scale")
    luma_range: Literal["full", "limited"] = "limited"
    doubled: tuple[int, ...] = Field((), description="frames that repeat the one before")
    dropped: tuple[int, ...] = Field((), description="frames that were lost, numbered as shot")


class EncodingSpec(Spec):
    """How the film is stored."""

    codec: Literal["ffv1", "h264", "mpeg2", "mjpeg", "png"] = "ffv1"
    crf: float = Field(12.0, ge=0, le=51, description="H.264: constant rate factor")
    quantiser: int = Field(2, ge=1, le=31, description="MPEG-2 and MJPEG: quantiser scale")


class CaptureSpec(Spec):
    """One capture, whole."""

    rig: RigSpec = RigSpec()
    target: PoseSpec = PoseSpec()
    scene: SceneSpec
    hand: HandSpec = HandSpec()
    camera: CameraSpec = CameraSpec()
    encoding: EncodingSpec = EncodingSpec()
    photo_light: Literal["flash", "lamp"] = "flash"
    expected: Literal["accepted", "rejected", "not_processed"] = "accepted"
    expected_rule: str = ""
    seed: int = Field(0, ge=0, description="of hand and noise")
