"""Companions tell when and where, the commit without needing git; a record holds neither."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rahas.provenance import code, companions
from rahas.provenance.commit import Commit, commit_of
from rahas.provenance.fingerprints import package_code
from rahas.provenance.records import read_record
from rahas.tasks.pipeline import STAGES
from tests.provenance.tree import Tree


def test_every_record_has_its_companion(processed_tree: Tree) -> None:
    records = [p for p in processed_tree.results.glob("*/provenance/*.json") if not p.name.endswith(".made.json")]
    assert len(records) > 30
    for path in records:
        record = read_record(path)
        made = companions.read_companion(path, record)
        assert made is not None, path
        assert re.fullmatch(r"20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", made["began"])
        assert 0 <= made["seconds"] < 600
        assert 10 < made["peak_memory_mb"] < 100_000
        assert made["host"]
        assert companions.is_sound(companions.companion_path(path))
        for name in ("began", "seconds", "host", "commit"):
            assert f'"{name}"' not in path.read_text(encoding="utf-8")


def test_notes_and_raw_files_stand_in_the_companion(processed_tree: Tree) -> None:
    path = processed_tree.results / "rock" / "provenance" / "ingest.json"
    made = companions.read_companion(path, read_record(path))
    assert made is not None
    assert made["notes"] == 'circle, "under" the ledge'
    assert made["files"] == {"capture": "captures/rock.mkv"}
    assert "ledge" not in path.read_text(encoding="utf-8")


def test_companion_of_a_former_record_counts_for_nothing(tree: Tree) -> None:
    folder = tree.results / "rock" / "provenance"
    (folder / "phase.made.json").write_bytes((folder / "cloud.made.json").read_bytes())
    assert companions.read_companion(folder / "phase.json", read_record(folder / "phase.json")) is None
    assert tree.audit().findings == []


def test_scheduler_names_its_job(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLURM_JOB_ID", "4711")
    monkeypatch.setenv("SLURM_JWT", "not to be kept")
    path = tree.results / "rock" / "provenance" / "phase.json"
    record = read_record(path)
    assert record is not None
    companions.write_companion(path, record, companions.Clock())
    made = companions.read_companion(path, record)
    assert made is not None
    assert made["job"] == {"SLURM_JOB_ID": "4711"}


def test_definitions_behind_a_fingerprint(tmp_path: Path) -> None:
    entry = STAGES["cloud"].entry
    code.keep_definitions(tmp_path, package_code(), entry)
    fingerprint = package_code().fingerprint(entry)
    assert code.known_definitions(tmp_path, fingerprint) == package_code().definitions(entry)
    assert code.known_definitions(tmp_path, "0" * 64) is None
    path = code.code_folder(tmp_path) / f"{fingerprint}.json"
    assert code.is_sound(path)
    content = json.loads(path.read_text(encoding="utf-8"))
    content.popitem()
    path.write_text(json.dumps(content, indent=0, sort_keys=True) + "\n", encoding="utf-8")
    assert code.known_definitions(tmp_path, fingerprint) is None
    assert not code.is_sound(path)


needs_git = pytest.mark.skipif(shutil.which("git") is None, reason="makes a repository with git")


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    def git(*words: str) -> None:
        identity = ("-c", "user.name=E", "-c", "user.email=e@example.org")
        subprocess.run(["git", "-C", str(tmp_path), *identity, *words], check=True, capture_output=True)

    (tmp_path / "rahas").mkdir()
    (tmp_path / "rahas" / "one.py").write_text("x = 1\n")
    git("init", "--initial-branch=main")
    git("add", ".")
    git("commit", "--message", "one")
    return tmp_path


def fresh(project: Path) -> Commit:
    commit_of.cache_clear()
    try:
        return commit_of(project)
    finally:
        commit_of.cache_clear()


@needs_git
def test_commit_with_and_without_git(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    head = (repository / ".git" / "refs" / "heads" / "main").read_text().strip()
    assert fresh(repository) == Commit(head, clean=True)
    (repository / "notes.txt").write_text("no code")
    assert fresh(repository) == Commit(head, clean=True)
    (repository / "rahas" / "two.py").write_text("y = 2\n")
    assert fresh(repository) == Commit(head, clean=False)
    monkeypatch.setenv("PATH", "")
    assert fresh(repository) == Commit(head, clean=None)
    (repository / ".git" / "packed-refs").write_text(f"# pack-refs\n{head} refs/heads/main\n")
    (repository / ".git" / "refs" / "heads" / "main").unlink()
    assert fresh(repository) == Commit(head, clean=None)
    (repository / ".git" / "HEAD").write_text(f"{head}\n")
    assert fresh(repository) == Commit(head, clean=None)
    (repository / ".git" / "HEAD").write_text("ref: refs/heads/none\n")
    assert fresh(repository) == Commit(None, clean=None)


@needs_git
def test_no_repository_of_its_own(repository: Path) -> None:
    """Installed below somebody's repository: that one's commit says nothing of this code."""
    assert fresh(repository / "rahas") == Commit(None, clean=None)
