"""An expedition of one's own, processed by the real `snakemake` command line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

PROJECT = Path(__file__).parents[2]


def run_snakemake(expedition: Path, *, timeout: float = 400) -> str:
    """`snakemake --cores 2 --snakefile … --directory …` from another folder, without an activated environment.

    Returns what it said; its exit status must be 0.
    """
    command = [str(Path(sys.executable).parent / "snakemake"), "--cores", "2", "--nocolor"]
    where = ["--snakefile", str(PROJECT / "Snakefile"), "--directory", str(expedition)]
    run = subprocess.run(
        command + where,
        cwd="/",
        env={"PATH": "/usr/bin:/bin", "HOME": str(expedition.parent)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=timeout,
        check=False,
    )
    assert run.returncode == 0, run.stdout
    return run.stdout


def qa_of(expedition: Path, scan_id: str) -> dict[str, Any]:
    """The content of a row's qa.json."""
    content: dict[str, Any] = json.loads((expedition / "results" / scan_id / "qa.json").read_text(encoding="utf-8"))
    return content


def verdict_of(expedition: Path, scan_id: str) -> str:
    """``accepted``, or ``rejected:`` and the rules."""
    qa = qa_of(expedition, scan_id)
    return " ".join([qa["verdict"], *sorted({reason["rule"] for reason in qa["reasons"]})])
