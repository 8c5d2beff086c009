"""The companion of a record: when, where and how long, and the operator's notes; what must not decide anything.

A record is the same wherever and whenever the work is done; its companion ``<stage>.made.json`` is not. It is written
after the record and read by nobody but people and the audit. A missing companion is no fault.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rahas.provenance.commit import commit_of
from rahas.provenance.records import Record
from rahas.stores.atomic import read_json, write_text
from rahas.stores.digests import digest_of_json

SUFFIX = ".made.json"
SCHEMA = 1
# How a scheduler names the job in its environment.
_JOB_VARIABLES = (
    *("SLURM_JOB_ID", "SLURM_ARRAY_JOB_ID", "SLURM_ARRAY_TASK_ID", "SLURM_CLUSTER_NAME", "SLURMD_NODENAME"),
    *("SNAKEMAKE_JOBID", "SNAKEMAKE_RULE"),
)


class Clock:
    """Started before the work, asked after it."""

    def __init__(self) -> None:
        self.began = datetime.now(UTC)
        self._started = time.perf_counter()

    @property
    def seconds(self) -> float:
        """Since the start."""
        return time.perf_counter() - self._started


def companion_path(record_path: Path) -> Path:
    """Where the companion of a record lies."""
    return record_path.with_name(record_path.stem + SUFFIX)


def write_companion(
    record_path: Path, record: Record, clock: Clock, *, notes: str = "", files: Mapping[str, str] | None = None
) -> None:
    """Write the companion of the record that has just been written.

    ``files`` are the raw files that were read, by the name of the input, from the expedition's folder.
    """
    commit, machine = commit_of(), os.uname()
    content = {
        "stage": record.recipe.stage,
        "record": _work_of(record),
        "began": clock.began.isoformat(timespec="seconds"),
        "seconds": round(clock.seconds, 3),
        "host": machine.nodename,
        "platform": f"{machine.sysname} {machine.release} {machine.machine}",
        "python": ".".join(map(str, sys.version_info[:3])),
        "commit": commit.name,
        "tree_clean": commit.clean,
        "job": {name: os.environ[name] for name in _JOB_VARIABLES if name in os.environ},
        "notes": notes,
        "files": dict(files or {}),
        # of the process so far, which may have made other stages before this one
        "peak_memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _RSS_PER_MB),
        "schema": SCHEMA,
    }
    write_text(companion_path(record_path), _text({**content, "seal": digest_of_json(content)}))


def read_companion(record_path: Path, record: Record | None) -> dict[str, Any] | None:
    """The companion of this very record; None where there is none, or one of a former record."""
    try:
        content = read_json(companion_path(record_path))
    except (OSError, ValueError):
        return None
    fits = isinstance(content, dict) and record is not None and content.get("record") == _work_of(record)
    return content if fits else None


def is_sound(path: Path) -> bool:
    """Whether a companion's file is as it was written."""
    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text)
        return text == _text(content) and content.pop("seal") == digest_of_json(content)
    except (OSError, ValueError, KeyError, AttributeError, TypeError):
        return False


def _work_of(record: Record) -> str:
    """Digest of what was done: the same for a record and for what it becomes when its artifacts are withdrawn."""
    return digest_of_json([record.recipe.key, record.outputs, record.reason])


def _text(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


_RSS_PER_MB = 1_000_000 if sys.platform == "darwin" else 1000  # bytes there, kB elsewhere
