"""What a run leaves for others to read holds to its published form."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import xarray

from tests.workflow.expedition import PROJECT, Expedition, Run

SCHEMAS = PROJECT / "docs" / "schemas"
ARRAYS = {
    "frames": {"frames": ("frame", "y", "x"), "time_s": ("frame",), "mean_level": ("frame",)},
    "snakes": {
        **dict.fromkeys(("snake_identity", "snake_y", "snake_value"), ("frame", "snake", "x")),
        "unrotation_deg": ("frame",),
    },
    "phase": {
        **dict.fromkeys(
            (
                *("wrapped_phase", "unwrapped_phase", "fringe_order", "order_confidence"),
                *("background", "modulation", "phase_std", "quality"),
            ),
            ("y", "x"),
        ),
        "phase_step": ("frame",),
    },
    "cloud": {
        **dict.fromkeys(("xyz", "xyz_before_debanding"), ("y", "x", "axis")),
        "z_std": ("y", "x"),
        "rgb": ("y", "x", "channel"),
    },
}


def validate(path: Path, name: str) -> None:
    schema = json.loads((SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(json.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    ("pattern", "schema", "count"),
    [
        ("*/timeline.json", "timeline", 3),
        ("*/qa.json", "qa", 3),
        ("*/calibration.json", "calibration", 1),
        ("*/review/*.json", "review", 4),
    ],
)
def test_json(first_run: tuple[Expedition, Run], pattern: str, schema: str, count: int) -> None:
    found = sorted((first_run[0].root / "results").glob(pattern))
    assert len(found) == count
    for path in found:
        validate(path, schema)


def test_table(first_run: tuple[Expedition, Run]) -> None:
    schema = json.loads((SCHEMAS / "scans.schema.json").read_text(encoding="utf-8"))
    for cells in first_run[0].table().values():
        jsonschema.Draft202012Validator(schema).validate(cells)


@pytest.mark.parametrize("store", ARRAYS)
def test_stores_open_with_xarray(first_run: tuple[Expedition, Run], store: str) -> None:
    with xarray.open_zarr(first_run[0].scan("rock") / f"{store}.zarr") as data:
        assert {name: data[name].dims for name in ARRAYS[store]} == ARRAYS[store]
        for name in data.data_vars:
            assert data[name].attrs["long_name"], name
            assert data[name].attrs["units"], name


def test_phase_is_as_published(first_run: tuple[Expedition, Run]) -> None:
    with xarray.open_zarr(first_run[0].scan("rock") / "phase.zarr", mask_and_scale=False) as data:
        wrapped, unwrapped = data["wrapped_phase"].values, data["unwrapped_phase"].values
        order = data["fringe_order"].values
    seen = np.isfinite(unwrapped)
    assert seen.mean() > 0.3
    assert np.nanmin(wrapped) >= -np.float32(np.pi)
    assert np.nanmax(wrapped) < np.pi
    assert np.abs((unwrapped - wrapped)[seen] / (2 * np.pi) - order[seen]).max() < 1e-3
    assert set(np.unique(order[~seen])) <= {-32768}


def test_frames_are_as_shot(first_run: tuple[Expedition, Run]) -> None:
    import av

    expedition = first_run[0]
    with av.open(str(expedition.root / "captures" / "rock.mkv")) as container:
        shot = np.stack([f.to_ndarray()[: f.height] for f in container.decode(video=0)])
    with xarray.open_zarr(expedition.scan("rock") / "frames.zarr") as data:
        np.testing.assert_array_equal(data["frames"].values, shot)


def test_every_artifact_has_its_record(first_run: tuple[Expedition, Run]) -> None:
    """All that lies under results/ is an output of some record (records, kept ones and stamps apart)."""
    results = first_run[0].root / "results"
    spoken_for: set[Path] = set()
    for record in (path for path in results.glob("*/provenance/*.json") if not path.name.endswith(".made.json")):
        content = json.loads(record.read_text(encoding="utf-8"))
        base = results if record.parents[1].name == "expedition" else record.parents[1]
        spoken_for |= {base / name for name in content["outputs"]}
    for path in results.rglob("*"):
        if path.is_file() and path.parent.name not in ("provenance", "code", "history"):
            assert spoken_for & {path, *path.parents}, path


def test_pages_stand_alone(first_run: tuple[Expedition, Run]) -> None:
    """No page asks for anything from a network."""
    results = first_run[0].root / "results"
    pages = [results / "index.html", *results.glob("*/report.html")]
    assert len(pages) == 4
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert 'src="http' not in text
        assert 'href="http' not in text
        assert "//" not in "".join(part.split('"')[0] for part in text.split('src="')[1:])
