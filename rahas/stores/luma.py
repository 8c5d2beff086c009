"""The luma of a decoded video frame, as shot: the plane itself, no range stretched, no bit lost."""

from __future__ import annotations

import av
import cv2
import numpy as np

from rahas.typing import AnyArray

_PACKED_LUMA = {"yuyv422": 0, "yvyu422": 0, "uyvy422": 1}  # offset of the luma byte; a sample every second byte
_PACKED_WORDS = ("y210", "y212", "y216")  # a luma sample every second word, in its upper bits
_PLANAR = {8: "yuv444p", 10: "yuv444p10le", 12: "yuv444p12le", 16: "yuv444p16le"}
_HIGH_BITS = ("p010", "p012", "p210", "p212", "p410", "p412")  # samples stand in the upper bits of 16


def bit_depth_of(frame: av.VideoFrame) -> int:
    """Significant bits of a luma sample, 8 at least."""
    return max(8, int(frame.format.components[0].bits))


def luma_of(frame: av.VideoFrame) -> AnyArray:
    """Luma (y, x), uint8 or uint16, valid as long as the frame lives; colour-only formats are weighted (BT.601)."""
    name = frame.format.name
    if name in _PACKED_LUMA:
        packed = _rows_of(frame, np.uint8)
        return packed[:, _PACKED_LUMA[name] : 2 * frame.width : 2]
    if name[:4] in _PACKED_WORDS:
        words = _rows_of(frame, _order_of(name))
        return words[:, : 2 * frame.width : 2] >> (16 - bit_depth_of(frame))
    if frame.format.is_rgb or name in ("pal8", "monob", "monow") or name.startswith(("bayer", "xyz")):
        deep = bit_depth_of(frame) > 8
        colour = frame.to_ndarray(format="rgb48le" if deep else "rgb24")
        return cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY) >> (16 - bit_depth_of(frame) if deep else 0)
    if len(frame.format.components) >= 3 and all(part.plane == 0 for part in frame.format.components):
        # further packed formats (vuya, xv30, …): taken apart; from YUV to YUV the codes of the luma stay
        frame = frame.reformat(format=_PLANAR[bit_depth_of(frame)])
        name = frame.format.name
    if bit_depth_of(frame) == 8:
        return _rows_of(frame, np.uint8)[:, : frame.width]
    samples = _rows_of(frame, _order_of(name))[:, : frame.width]
    return samples >> (16 - bit_depth_of(frame)) if name.startswith(_HIGH_BITS) else samples


def _order_of(name: str) -> np.dtype[np.uint16]:
    """Words of a format of more than 8 bits."""
    return np.dtype(">u2" if name.endswith("be") else "<u2")


def upright(luma: AnyArray, rotation_deg: float) -> AnyArray:
    """Turn by the display rotation (counter-clockwise, multiples of 90°), so that the picture stands as it was seen."""
    return np.rot90(luma, round(rotation_deg / 90.0) % 4)


def _rows_of(frame: av.VideoFrame, dtype: np.dtype[np.generic] | type[np.generic]) -> AnyArray:
    plane = frame.planes[0]
    samples = np.frombuffer(plane, dtype)
    return samples.reshape(-1, plane.line_size // np.dtype(dtype).itemsize)[: frame.height]
