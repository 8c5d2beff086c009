"""Small rendered expeditions, and the real `snakemake` command line on them."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from rahas.simulate.capture import photo, stage
from rahas.simulate.examples import example
from rahas.simulate.roof import DIAMETER_MM, target_marks
from rahas.simulate.specs import CaptureSpec
from rahas.stores.digests import digest_of_file, digest_of_path, manifest_of_folder
from rahas.stores.video_writer import Encoding, write_frames

PROJECT = Path(__file__).parents[2]
SNAKEMAKE = Path(sys.executable).parent / "snakemake"
CODE = ("Snakefile", "workflow", "profiles", "rahas")
ROWS: tuple[dict[str, str], ...] = (
    {"scan_id": "cal", "site": "Tara", "notes": "target, by hand", "decision": "keep", "role": "calibration"},
    {"scan_id": "rock", "site": "Tara", "notes": 'circle, "under" the ledge; 2/3 lit', "decision": "keep"},
    {"scan_id": "far", "site": "Tara", "notes": "too far away", "decision": ""},
)
# Not from the start of a line: lines of jobs that run side by side may run into one another.
MADE = re.compile(r"rahas: (\S+): (\S+) made in ")
PAGES = re.compile(r"rahas: (\S+): page written")
STARTED = re.compile(r"^Job \d+: ([^:\n]+): ", re.MULTILINE)
ANNOUNCED = re.compile(r"^rahas: (.* no longer current)$", re.MULTILINE)
FINISHED = re.compile(r"Finished jobid: \d+ \(Rule: (\w+)\)")
NOTHING = "Nothing to be done"


@dataclass(frozen=True)
class Run:
    """What a command did."""

    status: int
    output: str

    @property
    def made(self) -> list[tuple[str, str]]:
        """(scan_id, stage) of each stage that was computed, sorted."""
        return sorted(MADE.findall(self.output))

    @property
    def pages(self) -> list[str]:
        """Rows whose page was written, sorted."""
        return sorted(PAGES.findall(self.output))

    @property
    def announced(self) -> list[str]:
        """What was announced before anything ran, but for the sentence that closes it."""
        return ANNOUNCED.findall(self.output.partition("Building DAG")[0])

    @property
    def jobs(self) -> list[str]:
        """The rule of each job that ended well, the default target apart."""
        return [rule for rule in FINISHED.findall(self.output) if rule != "all"]

    @property
    def started(self) -> set[str]:
        """Rows of which a job was started."""
        return set(STARTED.findall(self.output))


@dataclass(frozen=True)
class Expedition:
    """A folder with a field log, and the code that processes it."""

    root: Path
    code: Path

    def run(self, *arguments: str, timeout: float = 300, **options: Any) -> Run:
        """Run `snakemake --cores 2` from another folder, with next to no environment; wait for its end."""
        with self.start(*arguments, **options) as process:
            try:
                output, _ = process.communicate(timeout=timeout)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
        return Run(process.returncode, output)

    def start(
        self, *arguments: str, environment: Mapping[str, str] | None = None, **options: Any
    ) -> subprocess.Popen[str]:
        """The same, not waited for; in a process group of its own."""
        variables = minimal_environment(self.root.parent) | dict(environment or {})
        return subprocess.Popen(
            [*self.command, *arguments], cwd="/", env=variables, text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
            **options,
        )  # fmt: skip

    @property
    def command(self) -> list[str]:
        return [
            *(str(SNAKEMAKE), "--cores", "2", "--nocolor"),
            *("--snakefile", str(self.code / "Snakefile"), "--directory", str(self.root)),
        ]

    def scan(self, scan_id: str) -> Path:
        return self.root / "results" / scan_id

    def qa(self, scan_id: str) -> dict[str, Any]:
        return json.loads((self.scan(scan_id) / "qa.json").read_text(encoding="utf-8"))

    def verdict(self, scan_id: str) -> str:
        """Verdict and deciding rules, such as ``rejected: jitter``."""
        qa = self.qa(scan_id)
        return f"{qa['verdict']}: {' '.join(sorted({reason['rule'] for reason in qa['reasons']}))}".rstrip(": ")

    def table(self) -> dict[str, dict[str, str]]:
        with open(self.root / "results" / "scans.csv", encoding="utf-8", newline="") as file:
            return {row["scan_id"]: row for row in csv.DictReader(file)}

    def log(self, rows: Iterable[Mapping[str, str]]) -> None:
        write_log(self.root, rows)

    def configure(self, text: str) -> None:
        (self.root / "config" / "config.yaml").write_text(text, encoding="utf-8")

    def digests(self, folder: str = "results") -> dict[str, str]:
        """Digest of every file below a folder, Snakemake's own stamps left out."""
        return {
            name: digest for name, digest in manifest_of_folder(self.root / folder).items() if ".snakemake" not in name
        }

    def copy(self, root: Path) -> Expedition:
        """A copy with the modification times of its files."""
        shutil.copytree(self.root, root, symlinks=True)
        return Expedition(root, self.code)


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[str], *, patience_s: float = 120.0) -> None:
    """Wait until ``condition`` holds while the process runs."""
    limit = time.monotonic() + patience_s
    while not condition():
        assert process.poll() is None, process.communicate()[0]
        assert time.monotonic() < limit, "it never came to that"
        time.sleep(0.01)


def minimal_environment(home: Path) -> dict[str, str]:
    """No activated environment, no locale, no terminal."""
    return {"PATH": "/usr/bin:/bin", "HOME": str(home)}


def captures() -> dict[str, CaptureSpec]:
    """A calibration, a petroglyph that is accepted, a stone over a quarter of the image that is not."""
    return {
        "cal": example("roof", short=True, seed=3),
        "rock": example("circle", short=True, seed=3),
        "far": example("metate", short=True, seed=3, scene={"size_mm": 70.0}),
    }


def render_expedition(root: Path) -> None:
    """Captures, target and log, as an operator would bring them home."""
    for scan_id, capture in captures().items():
        staged = stage(capture)
        write_frames(root / "captures" / f"{scan_id}.mkv", staged.frames(), Encoding("ffv1"))
        if scan_id != "far":
            cv2.imwrite(str(root / "captures" / f"{scan_id}_texture.png"), photo(staged)[..., ::-1])
    write_target(root / "config" / "target.csv")
    write_log(root, ROWS)


def write_target(path: Path, marks: int = 18) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [f"{n},{x:.4f},{y:.4f},{z:.4f},{DIAMETER_MM}" for n, (x, y, z) in enumerate(target_marks()[:marks], 1)]
    path.write_text("\n".join(["mark,x_mm,y_mm,z_mm,diameter_mm", *rows]) + "\n", encoding="utf-8")


def write_log(root: Path, rows: Iterable[Mapping[str, str]]) -> None:
    """field_log.csv with the columns that the rows have."""
    rows = list(rows)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with open(root / "field_log.csv", "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)


def row(scan_id: str, **cells: str) -> dict[str, str]:
    """A further row of the log."""
    return {"scan_id": scan_id, "site": "Tara", "notes": "", "decision": "", **cells}


def copy_code(folder: Path, project: Path = PROJECT) -> Path:
    """The project's code at another place, compiled kernels included: edits made to it, or meanwhile, hurt nobody."""
    for name in CODE:
        source = project / name
        if source.is_dir():
            shutil.copytree(source, folder / name)
        else:
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, folder / name)
    return folder


def edit(path: Path, old: str, new: str) -> None:
    """Replace a text that has to be there."""
    text = path.read_text(encoding="utf-8")
    assert old in text, f"{path.name} no longer holds {old!r}"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def assert_whole(results: Path) -> None:
    """Nothing half-written has a final name: stores have the manifest that fits them, JSON parses, records fit."""
    assert not list(results.rglob(".making-*")), "left-overs of a killed writer"
    for store in results.glob("*/*.zarr"):
        manifest = json.loads((store / "manifest.json").read_text(encoding="utf-8"))["files"]
        assert {n: d for n, d in manifest_of_folder(store).items() if ".snakemake" not in n} == manifest, store
    for file in results.rglob("*.json"):
        json.loads(file.read_text(encoding="utf-8"))
    for record in (path for path in results.glob("*/provenance/*.json") if not path.name.endswith(".made.json")):
        content = json.loads(record.read_text(encoding="utf-8"))
        assert content["outcome"] in ("made", "problem", "withdrawn"), record
        base = results if record.parents[1].name == "expedition" else record.parents[1]
        base = results.parent if record.name == "render.json" else base
        for name, digest in content["outputs"].items() if content["outcome"] == "made" else ():
            assert digest_of_path(base / name) == digest, (record, name)


def assert_nothing_half_written(results: Path) -> None:
    """As a run leaves it that was cut off: temporaries may lie there, whatever has a final name is whole."""
    for store in results.glob("*/*.zarr"):
        manifest = json.loads((store / "manifest.json").read_text(encoding="utf-8"))["files"]
        assert all(digest_of_file(store / name) == digest for name, digest in manifest.items()), store
    for file in results.glob("*/*.json"):
        json.loads(file.read_text(encoding="utf-8"))
    for ply in results.glob("*/cloud.ply"):
        head, _, body = ply.read_bytes().partition(b"end_header\n")
        count = int(re.search(rb"element vertex (\d+)", head).group(1))  # type: ignore[union-attr]
        assert count > 0
        assert len(body) % count == 0, ply


def jobs_running(root: Path) -> dict[int, str]:
    """The `rahas.cli job` processes that work in a folder: what each does, by its pid."""
    found = {}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().decode(errors="replace").split("\0")
            inside = os.readlink(process / "cwd") == str(root.resolve())
        except OSError:  # it has just ended
            continue
        if inside and "rahas.cli" in words and "job" in words:
            found[int(process.name)] = " ".join(words[words.index("job") + 1 :][:2])
    return found
