"""The stages of a scan, in the order of the data: what each reads, makes and depends on. A table, no actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from rahas.errors import CaptureProblem
from rahas.provenance.records import MADE, Record, read_record
from rahas.stores.digests import MANIFEST_NAME
from rahas.stores.field_log import Entry
from rahas.stores.layout import ScanFolder
from rahas.tasks.expedition import Expedition


@dataclass(frozen=True)
class Work:
    """One row of the log with what its stages may ask for."""

    expedition: Expedition
    entry: Entry

    @property
    def scan(self) -> ScanFolder:
        return self.expedition.scan(self.entry.scan_id)

    @property
    def calibration(self) -> ScanFolder | None:
        """Folder of the calibration that this row uses; ``None`` for a calibration, or where the log has none."""
        if self.entry.role == "calibration" or self.entry.calibration is None:
            return None
        return self.expedition.scan(self.entry.calibration)

    def lent(self, stage: str) -> Record | None:
        """Record of the calibration's ``stage``; ``None`` where there is none, or the operator rejected it."""
        scan = self.calibration
        if scan is None or not self.expedition.is_processed(self.expedition.entry(scan.scan_id)):
            return None
        return read_record(scan.records / f"{stage}.json")

    def calibration_with(self, stage: str) -> ScanFolder | None:
        """The calibration's folder, once its ``stage`` is made; ``None`` for a row that is a calibration itself.

        Raises
        ------
        CaptureProblem
            There is no calibration, or it has been rejected.
        """
        if self.entry.role == "calibration":
            return None
        if self.calibration is None:
            raise CaptureProblem(
                "calibration",
                "calibration",
                "The log names no calibration capture for this scan and none has the same site: scan the target with "
                "each set-up and log it with role calibration.",
                value="none",
                limit="one",
            )
        record = self.lent(stage)
        if record is None or record.outcome != MADE:
            why = "it was rejected, its own page says why"
            if record is not None and record.reason:
                why = record.reason["message"]
            raise CaptureProblem(
                "calibration",
                "calibration",
                f"The calibration {self.calibration.scan_id} cannot be used: {why}",
                value=self.calibration.scan_id,
                limit="an accepted calibration",
            )
        return self.calibration

    def capture_file(self) -> Path:
        """The capture as the log names it.

        Raises
        ------
        CaptureProblem
            There is no such file.
        """
        if self.entry.capture is None or not self.entry.capture.exists():
            named = self.entry.capture.name if self.entry.capture else f"{self.entry.scan_id}.*"
            raise CaptureProblem(
                "unreadable",
                "capture",
                f"There is no capture {named} under captures/: copy it there from the camera's card, or correct the "
                "column capture.",
                value=named,
                limit="a video file or a folder of stills",
            )
        return self.entry.capture

    def texture_file(self) -> Path | None:
        """The texture photo, or ``None`` where there is none by name or by stem.

        Raises
        ------
        CaptureProblem
            The log names a photo that is not there.
        """
        texture = self.entry.texture
        if texture is not None and not texture.is_file():
            if self.entry.texture_named:
                raise CaptureProblem(
                    "unreadable",
                    "texture",
                    f"There is no texture photo {texture.name} under captures/: copy it there, or clear the column "
                    "texture to colour the cloud from the video.",
                    value=texture.name,
                    limit="a photo",
                )
            return None
        return texture


@dataclass(frozen=True)
class Stage:
    """One step from artifacts to artifacts."""

    name: str
    entry: str  # module:function, imported only when it is run
    needs: tuple[str, ...]  # stages of the same scan whose artifacts it reads
    gates: tuple[str, ...] = field(default=(), kw_only=True)  # stages that must let the scan through first
    outputs: Callable[[ScanFolder], tuple[Path, ...]]
    arguments: Callable[[Work], dict[str, Any]]
    section: str | None = None  # of the configuration
    also_reads: tuple[str, ...] = ()  # further sections
    columns: tuple[str, ...] = ()  # of the log row
    files: Callable[[Work], Mapping[str, Path | None]] = lambda work: {}  # raw files that it reads
    borrows: str | None = None  # stage of the calibration whose artifacts it reads
    libraries: tuple[str, ...] = ("numpy",)

    def params(self, work: Work) -> dict[str, Any]:
        """The parameters that it reads, as plain values; those of further sections below the section's name."""
        config = work.expedition.sections
        own = config[self.section] if self.section else {}
        return {**own, **{section: config[section] for section in self.also_reads}}

    def lies_there(self, scan: ScanFolder) -> bool:
        """Whether all its artifacts do; a store without its manifest does not."""
        return all(
            (path / MANIFEST_NAME).is_file() if path.suffix == ".zarr" else path.exists() for path in self.outputs(scan)
        )


_TABLE = (
    Stage(
        name="ingest",
        entry="rahas.tasks.ingest:run",
        needs=(),
        outputs=lambda scan: (scan.frames,),
        arguments=lambda work: {"capture": work.capture_file()},
        section="ingest",
        files=lambda work: {"capture": work.entry.capture},
        libraries=("numpy", "av", "opencv-python-headless", "pillow", "zarr"),
    ),
    Stage(
        name="timeline",
        entry="rahas.tasks.timeline:run",
        needs=("ingest",),
        outputs=lambda scan: (scan.timeline,),
        arguments=lambda work: {},
        section="timeline",
        libraries=("numpy", "scipy", "opencv-python-headless", "zarr"),
    ),
    Stage(
        name="review_capture",
        entry="rahas.tasks.review:run_capture",
        needs=("ingest", "timeline"),
        outputs=lambda scan: (scan.capture_review,),
        arguments=lambda work: {"role": work.entry.role},
        section="capture_review",
        columns=("role",),
        libraries=("numpy", "scipy", "opencv-python-headless", "zarr"),
    ),
    Stage(
        name="snakes",
        entry="rahas.tasks.snakes:run",
        needs=("ingest", "timeline"),
        gates=("review_capture",),
        outputs=lambda scan: (scan.snakes,),
        arguments=lambda work: {},
        section="snakes",
        libraries=("numpy", "scipy", "numba", "opencv-python-headless", "zarr"),
    ),
    Stage(
        name="phase",
        entry="rahas.tasks.phase:run",
        needs=("ingest", "timeline", "snakes"),
        outputs=lambda scan: (scan.phase,),
        arguments=lambda work: {"calibration": work.calibration_with("snakes")},
        section="phase",
        columns=("role",),
        borrows="snakes",
        libraries=("numpy", "scipy", "numba", "opencv-python-headless", "zarr"),
    ),
    Stage(
        name="calibrate",
        entry="rahas.tasks.calibrate:run",
        needs=("ingest", "timeline", "phase"),
        outputs=lambda scan: (scan.calibration,),
        arguments=lambda work: {"target": work.expedition.target, "texture": work.texture_file()},
        section="calibration",
        columns=("texture_named",),
        files=lambda work: {"target": work.expedition.target, "texture": work.entry.texture},
        libraries=("numpy", "scipy", "opencv-python-headless", "pillow", "zarr"),
    ),
    Stage(
        name="cloud",
        entry="rahas.tasks.cloud:run",
        needs=("ingest", "timeline", "phase"),
        outputs=lambda scan: (scan.cloud, scan.cloud_ply),
        arguments=lambda work: {"calibration": work.calibration_with("calibrate"), "texture": work.texture_file()},
        section="cloud",
        columns=("texture_named",),
        files=lambda work: {"texture": work.entry.texture},
        borrows="calibrate",
        libraries=("numpy", "scipy", "opencv-python-headless", "pillow", "zarr"),
    ),
    Stage(
        name="review_result",
        entry="rahas.tasks.review:run_result",
        needs=("review_capture", "phase", "cloud"),
        outputs=lambda scan: (scan.result_review,),
        arguments=lambda work: {"role": work.entry.role, "capture_params": work.expedition.config.capture_review},
        section="result_review",
        also_reads=("capture_review",),
        columns=("role",),
        libraries=("numpy", "scipy", "opencv-python-headless", "zarr"),
    ),
)
STAGES: Mapping[str, Stage] = {stage.name: stage for stage in _TABLE}

# A scan with reasons in one of these files goes no further.
GATES: Mapping[str, Callable[[ScanFolder], Path]] = {
    "review_capture": lambda scan: scan.capture_review,
    "review_result": lambda scan: scan.result_review,
}
# What a rejected scan does not keep, wherever it was rejected.
WITHDRAWN_WHEN_REJECTED = ("phase", "calibrate", "cloud")


@dataclass(frozen=True)
class Job:
    """What one process makes: up to a stage, and the pages when it is a row's last."""

    name: str
    target: str
    after: tuple[str, ...]  # jobs of the same row
    after_calibration: tuple[str, ...] = ()  # jobs of the row's calibration
    is_last: bool = False

    def reaches(self) -> list[str]:
        """Names of all stages up to its target, in order."""
        return [stage.name for stage in _TABLE if stage.name in _closure(self.target)]

    def stages(self) -> list[Stage]:
        """The stages it may compute that no job before it makes, in order."""
        before = {s for job in self.after for s in _closure(JOBS[job].target)}
        return [stage for stage in _TABLE if stage.name in _closure(self.target) - before]


JOBS: dict[str, Job] = {}
for _job in (
    Job("capture", "review_capture", ()),
    Job("phase", "phase", ("capture",), ("phase",)),
    Job("calibrate", "calibrate", ("phase",), is_last=True),
    Job("surface", "review_result", ("phase",), ("calibrate",), is_last=True),
):
    JOBS[_job.name] = _job


def last_job(entry: Entry) -> Job:
    """The job that ends a row with its page."""
    return JOBS["calibrate" if entry.role == "calibration" else "surface"]


@lru_cache
def _closure(name: str) -> frozenset[str]:
    stage = STAGES[name]
    return frozenset({name}).union(*(_closure(before) for before in (*stage.needs, *stage.gates)))


def stages_before(name: str) -> frozenset[str]:
    """Stage ``name`` and all that has to be made, or has to let the scan through, before it."""
    return _closure(name)


def withdrawn_by(name: str) -> tuple[str, ...]:
    """The stages whose artifacts a scan loses that stage ``name`` rejects: all that follow, and what none keeps."""
    return tuple(
        stage.name
        for stage in _TABLE
        if stage.name in WITHDRAWN_WHEN_REJECTED or (stage.name != name and name in _closure(stage.name))
    )
