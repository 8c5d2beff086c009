"""frames.zarr and timeline.json → snakes.zarr."""

from __future__ import annotations

import cv2
import numpy as np

from rahas.params import SnakesParams
from rahas.stages import snakes
from rahas.stores.arrays import open_store, writing_store
from rahas.stores.atomic import read_json
from rahas.stores.layout import ScanFolder

_DIMS = ("frame", "snake", "x")


def run(scan: ScanFolder, *, params: SnakesParams) -> None:
    """Follow the stripes through a capture; blocks of frames are written as they are tracked."""
    cv2.setNumThreads(1)
    store, timeline = open_store(scan.frames), read_json(scan.timeline)
    frames = store["frames"]
    course = snakes.snake_timeline(timeline["intervals"], timeline["slide_angle_deg"], timeline["rotation_sense"])
    tracking = snakes.track(frames, course, params, field_order=str(store.attrs["field_order"]))
    shape = (frames.shape[0], tracking.snakes, frames.shape[2])
    chunks = (tracking.block_frames, *shape[1:])
    attributes = {"stripes_seen": tracking.stripes_seen, "pitch_px": tracking.pitch_px}
    with writing_store(scan.snakes, **attributes) as out:
        identity = out.create(
            "snake_identity", _DIMS, shape, np.int16, chunks=chunks,
            long_name="stripe of the snake, 1 is the topmost of the first hold, 0 blank", units="1",
        )  # fmt: skip
        y = out.create(
            "snake_y", _DIMS, shape, np.float32, chunks=chunks, fill_value=np.nan,
            long_name="row of the stripe's maximum on the un-rotated canvas", units="px",
        )  # fmt: skip
        value = out.create(
            "snake_value", _DIMS, shape, np.float32, chunks=chunks, fill_value=np.nan,
            long_name="balanced, smoothed luma at the stripe's maximum", units="grey level",
        )  # fmt: skip
        for block in tracking.blocks:
            span = slice(block.first_frame, block.first_frame + len(block.y))
            identity[span], y[span], value[span] = block.identity, block.y, block.value
        out.put("unrotation_deg", ("frame",), tracking.unrotation_deg, long_name="turn of the canvas", units="degree")
        out.put(
            "first_positions_px", ("snake",), tracking.first_positions_px,
            long_name="row of each snake at the canvas's middle column in the first hold", units="px",
        )  # fmt: skip
