"""frames.zarr, timeline.json and snakes.zarr → phase.zarr."""

from __future__ import annotations

from typing import Any

import numpy as np

from rahas.kernels.exposure import sensor_limits
from rahas.kernels.interlacing import fields
from rahas.kernels.label_anchor import Anchor
from rahas.params import PhaseParams
from rahas.stages import phase
from rahas.stages.anchor import anchor_labels
from rahas.stages.rotation_frames import rotation_of_timeline
from rahas.stores.arrays import open_store, writing_store
from rahas.stores.atomic import read_json
from rahas.stores.layout import ScanFolder
from rahas.stores.timeline import Intervals

MAPS: dict[str, dict[str, Any]] = {
    "wrapped_phase": {"long_name": "wrapped phase at the reference slide position", "units": "rad"},
    "unwrapped_phase": {"long_name": "unwrapped phase at the reference slide position", "units": "rad"},
    "fringe_order": {"long_name": "fringe order, (unwrapped - wrapped)/2π", "units": "1"},
    "order_confidence": {"long_name": "agreement of wrapped and coarse phase", "units": "1"},
    "background": {"long_name": "stripe-free image a", "units": "grey level"},
    "modulation": {"long_name": "stripe amplitude b", "units": "grey level"},
    "phase_std": {"long_name": "standard deviation of the phase", "units": "rad"},
    "chi2": {"long_name": "squared residual over that of pixels of like brightness", "units": "1"},
    "quality": {"long_name": "quality Q of the thesis, eq. 3.19", "units": "grey level"},
}


def run(scan: ScanFolder, *, calibration: ScanFolder | None, params: PhaseParams) -> None:
    """Solve the phase of a scan; its labels share the zero of its calibration's (``None``: it is one itself)."""
    frames, snakes = open_store(scan.frames), open_store(scan.snakes)
    course = read_json(scan.timeline)
    timeline = Intervals(course)
    held, last = timeline.held_frames, timeline.scan["last"]
    first = held.start
    anchor = _anchor(scan, calibration, params)
    result = phase.solve(
        frames["frames"],
        first=first,
        last=last,
        held=len(held),
        fields=fields(frames.attrs["interlaced"], frames.attrs["field_order"]),
        snakes=phase.ScanSnakes(snakes["snake_identity"], snakes["snake_y"]),
        first_order=anchor.order,
        params=params,
        rotation=rotation_of_timeline(course),
        top_level=_top_level(frames, first, last),
    )
    steps = np.full(frames["frames"].shape[0], np.nan)
    moving = slice(timeline.scan["first"], first + len(result.steps))
    steps[moving] = result.steps[timeline.scan["first"] - first :]
    attributes = {
        "method": params.method,
        "reference_frame": first,
        "order_of_first_snake": anchor.order,
        "label_anchor_residual_stripes": anchor.residual_stripes,
        "rotation_code_confident_share": result.labelled.confident_share,
        "rotation_code_disagreement": result.labelled.disagreement,
        "compression_cost": result.compression_cost,
    }
    with writing_store(scan.phase, **attributes) as store:
        for name, about in MAPS.items():
            store.put(name, ("y", "x"), getattr(result, name), **about)
        store.put("phase_step", ("frame",), steps, long_name="phase step at the field's centre", units="rad")


def _top_level(frames: Any, first: int, last: int) -> float:
    """Grey level of a frame from which on the sensor is saturated, a codec's ringing allowed for."""
    samples = np.stack([frames["frames"][n] for n in np.linspace(first, last, 4).astype(int)])
    depth = int(frames.attrs["bit_depth"])
    limits = sensor_limits(samples, bit_depth=depth, luma_range=str(frames.attrs.get("luma_range", "unknown")))
    return limits.top - 2.0 ** (depth - 8)


def _anchor(scan: ScanFolder, calibration: ScanFolder | None, params: PhaseParams) -> Anchor:
    if calibration is None:
        return anchor_labels(None, None, params)
    own, theirs = open_store(scan.snakes), open_store(calibration.snakes)
    return anchor_labels(own["first_positions_px"][:], theirs["first_positions_px"][:], params)
