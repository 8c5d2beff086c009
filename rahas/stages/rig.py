"""The calibrated rig: camera, projector, texture camera and their covariance, and its form in calibration.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rahas.kernels.camera import Camera
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
    """(19, 19) of the camera's m1…m11 and k1, then the projector's m5…m11."""

    @property
    def parameters(self) -> FloatArray:
        """(19,) in the order of the covariance."""
        camera = self.camera.camera
        return np.concatenate([camera.matrix.ravel()[:11], [camera.radial], self.projector.ravel()[:7]])


PARAMETER_NAMES = (
    *(f"camera_m{i}" for i in range(1, 12)),
    "camera_radial",
    *(f"projector_m{i}" for i in range(5, 12)),
)


def rig_as_json(rig: Rig) -> dict[str, Any]:
    """The keys ``camera``, ``projector``, ``texture_camera`` and ``covariance`` of calibration.json."""
    return {
        "camera": _camera_as_json(rig.camera),
        "projector": {"matrix": rig.projector.tolist()},
        "texture_camera": None if rig.texture_camera is None else _camera_as_json(rig.texture_camera),
        "covariance": {"parameters": list(PARAMETER_NAMES), "matrix": rig.covariance.tolist()},
    }


def rig_from_json(calibration: Mapping[str, Any]) -> Rig:
    """The rig of a calibration.json."""
    texture = calibration["texture_camera"]
    return Rig(
        _camera_from_json(calibration["camera"]),
        np.array(calibration["projector"]["matrix"], dtype=np.float64),
        None if texture is None else _camera_from_json(texture),
        np.array(calibration["covariance"]["matrix"], dtype=np.float64),
    )


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
