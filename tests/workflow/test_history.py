"""What runs leave in results/history/, and what `rahas diff` tells of them."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import numpy as np
import xarray

from tests.workflow.expedition import NOTHING, PROJECT, Expedition, minimal_environment


def history(expedition: Expedition) -> list[str]:
    return sorted(path.name for path in (expedition.root / "results" / "history").glob("*.gz"))


def diff(expedition: Expedition, *arguments: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-m", "rahas.cli", "diff", *arguments, "--json"],
        cwd=expedition.root,
        env=minimal_environment(expedition.root.parent) | {"PYTHONPATH": str(PROJECT)},
        capture_output=True,
        text=True,
        check=False,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    assert done.returncode == int(found["differs"]), done.stderr
    return found


def test_each_run_that_changes_something_is_kept(finished: Expedition) -> None:
    """A run that changes nothing keeps none; a former number is named; the change is told in words, and back."""
    assert history(finished) == ["0001.json.gz"]
    assert NOTHING in finished.run().output
    (finished.root / "results" / "index.html").unlink()
    assert finished.run().status == 0
    assert history(finished) == ["0001.json.gz"], "the index alone is no change"
    points = finished.qa("rock")["metrics"]["points"]

    with xarray.open_zarr(finished.scan("rock") / "phase.zarr") as phase:
        limit = float(np.nanpercentile(phase["phase_std"].values, 80))
    finished.configure(f"cloud:\n  max_phase_std_rad: {limit}\n")
    assert finished.run().status == 0
    assert history(finished) == ["0001.json.gz", "0002.json.gz"]
    assert NOTHING in finished.run().output
    found = diff(finished, "0001", "latest")
    scans = {scan["scan_id"]: scan for scan in found["scans"]}
    assert [name for name, scan in scans.items() if scan["differs"]] == ["rock"]
    assert scans["rock"]["metrics"]["points"] == [points, finished.qa("rock")["metrics"]["points"]]
    assert points > scans["rock"]["metrics"]["points"][1] > 0
    assert {"cloud.ply", "cloud.zarr", "qa.json"} <= scans["rock"]["artifacts"].keys()
    assert "phase.zarr" not in scans["rock"]["artifacts"]
    assert [(why["stage"], why["scans"]) for why in found["why"]] == [("cloud", ["rock"])]
    assert "max_phase_std_rad" in found["why"][0]["text"]

    finished.configure("")
    assert finished.run().status == 0
    assert not diff(finished, "1", "latest")["differs"]
    assert not diff(finished, "latest", ".")["differs"]
    assert diff(finished, "-1", ".")["differs"]
