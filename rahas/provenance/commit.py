"""Which commit of the project runs, and whether its tree was clean; the git program is asked, but not needed."""

from __future__ import annotations

import os
import shutil
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

PROJECT = Path(__file__).resolve().parents[2]
CODE = ("rahas", "workflow", "Snakefile")  # an edit elsewhere in the tree changes no result


class Commit(NamedTuple):
    """The state of the project's code."""

    name: str | None
    """Hexadecimal name of the commit; None where the code lies in no repository of its own."""
    clean: bool | None
    """Whether the code is as committed; None where that cannot be told."""


@lru_cache(maxsize=1)
def commit_of(project: Path = PROJECT) -> Commit:
    """Commit of the repository whose root is ``project``; looked up once a process."""
    if not (project / ".git").exists():
        return Commit(None, None)
    return _asked(project) or Commit(_read(project), None)


def _asked(project: Path) -> Commit | None:
    """What git says; None without the program, or where it refuses (a repository of another user)."""
    git = shutil.which("git")
    if git is None:
        return None
    import subprocess

    words = [git, "--no-optional-locks", "-C", str(project), "status", "--porcelain=v2", "--branch", "--", *CODE]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    try:
        told = subprocess.run(words, capture_output=True, text=True, timeout=5, check=True, env=environment).stdout
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None
    lines = told.splitlines()
    name = next((line.split()[-1] for line in lines if line.startswith("# branch.oid ")), None)
    return Commit(name, all(line.startswith("#") for line in lines)) if name and _is_name(name) else None


def _read(project: Path) -> str | None:
    """The commit as the repository's own files name it."""
    try:
        folder = project / ".git"
        if folder.is_file():  # a work tree beside its repository
            folder = project / folder.read_text(encoding="utf-8").removeprefix("gitdir:").strip()
        head = (folder / "HEAD").read_text(encoding="utf-8").strip()
        if not head.startswith("ref:"):
            return head if _is_name(head) else None
        reference = head.removeprefix("ref:").strip()
        shared = folder / "commondir"
        common = folder / shared.read_text(encoding="utf-8").strip() if shared.is_file() else folder
        for place in (folder, common):
            if (place / reference).is_file():
                name = (place / reference).read_text(encoding="utf-8").strip()
                return name if _is_name(name) else None
        for line in (common / "packed-refs").read_text(encoding="utf-8").splitlines():
            if line.endswith(f" {reference}"):
                return line.split()[0]
    except (OSError, UnicodeDecodeError):
        pass
    return None


def _is_name(text: str) -> bool:
    return len(text) in (40, 64) and all(c in "0123456789abcdef" for c in text)
