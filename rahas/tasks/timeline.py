"""frames.zarr → timeline.json."""

from __future__ import annotations

import numpy as np

from rahas.params import TimelineParams
from rahas.stages.timeline import find_timeline
from rahas.stores.arrays import open_store
from rahas.stores.atomic import write_json
from rahas.stores.layout import ScanFolder
from rahas.typing import FloatArray


def run(scan: ScanFolder, *, params: TimelineParams) -> None:
    """Find the stages of a capture."""
    store = open_store(scan.frames)
    frame_rate = float(store.attrs["frame_rate"])
    timeline = find_timeline(
        store["thumbnail"],
        time_s=store["time_s"][...],
        change=store["change"][...],
        frame_rate=frame_rate,
        thumbnail_scale=1.0 / float(store["thumbnail"].attrs["scale"]),
        params=params,
    )
    write_json(
        scan.timeline,
        {
            "scan_id": scan.scan_id,
            "frames": int(store["frames"].shape[0]),
            "frame_rate": frame_rate,
            "intervals": [interval._asdict() for interval in timeline.intervals],
            "duplicates": timeline.duplicates,
            "dropped": [gap._asdict() for gap in timeline.dropped],
            "rotation_sense": timeline.rotation_sense,
            "slide_angle_deg": _nullable(timeline.slide_angle_deg, decimals=4),
            "phase_step_rad": _nullable(timeline.phase_step_rad, decimals=6),
            "periods": round(timeline.periods, 4),
        },
    )


def _nullable(values: FloatArray, *, decimals: int) -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), decimals) for value in values]
