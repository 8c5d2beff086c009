"""Where everything of a scan lies below results/."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class ScanFolder:
    """The artifacts of one row of the field log, by name."""

    results: Path
    scan_id: str

    @property
    def path(self) -> Path:
        return self.results / self.scan_id

    @property
    def frames(self) -> Path:
        return self.path / "frames.zarr"

    @property
    def timeline(self) -> Path:
        return self.path / "timeline.json"

    @property
    def capture_review(self) -> Path:
        """First QA gate: what the capture shows."""
        return self.path / "review" / "capture.json"

    @property
    def snakes(self) -> Path:
        return self.path / "snakes.zarr"

    @property
    def phase(self) -> Path:
        return self.path / "phase.zarr"

    @property
    def calibration(self) -> Path:
        return self.path / "calibration.json"

    @property
    def cloud(self) -> Path:
        return self.path / "cloud.zarr"

    @property
    def cloud_ply(self) -> Path:
        return self.path / "cloud.ply"

    @property
    def result_review(self) -> Path:
        """Second QA gate: what the result shows."""
        return self.path / "review" / "result.json"

    @property
    def qa(self) -> Path:
        return self.path / "qa.json"

    @property
    def report(self) -> Path:
        return self.path / "report.html"

    @property
    def figures(self) -> Path:
        return self.path / "figures"

    @property
    def records(self) -> Path:
        """Provenance records, one a stage."""
        return self.path / "provenance"
