"""Figures: a field with its colour bar, a frame as a picture; at most 720 px wide, made with cv2 alone."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import cv2
import numpy as np

from rahas.kernels.interlacing import first_field_full_height
from rahas.report.colours import INK, PAPER, Scale, bar_of, coloured
from rahas.report.words import number

MAX_WIDTH_PX = 720
MAX_HEIGHT_PX = 960
_BAR_PX, _MARGIN_PX, _TEXT_PX = 16, 10, 20


class Figure(NamedTuple):
    """One picture of a page.

    Fields
    ------
    name
        File name below ``figures/``; its ending chooses JPEG (photographs) or PNG (colour maps).
    image
        (y, x, 3) uint8; blue, green, red.
    title, caption
        Plain text; the page escapes it.
    """

    name: str
    image: np.ndarray
    title: str
    caption: str = ""


class Levels(NamedTuple):
    """Grey levels shown as black and as white, the same for all frames of a page."""

    black: float
    white: float


def levels_of(frames: Any) -> Levels:
    """Levels from some frames: a little below the darkest, a little above the brightest percent."""
    sample = np.concatenate([np.asarray(frame)[::4, ::4].ravel() for frame in frames]).astype(np.float32)
    black, white = np.percentile(sample, [1.0, 99.7])
    return Levels(float(black), float(max(white, black + 16.0)))


def grey_picture(frame: Any, levels: Levels) -> np.ndarray:
    """A frame (y, x) of any depth as a picture, dark parts lifted a little so that paper shows them."""
    share = np.clip((np.asarray(frame, dtype=np.float32) - levels.black) / (levels.white - levels.black), 0.0, 1.0)
    grey = (np.sqrt(share) * 0.4 + share * 0.6) * 255.0
    return cv2.cvtColor(grey.round().astype(np.uint8), cv2.COLOR_GRAY2BGR)


def first_field(frame: Any, field_order: str) -> np.ndarray:
    """The moment that a frame (y, x) shows first: itself, or its first field brought to full height."""
    frame = np.asarray(frame)
    return frame if field_order == "progressive" else first_field_full_height(frame[None], field_order)[0]


def fitted(picture: np.ndarray, *, width: int = MAX_WIDTH_PX, height: int = MAX_HEIGHT_PX) -> np.ndarray:
    """The picture made smaller, if need be, to fit ``width`` × ``height``."""
    factor = min(width / picture.shape[1], height / picture.shape[0], 1.0)
    if factor == 1.0:
        return picture
    size = (max(1, round(picture.shape[1] * factor)), max(1, round(picture.shape[0] * factor)))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def stride_of(width: int) -> int:
    """Every how many pixels a field is shown: fields far wider than a figure are thinned out before colouring."""
    return max(1, width // MAX_WIDTH_PX)


def field_figure(name: str, values: Any, scale: Scale, title: str, caption: str = "") -> Figure:
    """A field (y, x) in colour with its colour bar below; NaN hatched."""
    step = stride_of(np.shape(values)[1])
    values = np.asarray(values)[::step, ::step]
    return Figure(name, with_bar(fitted(coloured(values, scale)), scale), title, caption)


def with_bar(picture: np.ndarray, scale: Scale) -> np.ndarray:
    """``picture`` with the colour bar of ``scale`` below it: low, middle and high in the scale's unit."""
    width = picture.shape[1]
    strip = np.full((_MARGIN_PX + _BAR_PX + _TEXT_PX + 12, width, 3), PAPER, np.uint8)
    strip[_MARGIN_PX : _MARGIN_PX + _BAR_PX] = bar_of(scale, width=width, height=_BAR_PX)
    baseline = _MARGIN_PX + _BAR_PX + _TEXT_PX + 4
    ends = (scale.low, 0.5 * (scale.low + scale.high), scale.high)
    low, middle, high = scale.labels or [number(value, span=scale.high - scale.low) for value in ends]
    write(strip, low, (0, baseline), align="left")
    write(strip, f"{middle} {scale.unit}".rstrip(), (width // 2, baseline), align="centre")
    write(strip, high, (width - 1, baseline), align="right")
    strip[_MARGIN_PX + _BAR_PX : _MARGIN_PX + _BAR_PX + 5, [0, width // 2, width - 1]] = INK
    return np.vstack([picture, strip])


def write(
    picture: np.ndarray,
    text: str,
    at: tuple[int, int],
    *,
    align: str = "left",
    size: int = _TEXT_PX,
    weight: int = 400,
    colour: tuple[int, int, int] = INK,
) -> None:
    """Write ``text`` into ``picture``; ``at`` is the baseline's left end, middle or right end."""
    font = _font()
    (left, _, wide, _) = cv2.getTextSize((picture.shape[1], picture.shape[0]), text, (0, 0), font, size, weight)
    shift = {"left": 0, "centre": wide // 2, "right": wide + left}[align]
    cv2.putText(picture, text, (at[0] - shift, at[1]), colour, font, size, weight)


@cache
def _font() -> Any:
    return cv2.FontFace("sans")
