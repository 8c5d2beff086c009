"""Which pictures a scan's page shows, from whatever the scan has come to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rahas.report.colours import WHOLE_TURN, coloured, on_hatch, scale_of
from rahas.report.figures import Figure, Levels, field_figure, first_field, fitted, grey_picture, levels_of, stride_of
from rahas.report.overlays import arrow_magnification, with_marks, with_snakes
from rahas.report.relief import relief_picture, shaded_colours
from rahas.report.words import number

THUMBNAIL = "thumbnail.jpg"
_THUMBNAIL_PX = 360
_ROTATION_PARTS = ((0.15, "early"), (0.5, "middle"), (0.85, "late"))


@dataclass(frozen=True)
class Evidence:
    """The artifacts of one scan that exist: opened stores (named arrays with ``attrs``) and parsed JSON, else None."""

    frames: Any = None
    timeline: Mapping[str, Any] | None = None
    snakes: Any = None
    phase: Any = None
    calibration: Mapping[str, Any] | None = None
    cloud: Any = None


class Moment(NamedTuple):
    """A frame worth showing and the part of the capture that it stands for."""

    frame: int
    part: str


class Pictured(NamedTuple):
    """Frames read once and shown alike: pictures by frame number."""

    moments: list[Moment]
    pictures: dict[int, np.ndarray]


def moments_of(timeline: Mapping[str, Any] | None, frames: int) -> list[Moment]:
    """A frame of each part: hold, rotation early, middle and late, reference hold, scan; without a timeline, five."""
    if not timeline or not timeline.get("intervals"):
        last = max(frames - 1, 0)
        return [Moment(n, "") for n in sorted({round(last * k / 4) for k in range(5)})] if frames else []
    moments, holds = [], 0
    for interval in timeline["intervals"]:
        first, last, stage = interval["first"], interval["last"], interval["stage"]
        if stage == "rotation":
            moments += [
                Moment(round(first + part * (last - first)), f"rotation, {word}") for part, word in _ROTATION_PARTS
            ]
        elif stage == "scan":
            moments.append(Moment((first + last) // 2, "scan"))
        elif stage == "hold":
            holds += 1
            name = {1: "first hold", 2: "reference hold", 3: "last hold"}.get(holds, "hold")
            moments.append(Moment((first + last) // 2, name))
    return [moment for moment in moments if 0 <= moment.frame < frames]


def pictured_of(evidence: Evidence) -> Pictured:
    """The moments of a capture, read from the frame store and brought to common grey levels."""
    if evidence.frames is None:
        return Pictured([], {})
    stack, order = evidence.frames["frames"], str(evidence.frames.attrs.get("field_order", "progressive"))
    moments = moments_of(evidence.timeline, stack.shape[0])
    fields = {moment.frame: first_field(stack[moment.frame], order) for moment in moments}
    levels = levels_of(fields.values()) if fields else Levels(0.0, 255.0)
    return Pictured(moments, {frame: grey_picture(field, levels) for frame, field in fields.items()})


def frame_figures(pictured: Pictured) -> list[Figure]:
    """The strip of small frames, lettered as on the timeline."""
    figures = []
    for k, (frame, part) in enumerate(pictured.moments):
        letter = chr(ord("a") + k)
        small = fitted(pictured.pictures[frame], width=_THUMBNAIL_PX, height=_THUMBNAIL_PX)
        figures.append(Figure(f"frame_{letter}.jpg", small, f"{letter} · {part}" if part else letter, f"frame {frame}"))
    return figures


def snake_figures(evidence: Evidence, pictured: Pictured) -> list[Figure]:
    """Snakes over the first hold, the middle of the rotation and the reference hold, on the un-rotated canvas."""
    if evidence.snakes is None:
        return []
    wanted = {"first hold": "first_hold", "rotation, middle": "mid_rotation", "reference hold": "reference_hold"}
    figures = []
    for frame, part in pictured.moments:
        if part not in wanted or frame >= evidence.snakes["snake_identity"].shape[0]:
            continue
        turn = float(evidence.snakes["unrotation_deg"][frame])
        identity, rows = evidence.snakes["snake_identity"][frame], evidence.snakes["snake_y"][frame]
        turn = turn if np.isfinite(turn) else 0.0
        drawn = with_snakes(pictured.pictures[frame], identity, rows, unrotation_deg=turn)
        followed = int(np.unique(identity[identity > 0]).size)
        caption = f"frame {frame}, turned by {number(turn, span=100.0)}°; {followed} stripes followed"
        figures.append(Figure(f"snakes_{wanted[part]}.jpg", fitted(drawn), part, caption))
    return figures


def phase_figures(evidence: Evidence) -> list[Figure]:
    """Wrapped and unwrapped phase, quality, modulation."""
    phase = evidence.phase
    if phase is None:
        return []
    wrapped, turns = phase["wrapped_phase"][...], phase["unwrapped_phase"][...] / (2.0 * np.pi)
    stripes = scale_of(turns, unit="stripes", colours="order")
    figures = [
        field_figure("wrapped_phase.png", wrapped, WHOLE_TURN, "wrapped phase", "φ, zero on the stripes' crests"),
        field_figure("unwrapped_phase.png", turns, stripes, "unwrapped phase", "Φ / 2π, same zero as its calibration"),
    ]
    for name, colours in (("quality", "quality"), ("modulation", "strength")):
        if name in phase:
            values, unit = phase[name][...], str(phase[name].attrs.get("units", ""))
            scale = scale_of(values, unit=unit.removeprefix("1"), colours=colours, low=0.0)
            figures.append(field_figure(f"{name}.jpg", values, scale, name))
    return figures


def cloud_figures(evidence: Evidence) -> list[Figure]:
    """Depth, relief, colour and uncertainty of the surface."""
    cloud = evidence.cloud
    if cloud is None:
        return []
    step = stride_of(cloud["xyz"].shape[1])
    xyz = cloud["xyz"][::step, ::step]
    depth = xyz[..., 2]
    measured = f"z towards the camera; {100 * float(np.isfinite(depth).mean()):.0f} % of the image measured"
    shaded = "shaded from the normals, light from the upper left, slopes exaggerated"
    figures = [
        field_figure("depth.png", depth, scale_of(depth, unit="mm"), "depth", measured),
        Figure("relief.jpg", fitted(relief_picture(xyz)), "relief", shaded),
    ]
    if "rgb" in cloud:
        colour = np.ascontiguousarray(cloud["rgb"][::step, ::step][..., ::-1])
        colour = on_hatch(colour, np.isfinite(depth))
        figures.append(Figure("colour.jpg", fitted(colour), "colour", "on the camera's grid"))
    if "z_std" in cloud:
        spread = cloud["z_std"][...]
        scale = scale_of(spread, unit="mm", colours="strength", low=0.0)
        caption = "one standard deviation of the height"
        figures.append(field_figure("z_std.jpg", spread, scale, "uncertainty", caption))
    return figures


def calibration_figures(evidence: Evidence, pictured: Pictured) -> list[Figure]:
    """The marks that were found, over the background, with their residuals."""
    marks = (evidence.calibration or {}).get("marks") or []
    if not marks:
        return []
    if evidence.phase is not None and "background" in evidence.phase:
        ground = evidence.phase["background"][...]
        finite = np.isfinite(ground)
        ground = np.where(finite, ground, 0.0)
        picture = grey_picture(ground, levels_of([ground[finite][None]]) if finite.any() else Levels(0.0, 255.0))
    elif pictured.pictures:
        picture = next(iter(pictured.pictures.values()))
    else:
        return []
    small = fitted(picture)
    times = arrow_magnification(marks)
    caption = f"{len(marks)} marks" + (f"; arrows: measured minus modelled, × {times}" if times else "")
    drawn = with_marks(small, marks, scale=small.shape[1] / picture.shape[1])
    return [Figure("marks.jpg", drawn, "marks of the target", caption)]


def thumbnail(evidence: Evidence, pictured: Pictured) -> Figure | None:
    """What stands for the scan in the index: its depth under light, else a frame."""
    if evidence.cloud is not None:
        step = max(1, evidence.cloud["xyz"].shape[1] // _THUMBNAIL_PX)
        xyz = evidence.cloud["xyz"][::step, ::step]
        lit = shaded_colours(coloured(xyz[..., 2], scale_of(xyz[..., 2], unit="mm")), xyz)
        return Figure(THUMBNAIL, fitted(lit, width=_THUMBNAIL_PX, height=_THUMBNAIL_PX), "depth under light")
    if not pictured.moments:
        return None
    frame = max(pictured.moments, key=lambda moment: moment.part == "reference hold").frame
    return Figure(
        THUMBNAIL, fitted(pictured.pictures[frame], width=_THUMBNAIL_PX, height=_THUMBNAIL_PX), f"frame {frame}"
    )
