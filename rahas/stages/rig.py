"""The calibrated rig: camera, projector, texture camera and their uncertainty, and its form in calibration.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rahas.kernels.camera import Camera
from rahas.kernels.projector_lens import NO_LENS, Lens
from rahas.typing import FloatArray


class ImagingCamera(NamedTuple):
    """A camera and the size of its images."""

    camera: Camera
    width_px: int
    height_px: int


class Rig(NamedTuple):
    """What a calibration tells about the scanner, in the target's frame (mm)."""

    camera: ImagingCamera
    projector: FloatArray
    """(2, 4): (X, Y, Z, 1) → the two terms of Φ/2π."""
    texture_camera: ImagingCamera | None
    covariance: FloatArray
    """(20, 20) or, with a first stop, (27, 27), in the order of ``parameters``."""
    lens: Lens = NO_LENS
    """Of the projector."""
    first_stop: FloatArray | None = None
    """(2, 4), as the projector, at the slide's first stop; ``None``: the calibration has no usable first hold."""
    texture_covariance: FloatArray | None = None
    """(12, 12) of the texture camera's m1…m11 and k1."""

    @property
    def parameters(self) -> FloatArray:
        """Camera's m1…m11 and k1, projector's m5…m11 and k1, first stop's m5…m11 where it is known."""
        camera = self.camera.camera
        known: list[FloatArray] = [
            camera.matrix.ravel()[:11],
            np.array([camera.radial]),
            self.projector.ravel()[:7],
            np.array([self.lens.radial]),
        ]
        if self.first_stop is not None:
            known.append(self.first_stop.ravel()[:7])
        return np.concatenate(known)


CAMERA_NAMES = (*(f"m{i}" for i in range(1, 12)), "radial")
PROJECTOR_NAMES = tuple(f"m{i}" for i in range(5, 12))


def parameter_names(*, first_stop: bool) -> list[str]:
    """Names of the rig's parameters in the order of the covariance."""
    return [
        *(f"camera_{name}" for name in CAMERA_NAMES),
        *(f"projector_{name}" for name in (*PROJECTOR_NAMES, "radial")),
        *(f"first_stop_{name}" for name in (PROJECTOR_NAMES if first_stop else ())),
    ]


def rig_as_json(rig: Rig) -> dict[str, Any]:
    """The models, their covariance and the standard deviation of every parameter, as calibration.json has them."""
    names = parameter_names(first_stop=rig.first_stop is not None)
    std = dict(zip(names, _std(rig.covariance), strict=True))
    if rig.texture_camera is not None and rig.texture_covariance is not None:
        std |= {f"texture_camera_{n}": s for n, s in zip(CAMERA_NAMES, _std(rig.texture_covariance), strict=True)}
    return {
        "camera": _camera_as_json(rig.camera),
        "projector": {
            "matrix": rig.projector.tolist(),
            "radial": rig.lens.radial,
            "centre_mm": rig.lens.centre.tolist(),
        },
        "first_stop": None if rig.first_stop is None else {"matrix": rig.first_stop.tolist()},
        "texture_camera": None if rig.texture_camera is None else _camera_as_json(rig.texture_camera),
        "covariance": {"parameters": names, "matrix": rig.covariance.tolist()},
        "standard_deviations": std,
    }


def rig_from_json(calibration: Mapping[str, Any]) -> Rig:
    """The rig of a calibration.json."""
    texture, first_stop = calibration["texture_camera"], calibration["first_stop"]
    return Rig(
        _camera_from_json(calibration["camera"]),
        np.array(calibration["projector"]["matrix"], dtype=np.float64),
        None if texture is None else _camera_from_json(texture),
        np.array(calibration["covariance"]["matrix"], dtype=np.float64),
        Lens(
            float(calibration["projector"]["radial"]),
            np.array(calibration["projector"]["centre_mm"], dtype=np.float64),
        ),
        None if first_stop is None else np.array(first_stop["matrix"], dtype=np.float64),
    )


def _std(covariance: FloatArray) -> list[float]:
    return [float(s) for s in np.sqrt(np.maximum(np.diag(covariance), 0.0))]


def _camera_as_json(imaging: ImagingCamera) -> dict[str, Any]:
    return {
        "matrix": imaging.camera.matrix.tolist(),
        "width_px": imaging.width_px,
        "height_px": imaging.height_px,
        "radial": imaging.camera.radial,
        "centre_px": imaging.camera.centre.tolist(),
    }


def _camera_from_json(values: Mapping[str, Any]) -> ImagingCamera:
    camera = Camera(
        np.array(values["matrix"], dtype=np.float64),
        float(values["radial"]),
        np.array(values["centre_px"], dtype=np.float64),
    )
    return ImagingCamera(camera, int(values["width_px"]), int(values["height_px"]))
