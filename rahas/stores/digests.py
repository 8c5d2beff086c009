"""Digests of bytes, files and stores."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

MANIFEST_NAME = "manifest.json"
_BLOCK = 1 << 20


def digest_of_bytes(data: bytes) -> str:
    """SHA-256 of ``data``, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def digest_of_json(value: Any) -> str:
    """Digest of the one canonical JSON form of ``value``."""
    return digest_of_bytes(canonical_json(value).encode())


def canonical_json(value: Any) -> str:
    """JSON with sorted keys, no white space and no non-finite numbers: equal values give equal text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def digest_of_file(path: Path) -> str:
    """SHA-256 of a file's bytes, read in blocks."""
    digest = hashlib.sha256()
    with open(path, "rb") as handle:
        while block := handle.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def manifest_of_folder(folder: Path) -> dict[str, str]:
    """Digest of every file below ``folder`` by its relative path, the manifest itself left out."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != MANIFEST_NAME)
    return {str(p.relative_to(folder)): digest_of_file(p) for p in files}


def digest_of_path(path: Path) -> str:
    """Digest of a file, of a store through its own manifest, or of any other folder through one made now."""
    if not path.is_dir():
        return digest_of_file(path)
    manifest = path / MANIFEST_NAME
    is_store = path.suffix == ".zarr" and manifest.is_file()
    return digest_of_file(manifest) if is_store else digest_of_json(manifest_of_folder(path))


def digests_of_files(folder: Path, paths: Iterable[Path]) -> dict[str, str]:
    """Digest of each of ``paths`` that exists, of a folder of each file in it, by their paths below ``folder``."""
    found: dict[str, str] = {}
    for path in paths:
        if path.is_dir():
            found |= {str((path / name).relative_to(folder)): d for name, d in manifest_of_folder(path).items()}
        elif path.exists():
            found[str(path.relative_to(folder))] = digest_of_file(path)
    return found
