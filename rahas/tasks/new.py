"""A folder for an expedition of one's own, ready to fill."""

from __future__ import annotations

from pathlib import Path

from rahas.errors import ExpeditionError
from rahas.stores.atomic import write_text
from rahas.stores.config import generate_default_yaml

LOG_HEADER = "scan_id,site,subject,date,time,operator,role,calibration,redundant_of,capture,texture,decision,notes\n"
TARGET_HEADER = "mark,x_mm,y_mm,z_mm,diameter_mm\n"


def run(folder: Path) -> None:
    """Make the folder; nothing that is there is overwritten.

    Raises
    ------
    ExpeditionError
        The folder holds a field log already.
    """
    if (folder / "field_log.csv").exists():
        raise ExpeditionError(f"{folder}: there is a field_log.csv already; nothing was changed")
    write_text(folder / "field_log.csv", LOG_HEADER)
    for path, text in (
        (folder / "config" / "config.yaml", generate_default_yaml()),
        (folder / "config" / "target.csv", TARGET_HEADER),
    ):
        if not path.exists():
            write_text(path, text)
    (folder / "captures").mkdir(parents=True, exist_ok=True)
    print(
        f"{folder}: put the videos into captures/, a row for each into field_log.csv, the marks of your target into "
        f"config/target.csv; then\n  snakemake --cores 2 --snakefile {_snakefile()} --directory {folder}"
    )


def _snakefile() -> str:
    root = Path(__file__).resolve().parents[2] / "Snakefile"
    return str(root) if root.is_file() else "Snakefile"
