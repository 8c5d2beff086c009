"""Damaged copies, drawn with a seed over all kinds of files: each is found and its place named; none is imagined."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from rahas.provenance.audit import Finding
from tests.provenance import damage as d
from tests.provenance.tree import Tree

_BYTES = (d.flip_a_bit, d.change_a_byte, d.truncate, d.empty, d.lengthen)
_PLACES = (d.delete, d.rename, d.add_beside, d.take_from_another)
_EDITS = (
    *(d.edit_a_parameter, d.edit_a_parameter_carefully, d.edit_the_digest_carefully, d.edit_the_outcome_carefully),
    *(d.forget_the_output, d.another_version, d.change_a_digit),
)
DAMAGES: dict[str, tuple[d.Damage, ...]] = {
    "chunk": (*_BYTES, *_PLACES),
    "description": (*_BYTES, *_PLACES, d.change_a_digit),
    "manifest": (*_BYTES, *_PLACES, d.edit_chunk_and_manifest, d.take_out_of_the_manifest, d.swap_two_chunks),
    "artifact": (*_BYTES, *_PLACES, d.change_a_digit),
    "figure": (*_BYTES, *_PLACES),
    "record": (*_BYTES, *_PLACES, *_EDITS),
    "companion": (*_BYTES, d.change_a_digit, d.add_beside),
    "stamp": (*_BYTES, d.change_a_digit, d.add_beside),
    "code": (*_BYTES, d.change_a_digit, d.rename),
    "raw": (*_BYTES, d.delete, d.rename, d.take_from_another),
    "rendered": (*_BYTES, d.delete, d.rename),
}
OF_A_STORE = (d.edit_chunk_and_manifest, d.take_out_of_the_manifest, d.swap_two_chunks)
ROUNDS = 3
CASES = [(kind, one, n) for n in range(ROUNDS) for kind, damages in DAMAGES.items() for one in damages]


def kind_of(path: Path) -> str:
    """Kind of a file of the tree; empty for one that no result depends on."""
    if "history" in path.parts or path.name in ("wet.mkv", "config.yaml"):
        return ""
    if path.parent.name == "simulated":
        return "rendered"
    if path.parent.name in ("captures", "config"):
        return "raw" if path.name != "simulation.yaml" else ""
    if any(part.endswith(".zarr") for part in path.parts):
        return {"manifest.json": "manifest", "zarr.json": "description"}.get(path.name, "chunk")
    if path.parent.name == "code":
        return "code"
    if path.parent.name == "provenance":
        suffix = "companion" if path.name.endswith(".made.json") else "record"
        return suffix if path.suffix == ".json" else "stamp"
    return "figure" if path.parent.name == "figures" else "artifact"


def files_of(tree: Tree, kind: str) -> list[Path]:
    folders = [tree.root / name for name in ("captures", "config", "results")]
    files = (path for folder in folders for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in files if kind_of(path) == kind)


def likes_of(path: Path, files: list[Path], root: Path) -> list[Path]:
    """Files that a mishap may put in the place of this one: of the same name elsewhere, or of the same store."""
    same_place = [p for p in files if p != path and p.name == path.name]
    within = [p for p in files if p != path and p.suffix == path.suffix and p.parent == path.parent]
    candidates = same_place + within if kind_of(path) != "record" else same_place
    return [p for p in candidates if p.read_bytes() != path.read_bytes()]


def fits(damage: d.Damage, path: Path, likes: list[Path]) -> bool:
    if damage is d.take_from_another:
        return bool(likes)
    if damage in (d.edit_the_digest_carefully, d.forget_the_output):
        return '"outputs": {}' not in path.read_text(encoding="utf-8")
    if damage is d.swap_two_chunks:  # of the same kind: pictures of one size each
        return "phase.zarr" in path.parts
    if damage is d.change_a_digit:
        return any(chr(c).isdigit() for c in path.read_bytes())
    return path.stat().st_size > 0


def names(finding: Finding, path: str) -> bool:
    """Whether a finding points at a file, or at the stage whose record it is."""
    if f"{finding.artifact}/{finding.part}".rstrip("/") == path:
        return True
    scan, stage = Path(path).parts[1], Path(path).stem
    return "/provenance/" in path and (finding.scan, finding.stage) == (scan, stage)


@pytest.mark.parametrize(("kind", "damage", "number"), CASES, ids=[f"{k}-{o.__name__}-{n}" for k, o, n in CASES])
def test_damage_is_found(processed_tree: Tree, tmp_path: Path, kind: str, damage: d.Damage, number: int) -> None:
    draw = random.Random(f"{kind} {damage.__name__} {number}")
    files = files_of(processed_tree, kind)
    drawn = ((path, likes_of(path, files, processed_tree.root)) for path in draw.sample(files, len(files)))
    path, likes = next((path, likes) for path, likes in drawn if fits(damage, path, likes))
    with d.damaged(path, damage, draw, likes, aside=tmp_path) as added:
        found = processed_tree.audit().findings
    places = [path.parent if damage in OF_A_STORE else path, *([added] if added is not None else [])]
    shown = [str(place.relative_to(processed_tree.root)) for place in places]
    assert found, f"{damage.__name__} of {shown[0]} was missed"
    told = [finding._asdict() for finding in found]
    named = [f.artifact == shown[0] if damage in OF_A_STORE else any(names(f, s) for s in shown) for f in found]
    assert any(named), (shown, told)


def test_there_are_enough_of_them() -> None:
    assert len(CASES) >= 200


def test_nothing_is_imagined_when_all_is_put_right(processed_tree: Tree) -> None:
    """Runs last in this file: every damage has been undone."""
    audit = processed_tree.audit()
    assert audit.findings == []
    assert audit.scans == 8
    assert audit.artifacts > 50
