"""Whether files are what a record says of them; of a store, which chunk is not."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rahas.provenance.records import read_record
from rahas.stores.atomic import read_json
from rahas.stores.digests import MANIFEST_NAME, digest_of_file, digest_of_json, digest_of_path

# Left in a store by the scheduler where a store was asked for by name; empty, and no part of the data.
SCHEDULERS_OWN = ".snakemake_timestamp"


class Fault(NamedTuple):
    """A file that is not what it should be."""

    artifact: str
    """Path below the folder that the record speaks of."""
    part: str
    """File within a store; empty for a plain file."""
    text: str


def record_faults(path: Path, stage: str) -> list[str]:
    """What is wrong with a record's own file; empty for one that is as it was written."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return ["there is no record: nothing says what it was made from"]
    except (OSError, UnicodeDecodeError) as error:
        return [f"the record cannot be read: {error}"]
    record = read_record(path)
    if record is None:
        return ["the record is no record of this version: it is damaged, or was written by another version"]
    if record.recipe.stage != stage:
        return [f"the record is one of stage {record.recipe.stage}"]
    try:
        whole, raw = record.text(), json.loads(text)
    except (ValueError, TypeError):
        return ["the record was edited after it was written"]
    if whole == text:
        return []
    if raw["key"] != record.recipe.key:
        return ["the record's recipe was edited after it was written: its key does not fit it"]
    return ["the record was edited after it was written: its seal does not fit it"]


def output_faults(folder: Path, outputs: Mapping[str, str], known: Mapping[str, str]) -> list[Fault]:
    """Compare the files below ``folder`` with the digests ``outputs`` of a record.

    ``known`` are the artifacts of the whole expedition by digest: to say whose bytes lie in a place.
    """
    faults: list[Fault] = []
    for name, digest in outputs.items():
        path = folder / name
        try:
            if path.suffix == ".zarr" and path.is_dir():
                faults += _store_faults(path, name, digest, known)
            elif not path.exists():
                faults.append(Fault(name, "", "is missing"))
            elif (found := digest_of_path(path)) != digest:
                faults.append(Fault(name, "", _other_content(path, found, known)))
        except OSError as error:
            faults.append(Fault(name, "", f"cannot be read: {error.strerror or error}"))
    return faults


def stamp_fault(path: Path) -> str | None:
    """What is wrong with a job's stamp, whose name carries the key of what it holds."""
    job, key, _ = path.name.split(".")
    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text)
        named = job in _UNKEYED or digest_of_json(content)[: len(key)] == key
        plain = set(content) == {_UNKEYED[job]} if job in _UNKEYED else True
        written = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        return None if named and plain and text == written else "does not hold what its name says"
    except (OSError, ValueError, TypeError) as error:
        return f"cannot be read: {error}"


_UNKEYED = {"render": "rendered", "summary": "rows"}  # stamps that hold one plain value


def _store_faults(path: Path, name: str, digest: str, known: Mapping[str, str]) -> Iterator[Fault]:
    manifest = path / MANIFEST_NAME
    if not manifest.is_file():
        yield Fault(name, MANIFEST_NAME, f"{MANIFEST_NAME} is missing: the store is not whole")
        return
    found = digest_of_file(manifest)
    if found != digest:
        whose = f": it is that of {known[found]}" if found in known else ""
        yield Fault(name, MANIFEST_NAME, f"{MANIFEST_NAME} is not the one of the record{whose}")
    listed = _listed(manifest)
    if listed is None:
        return
    places = {there: part for part, there in listed.items()}
    for part, expected in listed.items():
        file = path / part
        if not file.is_file():
            yield Fault(name, part, f"{described(part)} is missing")
        elif (there := digest_of_file(file)) != expected:
            whose = f" (its bytes are those of {described(places[there])})" if there in places else _emptiness(file)
            yield Fault(name, part, f"{described(part)} is not what was written{whose}")
    for extra in sorted(_files(path) - listed.keys() - {MANIFEST_NAME, SCHEDULERS_OWN}):
        yield Fault(name, extra, f"{described(extra)} does not belong to the store")


def _listed(manifest: Path) -> dict[str, str] | None:
    try:
        listed: Any = read_json(manifest)["files"]
    except (ValueError, KeyError, TypeError):
        return None
    well = isinstance(listed, dict) and all(isinstance(v, str) and not Path(k).is_absolute() for k, v in listed.items())
    return listed if well else None


def _files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file() or p.is_symlink()}


def _other_content(path: Path, found: str, known: Mapping[str, str]) -> str:
    if found in known:
        return f"is not what was written (its bytes are those of {known[found]})"
    return f"is not what was written{_emptiness(path) if path.is_file() else ''}"


def _emptiness(file: Path) -> str:
    return "" if file.stat().st_size else " (it is empty)"


def described(part: str) -> str:
    """``chunk 0/3 of phase_std`` from ``phase_std/c/0/3``, ``description of phase_std`` from its zarr.json."""
    array, separator, chunk = part.partition("/c/")
    if separator:
        return f"chunk {chunk} of {array}"
    if part == "zarr.json":
        return "description of the store (zarr.json)"
    if part.endswith("/zarr.json"):
        return f"description of {part.removesuffix('/zarr.json')} (zarr.json)"
    return part
