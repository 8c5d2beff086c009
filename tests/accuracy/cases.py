"""The captures on which accuracy is measured: the traps one by one, and combined."""

from __future__ import annotations

from typing import Any, NamedTuple

from rahas.params import CaptureReviewParams, Config, PhaseParams
from rahas.simulate.examples import example
from rahas.simulate.specs import CaptureSpec


class Goals(NamedTuple):
    """What the default mode should reach (ALGORITHMS 4); ``None``: reported only."""

    over_bound: float | None = 1.10
    ripple_mrad: float = 1.0
    wrong_orders: float = 0.005
    coverage: float = 0.99
    one_in: float | None = 5000.0  # field diagonals over depth rms


DEFAULTS = Config()
IN_THE_DARK = Config(  # takes what the default limits reject
    capture_review=CaptureReviewParams(min_contrast=0.5, min_object_span=0.0),
    phase=PhaseParams(min_modulation_to_noise=1.0),
)
CLEAN = Goals()
COMPRESSED = Goals(over_bound=None, one_in=None)  # its cost is reported, not hidden
BENT = Goals(over_bound=1.25)  # gamma 2.2, flicker and drift


class Case(NamedTuple):
    """A capture, and the calibration of the same rig and camera."""

    name: str
    scan: CaptureSpec
    calibration: CaptureSpec
    goals: Goals
    asks: str = ""  # what of the sphere or plane is evaluated
    settings: Config = DEFAULTS


def _case(
    name: str,
    kind: Any = "circle",
    *,
    asks: str = "",
    rig: dict[str, Any] | None = None,
    hand: dict[str, Any] | None = None,
    camera: dict[str, Any] | None = None,
    encoding: dict[str, Any] | None = None,
    scene: dict[str, Any] | None = None,
    calibrated_with: tuple[str, ...] = (),
    goals: Goals = CLEAN,
    settings: Config = DEFAULTS,
    seed: int = 7,
) -> Case:
    """The calibration shares the rig and those fields of the camera that belong to it (``calibrated_with``)."""
    own = {k: v for k, v in (camera or {}).items() if k in calibrated_with}
    scan = example(kind, seed=seed, rig=rig, hand=hand, camera=camera, encoding=encoding or {}, scene=scene)
    return Case(name, scan, example("roof", seed=5, rig=rig, camera=own), goals, asks, settings)


DIM = Goals(one_in=None)
SKEW = {"first_stop_deg": 1.5, "second_stop_deg": 90.6, "centre_u": 0.03, "centre_v": -0.02, "baseline_tilt_deg": 3.0}
GAMMA = {"gamma": 2.2}
HARD = {**GAMMA, "flicker": 0.02, "ambient": 0.03, "ambient_drift": 0.3}

CASES: tuple[Case, ...] = (
    _case("clean"),
    _case("slide truly translated", rig={"crank": "translation"}),
    _case("camera gamma 2.2", camera=GAMMA, calibrated_with=("gamma",), goals=BENT),
    _case("flicker 2 %", camera={"flicker": 0.02}),
    _case("gamma, flicker, ambient drift", camera=HARD, calibrated_with=("gamma",), goals=BENT),
    _case("auto-exposure", camera={"auto_exposure": 0.5}),
    _case("slide's second harmonic 10 %", rig={"second_harmonic": 0.1}),
    _case("crank stalls", hand={"pauses": [{"at": 0.4, "length": 0.15}]}),
    _case("crank slips back", hand={"pauses": [{"at": 0.5, "length": 0.1, "back": 0.6}]}),
    _case("0.95 of a period", hand={"periods": 0.95}),
    _case("3 periods", hand={"periods": 3.0, "crank_s": 6.0}),
    _case("jerky, fast lever", hand={"jerk": 0.7, "rotation_s": 3.2}),
    _case("tremor 0.4 px", hand={"tremor_px": 0.4}),
    _case("doubled and dropped frames", camera={"doubled": [120, 300, 320], "dropped": [150, 310]}),
    _case("interlaced", camera={"fields": "top_first", "exposure_s": 0.012}),
    _case("rolling shutter 15 ms", camera={"readout_s": 0.015}, calibrated_with=("readout_s",)),
    _case("H.264 crf 18", encoding={"codec": "h264", "crf": 18}, goals=COMPRESSED),
    _case("H.264 crf 23", encoding={"codec": "h264", "crf": 23}, goals=COMPRESSED),
    _case("MPEG-2", encoding={"codec": "mpeg2", "quantiser": 2}, goals=COMPRESSED),
    _case("saturated highlights", camera={"peak": 1.1}),
    _case("dim: σ/b 0.45, default limits off", camera={"peak": 0.12, "read_noise": 0.015},
          goals=DIM, settings=IN_THE_DARK),
    _case("depth steps 2, 5, 10 mm", "steps"),
    _case("islands: grinding stone", "metate"),
    _case("stops, centre, baseline off", rig=SKEW),
    _case("radial distortion 1 %", rig={"radial_k1": -0.12}),
    _case("all combined", rig={**SKEW, "radial_k1": -0.05}, camera=HARD, calibrated_with=("gamma",),
          hand={"pauses": [{"at": 0.4, "length": 0.1}], "tremor_px": 0.2}, encoding={"codec": "h264", "crf": 14},
          goals=COMPRESSED),
    _case("plane", "plane", asks="flatness"),
    _case("sphere", "sphere", asks="sphere"),
    _case("1920 × 1080, 30 stripes", rig={"width_px": 1920, "height_px": 1080, "stripes": 30}),
    _case("640 × 480, 12 stripes", rig={"width_px": 640, "height_px": 480, "stripes": 12}),
    _case("portrait, 480 × 720", rig={"width_px": 480, "height_px": 720}),
    _case("projector distortion 1 %", rig={"projector_radial_k1": 0.053}),
)  # fmt: skip
