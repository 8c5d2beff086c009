"""`rahas new` makes a folder that is ready to fill."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from tests.workflow.expedition import Expedition, minimal_environment


def new(folder: Path, code: Path) -> subprocess.CompletedProcess[str]:
    environment = minimal_environment(folder.parent) | {"PYTHONPATH": str(code)}
    command = [sys.executable, "-P", "-m", "rahas.cli", "new", str(folder)]
    return subprocess.run(command, cwd="/", env=environment, text=True, capture_output=True, check=False)


def test_new_folder_is_ready_to_fill(first_run: tuple[Expedition, object], tmp_path: Path) -> None:
    brought = first_run[0]
    folder = tmp_path / "río plátano 'two'"
    made = new(folder, brought.code)
    assert made.returncode == 0, made.stderr
    assert str(brought.code / "Snakefile") in made.stdout
    mine = Expedition(folder, brought.code)

    empty = mine.run()
    assert empty.status == 0, empty.output
    assert "field_log.csv has no row yet" in empty.output
    assert "Traceback" not in empty.output

    shutil.copy2(brought.root / "captures" / "far.mkv", folder / "captures" / "stone.mkv")
    with open(folder / "field_log.csv", "a", encoding="utf-8") as log:
        log.write("stone,Los Metates,,,,,,,,,,,tiny\n")
    run = mine.run()
    assert run.status == 0, run.output
    assert mine.verdict("stone") == "rejected: object_span"


def test_nothing_is_overwritten(rendered: Expedition, expedition: Expedition) -> None:
    before = expedition.digests(".")
    refused = new(expedition.root, rendered.code)
    assert refused.returncode != 0
    assert "field_log.csv already" in refused.stderr
    assert expedition.digests(".") == before
