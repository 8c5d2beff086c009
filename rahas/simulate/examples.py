"""Ready captures for tests and benches: full size, or half-size and short."""

from __future__ import annotations

from typing import Any

from rahas.simulate.specs import CameraSpec, CaptureSpec, HandSpec, PoseSpec, RigSpec, SceneKind, SceneSpec

SHORT_RIG: dict[str, Any] = {"width_px": 360, "height_px": 240, "stripes": 16}
SHORT_HAND: dict[str, Any] = {
    "dark_before_s": 0.2,
    "hold_before_s": 0.5,
    "rotation_s": 2.5,
    "hold_between_s": 0.4,
    "crank_s": 1.8,
    "hold_after_s": 0.45,
    "dark_after_s": 0.15,
    "jerk": 0.25,
}
LEANING_TARGET: dict[str, Any] = {"z_mm": 12.0, "yaw_deg": 3.0, "pitch_deg": -2.0, "roll_deg": 2.5}


def example(
    kind: SceneKind,
    *,
    short: bool = False,
    seed: int = 1,
    rig: dict[str, Any] | None = None,
    target: dict[str, Any] | None = None,
    scene: dict[str, Any] | None = None,
    hand: dict[str, Any] | None = None,
    camera: dict[str, Any] | None = None,
    **rest: Any,
) -> CaptureSpec:
    """A clean capture of ``kind``: 450 frames at 720 × 480, or ``short``: 180 frames at 360 × 240, 16 stripes.

    The dictionaries change single fields of the parts; bumps are in pixels of the image asked for.
    ``rest`` are fields of :class:`CaptureSpec` itself.
    """
    size = 170.0 if kind != "metate" else 280.0
    return CaptureSpec(
        rig=RigSpec(**{**(SHORT_RIG if short else {}), **(rig or {})}),
        target=PoseSpec(**{**LEANING_TARGET, **(target or {})}),
        scene=SceneSpec(**{"kind": kind, "seed": seed, "size_mm": size, **(scene or {})}),
        hand=HandSpec(**{**(SHORT_HAND if short else {}), **(hand or {})}),
        camera=CameraSpec(**(camera or {})),
        seed=seed,
        **rest,
    )
