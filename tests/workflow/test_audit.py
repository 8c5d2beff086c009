"""The audit of an expedition that Snakemake has really processed: clean, also in a clone; a flipped bit is found."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.workflow.expedition import Expedition, Run, minimal_environment


def audit(expedition: Expedition, *arguments: str) -> Run:
    """`rahas audit`, by the code that processed the expedition."""
    environment = minimal_environment(expedition.root.parent) | {"PYTHONPATH": os.fspath(expedition.code)}
    done = subprocess.run(
        [sys.executable, "-P", "-m", "rahas.cli", "audit", *arguments],
        cwd=expedition.root, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    return Run(done.returncode, done.stdout)


def test_clean_after_a_run_and_in_a_fresh_clone(finished: Expedition, tmp_path: Path) -> None:
    done = audit(finished)
    assert done.status == 0, done.output
    assert done.output.startswith("3 scans, ")
    no_snakemake = shutil.ignore_patterns(".snakemake")
    shutil.copytree(finished.root, tmp_path / "clone", copy_function=shutil.copyfile, ignore=no_snakemake)
    clone = Expedition(tmp_path / "clone", finished.code)
    assert (again := audit(clone)).output == done.output
    assert again.status == 0


def test_flipped_bit_of_every_store_is_found(finished: Expedition) -> None:
    flipped = set()
    for store in sorted((finished.root / "results").glob("*/*.zarr")):
        chunk = max((p for p in store.rglob("*") if p.is_file()), key=lambda p: p.stat().st_size)
        content = bytearray(chunk.read_bytes())
        content[len(content) // 2] ^= 1
        chunk.write_bytes(content)
        flipped.add((str(store.relative_to(finished.root)), str(chunk.relative_to(store))))
    assert len(flipped) >= 8
    done = audit(finished, "--json")
    assert done.status == 1
    found = {(finding["artifact"], finding["part"]) for finding in json.loads(done.output)["findings"]}
    assert found == flipped
