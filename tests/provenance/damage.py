"""Damage drawn with a seed: what can befall the files of an expedition, one file at a time, and how it is undone."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rahas.provenance.records import Recipe, Record
from rahas.stores.digests import digest_of_file, digest_of_json

Damage = Callable[[Path, random.Random, list[Path]], Path | None]
"""Does the damage to a file, its likes in other places being given; returns a file that it added, if it did."""


def flip_a_bit(path: Path, draw: random.Random, likes: list[Path]) -> None:
    content = bytearray(path.read_bytes())
    content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    path.write_bytes(content)


def change_a_byte(path: Path, draw: random.Random, likes: list[Path]) -> None:
    content = bytearray(path.read_bytes())
    place = draw.randrange(len(content))
    content[place] = (content[place] + draw.randrange(1, 256)) % 256
    path.write_bytes(content)


def change_a_digit(path: Path, draw: random.Random, likes: list[Path]) -> None:
    """Still a file that parses, if it is one of text."""
    content = bytearray(path.read_bytes())
    places = [n for n, c in enumerate(content) if chr(c).isdigit()]
    place = draw.choice(places)
    content[place] = ord(str((int(chr(content[place])) + 1) % 10))
    path.write_bytes(content)


def truncate(path: Path, draw: random.Random, likes: list[Path]) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: draw.randrange(len(content))])


def empty(path: Path, draw: random.Random, likes: list[Path]) -> None:
    path.write_bytes(b"")


def lengthen(path: Path, draw: random.Random, likes: list[Path]) -> None:
    path.write_bytes(path.read_bytes() + draw.choice((b"\0", b"\n", b" ")))


def delete(path: Path, draw: random.Random, likes: list[Path]) -> None:
    path.unlink()


def add_beside(path: Path, draw: random.Random, likes: list[Path]) -> Path:
    added = path.with_name(draw.choice((f"{path.name}~", f"copy of {path.name}", "9", f".{path.name}")))
    shutil.copy(path, added)
    return added


def rename(path: Path, draw: random.Random, likes: list[Path]) -> Path:
    moved = path.with_name(f"{path.name}.bak")
    path.rename(moved)
    return moved


def take_from_another(path: Path, draw: random.Random, likes: list[Path]) -> None:
    """The same file of another scan, or another of its kind: what a swap leaves in this place."""
    others = [like for like in likes if like.read_bytes() != path.read_bytes()]
    shutil.copy(draw.choice(others), path)


def forget_the_output(path: Path, draw: random.Random, likes: list[Path]) -> None:
    raw = json.loads(path.read_text(encoding="utf-8"))
    raw["outputs"].popitem()
    _write(path, raw)


def edit_a_parameter(path: Path, draw: random.Random, likes: list[Path]) -> None:
    """By hand: key and seal stay."""
    raw = json.loads(path.read_text(encoding="utf-8"))
    _edit_recipe(raw, draw)
    _write(path, raw)


def edit_a_parameter_carefully(path: Path, draw: random.Random, likes: list[Path]) -> None:
    """Key and seal fit the edited recipe."""
    raw = json.loads(path.read_text(encoding="utf-8"))
    _edit_recipe(raw, draw)
    _seal(path, raw)


def edit_the_digest_carefully(path: Path, draw: random.Random, likes: list[Path]) -> None:
    """The record speaks of other bytes, and its seal fits."""
    raw = json.loads(path.read_text(encoding="utf-8"))
    name = draw.choice(sorted(raw["outputs"]))
    raw["outputs"][name] = digest_of_json(draw.random())
    _seal(path, raw)


def edit_the_outcome_carefully(path: Path, draw: random.Random, likes: list[Path]) -> None:
    raw = json.loads(path.read_text(encoding="utf-8"))
    raw["outcome"] = draw.choice(sorted({"made", "making", "problem", "withdrawn"} - {raw["outcome"]}))
    _seal(path, raw)


def another_version(path: Path, draw: random.Random, likes: list[Path]) -> None:
    raw = json.loads(path.read_text(encoding="utf-8"))
    raw["schema"] += draw.choice((-1, 1))
    _write(path, raw)


def edit_chunk_and_manifest(path: Path, draw: random.Random, likes: list[Path]) -> None:
    """``path`` is a manifest: one of its files is changed, and its line with it."""
    manifest = json.loads(path.read_text(encoding="utf-8"))
    name = draw.choice(sorted(manifest["files"]))
    change_a_byte(path.parent / name, draw, likes)
    manifest["files"][name] = digest_of_file(path.parent / name)
    path.write_text(json.dumps(manifest, indent=0, sort_keys=True), encoding="utf-8")


def take_out_of_the_manifest(path: Path, draw: random.Random, likes: list[Path]) -> None:
    """A chunk goes, and its line in the manifest with it: zarr reads zeros there."""
    manifest = json.loads(path.read_text(encoding="utf-8"))
    name = draw.choice(sorted(n for n in manifest["files"] if "/c/" in n))
    (path.parent / name).unlink()
    del manifest["files"][name]
    path.write_text(json.dumps(manifest, indent=0, sort_keys=True), encoding="utf-8")


def swap_two_chunks(path: Path, draw: random.Random, likes: list[Path]) -> None:
    """Two files of one store change places."""
    files = sorted(p for p in path.parent.rglob("*") if p.is_file() and p.parent.parent.name in ("c", "0"))
    pairs = [(a, b) for a in files for b in files if a < b and a.read_bytes() != b.read_bytes()]
    one, other = draw.choice(pairs)
    content = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(content)


@contextmanager
def damaged(
    path: Path, damage: Damage, draw: random.Random, likes: list[Path], *, aside: Path
) -> Iterator[Path | None]:
    """Damage a file for the length of the block; it, or the store that it lies in, is kept in ``aside`` meanwhile."""
    whole = next((p for p in path.parents if p.suffix == ".zarr"), path)
    outside = aside / whole.name
    shutil.copytree(whole, outside) if whole.is_dir() else shutil.copy2(whole, outside)
    added = None
    try:
        added = damage(path, draw, likes)
        yield added
    finally:
        if added is not None:
            added.unlink(missing_ok=True)
        if outside.is_dir():
            shutil.rmtree(whole)
        else:
            path.unlink(missing_ok=True)
        shutil.move(outside, whole)


def _edit_recipe(raw: dict[str, Any], draw: random.Random) -> None:
    """Change one value of the recipe, wherever in it."""
    places: list[tuple[Any, Any]] = []

    def look(value: Any) -> None:
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(inner, dict | list):
                look(inner)
            else:
                places.append((value, key))

    look({name: raw["recipe"][name] for name in ("params", "inputs", "columns", "libraries")})
    holder, key = draw.choice(places)
    old = holder[key]
    holder[key] = (not old) if isinstance(old, bool) else f"{old}1" if isinstance(old, str) else (old or 0) + 1


def _seal(path: Path, raw: dict[str, Any]) -> None:
    content = {name: value for name, value in raw.items() if name not in ("key", "seal")}
    Record(**{**content, "recipe": Recipe(**raw["recipe"])}).write(path)


def _write(path: Path, raw: Any) -> None:
    path.write_text(json.dumps(raw, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
