"""Files and folders that appear under their final name whole, or not at all."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

TEMPORARY_PREFIX = ".making-"
_HOST = re.sub(r"[^A-Za-z0-9.]", "_", os.uname().nodename)
_OWNED = re.compile(re.escape(TEMPORARY_PREFIX) + r"([A-Za-z0-9._]+)-([0-9]+)-[^-]*")
_SURELY_DEAD_S = 2 * 24 * 3600.0


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary sibling of ``path`` to write (a file or a folder); rename it into place when all went well.

    A folder that stood under the final name is replaced. On any error the temporary is removed and ``path`` stays
    as it was. A killed process leaves at most a ``.making-`` sibling, which :func:`sweep` or :func:`sweep_dead`
    removes; its name tells whose it was.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    holder = _holder(path.parent)
    temporary = holder / path.name
    try:
        yield temporary
        _flush(temporary)
        if temporary.is_dir():
            if path.exists():
                os.rename(path, holder / "former")
            os.rename(temporary, path)
        else:
            os.replace(temporary, path)
        _flush_folder(path.parent)
    finally:
        shutil.rmtree(holder, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` (UTF-8) to ``path`` atomically."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as readable JSON to ``path`` atomically; non-finite numbers are refused."""
    write_text(path, json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def read_json(path: Path) -> Any:
    """Read a JSON file."""
    return json.loads(path.read_text(encoding="utf-8"))


def read_json_or_none(path: Path) -> Any:
    """Read a JSON file; ``None`` where it cannot be read or is damaged."""
    try:
        return read_json(path)
    except (OSError, ValueError):
        return None


def remove(path: Path) -> None:
    """Remove a file or a folder if it is there; a folder loses its name first, so none is seen half-gone."""
    if path.is_dir() and not path.is_symlink():
        holder = _holder(path.parent)
        os.rename(path, holder / path.name)
        shutil.rmtree(holder)
    else:
        path.unlink(missing_ok=True)


def sweep(folder: Path) -> None:
    """Remove what killed writers left in ``folder``; call it only while holding the lock that guards the folder."""
    for left_over in folder.glob(f"{TEMPORARY_PREFIX}*"):
        shutil.rmtree(left_over, ignore_errors=True)


def sweep_dead(folder: Path) -> None:
    """Remove what killed writers left in a ``folder`` that no lock guards: only what nobody can still be writing.

    That is what a process of this machine left that lives no more, and of other machines what is two days old.
    """
    for left_over in folder.glob(f"{TEMPORARY_PREFIX}*"):
        owner = _OWNED.fullmatch(left_over.name)
        here = owner is not None and owner[1] == _HOST
        if _is_dead(int(owner[2])) if owner and here else _age_s(left_over) > _SURELY_DEAD_S:
            shutil.rmtree(left_over, ignore_errors=True)


def _holder(folder: Path) -> Path:
    return Path(tempfile.mkdtemp(prefix=f"{TEMPORARY_PREFIX}{_HOST}-{os.getpid()}-", dir=folder))


def _is_dead(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    except OSError:  # it lives, and is another user's
        return False
    return False


def _age_s(path: Path) -> float:
    try:
        return time.time() - path.stat().st_mtime
    except OSError:
        return 0.0


def _flush(path: Path) -> None:
    files = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]
    for file in files:
        with open(file, "rb") as handle:
            os.fsync(handle.fileno())


def _flush_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
