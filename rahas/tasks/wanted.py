"""What somebody means who names a scan, an artifact or a raw file."""

from __future__ import annotations

import difflib
import os
from pathlib import Path
from typing import NamedTuple

from rahas.errors import ExpeditionError
from rahas.provenance.lineage import Key, Steps
from rahas.tasks.expedition import Expedition

_LAST = ("page", "cloud", "calibrate", "phase", "verdict")  # what a scan's name alone stands for, from the end


class Wanted(NamedTuple):
    """One thing that was named."""

    name: str
    keys: list[Key]
    """The steps that make it; all of a scan; none for a raw file."""
    scan: str | None = None
    """The scan, where a scan as a whole is meant."""
    raw: str | None = None
    """The raw file, from the expedition's folder."""

    def shown_keys(self, steps: Steps) -> list[Key]:
        """The steps whose lineage shows all of it."""
        if self.scan is None:
            return self.keys
        last = next((stage for stage in _LAST if (self.scan, stage) in steps and steps[self.scan, stage].made), None)
        return [(self.scan, last)] if last else self.keys[-1:]


def wanted_of(expedition: Expedition, steps: Steps, name: str) -> Wanted:
    """Find what ``name`` means: a scan_id, a path from the expedition's folder, from here, or absolute.

    Raises
    ------
    ExpeditionError
        It is none of them.
    """
    scans = [entry.scan_id for entry in expedition.entries]
    for path in _readings(expedition, name):
        parts = path.parts
        scan = parts[1] if len(parts) == 2 and parts[0] == "results" else str(path)
        if scan in scans:
            return Wanted(name, [key for key in steps if key[0] == scan], scan=scan)
        keys = [key for key, step in steps.items() if _is_of(path, step.shown, step.outputs)]
        if keys:
            return Wanted(name, keys)
        raw = {source.path for step in steps.values() for source in step.sources if source.path is not None}
        if str(path) in raw:
            return Wanted(name, [], raw=str(path))
        within = [one for one in raw if path.is_relative_to(one)]  # a still of a capture that is a folder
        if within:
            return Wanted(name, [], raw=within[0])
    close = difflib.get_close_matches(name, [*scans, *(p for step in steps.values() for p in step.artifacts())], n=1)
    hint = f" (is it {close[0]}?)" if close else ""
    raise ExpeditionError(
        f"{name!r}: found no such thing{hint}, expected a scan_id of field_log.csv, an artifact such as "
        "results/<scan_id>/cloud.ply, or a raw file that a row uses"
    )


def _readings(expedition: Expedition, name: str) -> list[Path]:
    """The paths from the expedition's folder that a name may stand for."""
    found = [Path(os.path.normpath(name))]
    for base in (Path.cwd(), expedition.root):
        absolute = Path(os.path.normpath(base / name))
        if absolute.is_relative_to(expedition.root):
            found.append(absolute.relative_to(expedition.root))
    return found


def _is_of(path: Path, shown: str, outputs: tuple[str, ...]) -> bool:
    """Whether a path is one of a step's outputs, or lies within one."""
    return any(path.is_relative_to(shown + output) for output in outputs)
