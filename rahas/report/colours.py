"""Colours: perceptually even maps, a hatch where nothing was measured, one colour for each snake.

Pictures are (y, x, 3) uint8 in OpenCV's order blue, green, red.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np

PAPER = (243, 248, 251)
INK = (38, 41, 43)
FAINT_INK = (110, 116, 120)
_HATCH_GROUND, _HATCH_LINE = (226, 231, 233), (203, 209, 212)
_HATCH_PERIOD_PX = 8


def _signed_map() -> np.ndarray:
    """Colour table (256, 1, 3): blue below zero, paper at zero, red above; equally dark at both ends."""
    stops = np.array([[96, 36, 8], [196, 130, 66], PAPER, [92, 110, 214], [28, 20, 106]], dtype=np.float64)
    places = np.linspace(0.0, 255.0, len(stops))
    table = [np.interp(np.arange(256), places, stops[:, channel]) for channel in range(3)]
    return np.stack(table, axis=1).round().astype(np.uint8)[:, None, :]


_MAPS = {
    "depth": cv2.COLORMAP_VIRIDIS,
    "order": cv2.COLORMAP_VIRIDIS,
    "cyclic": cv2.COLORMAP_TWILIGHT,
    "strength": cv2.COLORMAP_INFERNO,
    "quality": cv2.COLORMAP_CIVIDIS,
    "signed": _signed_map(),
}


class Scale(NamedTuple):
    """How values become colours.

    Fields
    ------
    low, high
        Values at the two ends of the colour bar; values beyond take the end's colour.
    unit
        Written beside the bar; empty for a pure number.
    colours
        ``depth``, ``order``, ``cyclic``, ``strength``, ``quality`` or ``signed``.
    labels
        What to write at low, middle and high instead of the numbers.
    """

    low: float
    high: float
    unit: str
    colours: str = "depth"
    labels: tuple[str, str, str] | None = None


WHOLE_TURN = Scale(-np.pi, np.pi, "rad", "cyclic", ("−π", "0", "π"))


def scale_of(values: Any, *, unit: str, colours: str = "depth", tail: float = 1.0, low: float | None = None) -> Scale:
    """Scale that leaves out ``tail`` percent of the finite values at each end; a flat field gets a width of its own."""
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    if finite.size == 0:
        return Scale(0.0, 1.0, unit, colours)
    first, last = np.percentile(finite[:: max(1, finite.size // 50_000)], [tail, 100.0 - tail])
    if low is not None:
        first = low
    if not last > first:
        last = first + max(abs(float(first)) * 1e-3, 1e-3)
    return Scale(float(first), float(last), unit, colours)


def coloured(values: Any, scale: Scale) -> np.ndarray:
    """Picture of ``values`` (y, x); NaN and infinities are hatched."""
    values = np.asarray(values, dtype=np.float32)
    measured = np.isfinite(values)
    share = (np.where(measured, values, scale.low) - scale.low) / (scale.high - scale.low)
    levels = np.clip(share * 255.0 + 0.5, 0, 255).astype(np.uint8)
    return on_hatch(cv2.applyColorMap(levels, _MAPS[scale.colours]), measured)


def on_hatch(picture: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """``picture`` (y, x, 3) where ``measured`` (y, x) holds, a neutral diagonal hatch elsewhere."""
    rows, columns = np.arange(measured.shape[0])[:, None], np.arange(measured.shape[1])
    line = (rows + columns) % _HATCH_PERIOD_PX < 2
    hatch = np.where(line[..., None], np.array(_HATCH_LINE, np.uint8), np.array(_HATCH_GROUND, np.uint8))
    return cv2.copyTo(picture, measured.astype(np.uint8), hatch)


def bar_of(scale: Scale, *, width: int, height: int) -> np.ndarray:
    """The colours of a scale from low (left) to high (right), (height, width, 3)."""
    ramp = np.linspace(0, 255, width).round().astype(np.uint8)
    return cv2.applyColorMap(np.repeat(ramp[None], height, axis=0), _MAPS[scale.colours])


def identity_colour(identity: int) -> tuple[int, int, int]:
    """Colour of a snake; neighbours are 137.5° of hue apart, so no two beside each other look alike."""
    hue = round((identity * 137.508) % 360.0 / 2.0) % 180
    blue, green, red = cv2.cvtColor(np.uint8([[[hue, 235, 255]]]), cv2.COLOR_HSV2BGR)[0, 0]
    return int(blue), int(green), int(red)
