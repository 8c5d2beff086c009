"""What stands behind a code fingerprint, kept once for each: so that an audit can name the function that changed.

``results/expedition/provenance/code/<fingerprint>.json`` holds the digest of every definition that the stage reached.
The fingerprint is the digest of that very table, so the file proves itself.
"""

from __future__ import annotations

import json
from pathlib import Path

from rahas.provenance.fingerprints import CodeBase
from rahas.stores.atomic import read_json, write_text
from rahas.stores.digests import digest_of_json


def code_folder(results: Path) -> Path:
    """Where the tables of an expedition lie."""
    return results / "expedition" / "provenance" / "code"


def keep_definitions(results: Path, code: CodeBase, entry: str) -> None:
    """Keep the definitions behind the fingerprint of ``entry``, unless they are there already."""
    path = code_folder(results) / f"{code.fingerprint(entry)}.json"
    if not path.exists():
        write_text(path, _text(code.definitions(entry)))


def known_definitions(results: Path, fingerprint: str) -> dict[str, str] | None:
    """Digest of each definition behind ``fingerprint`` by ``module:name``; None where they were not kept whole."""
    try:
        found = read_json(code_folder(results) / f"{fingerprint}.json")
        return found if isinstance(found, dict) and digest_of_json(found) == fingerprint else None
    except (OSError, ValueError):
        return None


def is_sound(path: Path) -> bool:
    """Whether a table is the one that its name promises."""
    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text)
        return text == _text(content) and digest_of_json(content) == path.stem
    except (OSError, ValueError, TypeError, AttributeError):
        return False


def _text(definitions: dict[str, str]) -> str:
    return json.dumps(definitions, indent=0, sort_keys=True) + "\n"
