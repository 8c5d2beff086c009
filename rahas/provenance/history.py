"""results/history/: what the records of every row said after each run that changed something; no data, no clock.

A run is one file, ``0003.json.gz``: verdict, metrics and reasons of each row, and its records, from which every former
recipe can be read again. What many rows have in common (parameters, code, libraries) stands there once. A run's
content is the same wherever and whenever it was made; ``0003.made.json`` says when, where and from which commit.
"""

from __future__ import annotations

import gzip
import json
import platform
import re
import zlib
from collections.abc import Collection, Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from rahas.provenance.commit import commit_of
from rahas.provenance.companions import SUFFIX
from rahas.provenance.states import RowState, raw_records, recorded_state
from rahas.stores.atomic import read_json, read_json_or_none, replacing, sweep, write_json
from rahas.stores.digests import canonical_json, digest_of_json
from rahas.stores.layout import ScanFolder
from rahas.stores.locks import only_writer

HISTORY = "history"
SCHEMA = 1
_RUN = re.compile(r"(\d{4,})\.json\.gz")
_OF_THE_ROW = ("inputs", "columns")  # what a recipe does not share with other rows
_COMMON = ("rahas", "schema")  # what a record shares with others beside its recipe
_DERIVED = ("key", "seal")


class Run(NamedTuple):
    """A run that was kept."""

    number: int
    path: Path

    @property
    def made(self) -> Mapping[str, Any]:
        """When, where and from which commit it was kept; empty where that was lost."""
        companion = _companion(self.path)
        return read_json(companion) if companion.is_file() else {}


def runs(results: Path) -> list[Run]:
    """The runs kept below ``results``, oldest first."""
    found = ((_RUN.fullmatch(path.name), path) for path in (results / HISTORY).glob("*.json.gz"))
    return sorted(Run(int(match[1]), path) for match, path in found if match)


def keep_run(results: Path, scan_ids: Iterable[str], *, unfinished: Collection[str] = ()) -> Path | None:
    """Keep what the records of these rows say now; ``None`` if the newest run kept says the same.

    ``unfinished`` rows have no verdict.
    """
    folder = results / HISTORY
    with only_writer(results.parent / ".snakemake" / "rahas-locks" / f"{HISTORY}.lock", lambda: None):
        folder.mkdir(parents=True, exist_ok=True)
        sweep(folder)
        text = _text_of_run(results, scan_ids, unfinished).encode()
        former = runs(results)
        if former and _text_kept(former[-1].path) == text:
            return None
        path = folder / f"{former[-1].number + 1 if former else 1:04d}.json.gz"
        write_json(_companion(path), _circumstances())
        with replacing(path) as temporary:
            temporary.write_bytes(gzip.compress(text, mtime=0))
    return path


def _text_kept(path: Path) -> bytes | None:
    """What a run's file holds; ``None`` where it is damaged, which harms no later run."""
    try:
        return gzip.decompress(path.read_bytes())
    except (OSError, EOFError, zlib.error):
        return None


def read_run(path: Path) -> dict[str, RowState]:
    """What each row was after a run.

    Raises
    ------
    ValueError
        The file is damaged, or of another schema.
    """
    try:
        run = json.loads(gzip.decompress(path.read_bytes()))
        if run["schema"] != SCHEMA:
            raise ValueError(f"{path}: found schema {run['schema']}, expected {SCHEMA}")
        return {
            scan_id: recorded_state(
                row["qa"], {stage: _whole(kept, run["shared"]) for stage, kept in row["records"].items()}
            )
            for scan_id, row in run["rows"].items()
        }
    except (EOFError, KeyError, TypeError, zlib.error, gzip.BadGzipFile) as error:
        raise ValueError(f"{path}: damaged ({error})") from None


def _text_of_run(results: Path, scan_ids: Iterable[str], unfinished: Collection[str]) -> str:
    shared: dict[str, Any] = {}
    rows = {}
    for scan_id in scan_ids:
        scan = ScanFolder(results, scan_id)
        has_verdict = scan_id not in unfinished and scan.qa.is_file()
        records = {stage: _kept(raw, shared) for stage, raw in raw_records(scan)}
        rows[scan_id] = {"qa": read_json_or_none(scan.qa) if has_verdict else None, "records": records}
    return canonical_json({"schema": SCHEMA, "shared": shared, "rows": rows})


def _kept(raw: dict[str, Any], shared: dict[str, Any]) -> dict[str, Any]:
    """A record without what it shares with other rows, which goes to ``shared`` under its digest."""
    recipe = dict(raw["recipe"])
    own = {name: recipe.pop(name, {}) for name in _OF_THE_ROW}
    common = {"recipe": recipe, **{name: raw[name] for name in _COMMON if name in raw}}
    key = digest_of_json(common)[:16]
    shared[key] = common
    return {**{n: v for n, v in raw.items() if n not in ("recipe", *_COMMON, *_DERIVED)}, **own, "shared": key}


def _whole(kept: Mapping[str, Any], shared: Mapping[str, Any]) -> dict[str, Any]:
    """The record again, but for what follows from the rest."""
    own = dict(kept)
    common = shared[own.pop("shared")]
    recipe = {**common["recipe"], **{name: own.pop(name) for name in _OF_THE_ROW}}
    return {**common, **own, "recipe": recipe}


def _companion(path: Path) -> Path:
    return path.with_name(path.name.removesuffix(".json.gz") + SUFFIX)


def _circumstances() -> dict[str, Any]:
    """What does not belong to a run's content: when and where it was kept, and by which commit of the code."""
    commit = commit_of()
    return {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": platform.node(),
        "commit": commit.name,
        "tree_clean": commit.clean,
    }
