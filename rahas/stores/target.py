"""The calibration target's table: 18 marks on a roof of two planes, in mm relative to mark 1."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.stores.csv_table import Row, TableUnreadable, read_table, shown

MARKS = 18
LARGEST = 1e6
"""mm; no target is a kilometre wide"""
COORDINATES = ("x_mm", "y_mm", "z_mm")
_THINNEST_SHARE = 1e-3  # of the target's length: less depth than this counts as flat


class Mark(NamedTuple):
    """One dark round mark: x right, y up, z towards the camera."""

    mark: int
    x_mm: float
    y_mm: float
    z_mm: float
    diameter_mm: float | None


def read_target(path: Path) -> list[Mark]:
    """Read ``target.csv``: columns mark, x_mm, y_mm, z_mm and, optional, diameter_mm; rows in any order.

    Returns the marks in the order of their numbers. A decimal comma is read where the comma is not the separator.

    Raises
    ------
    CaptureProblem
        (rule ``calibration``, metric ``target``) The table is missing or does not describe the target.
    """
    try:
        table = read_table(
            path, known_columns=("mark", *COORDINATES, "diameter_mm"), needed_columns=("mark", *COORDINATES)
        )
    except TableUnreadable as error:
        raise _problem(str(error)) from None
    faults: list[str] = []
    marks = [_mark(path.name, row, table.delimiter, faults) for row in table.rows]
    numbers = [mark.mark for mark in marks]
    if not faults:
        faults += [
            f"{path.name}: mark {n} stands there more than once" for n in sorted({*numbers}) if numbers.count(n) > 1
        ]
        if sorted({*numbers}) != list(range(1, MARKS + 1)):
            faults.append(f"{path.name}: read the marks {_ranges(numbers)}, expected 1 to {MARKS}, each once")
    if not faults:
        faults += _shape_faults(path.name, marks)
    if faults:
        raise _problem("; ".join(faults))
    return sorted(marks)


def _mark(name: str, row: Row, delimiter: str, faults: list[str]) -> Mark:
    def number(column: str) -> float:
        text = row.cells[column].strip()
        try:
            value = float(text if delimiter == "," else text.replace(",", "."))
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:  # NaN as well
            unit = "" if column == "mark" else " of mm"
            faults.append(f"{name}, row {row.line}, column {column}: read {shown(text)}, expected a number{unit}")
            return 0.0
        return value

    if row.overhang:
        faults.append(
            f"{name}, row {row.line}: read {shown(row.overhang[0])} after the last column, expected no more cells"
        )
    mark = number("mark")
    if mark != int(mark):
        faults.append(f"{name}, row {row.line}, column mark: read {mark}, expected a whole number from 1 to {MARKS}")
    diameter = number("diameter_mm") if row.cells.get("diameter_mm", "").strip() else None
    if diameter is not None and diameter <= 0:
        faults.append(f"{name}, row {row.line}, column diameter_mm: read {diameter:g}, expected more than 0")
    x_mm, y_mm, z_mm = (number(column) for column in COORDINATES)
    return Mark(int(mark), x_mm, y_mm, z_mm, diameter)


def _shape_faults(name: str, marks: list[Mark]) -> list[str]:
    points = np.array([(m.x_mm, m.y_mm, m.z_mm) for m in marks])
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    length = float(distance.max())
    if length == 0 or np.count_nonzero(distance <= 1e-6 * length) > len(marks):
        return [f"{name}: two marks have the same place; expected {MARKS} different places"]
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] <= _THINNEST_SHARE * length:
        return [f"{name}: all marks lie in one plane; expected two planes that meet in a ridge"]
    return []


def _ranges(numbers: list[int]) -> str:
    return shown(", ".join(str(n) for n in sorted(numbers))) if numbers else "none"


def _problem(fault: str) -> CaptureProblem:
    return CaptureProblem(
        "calibration",
        "target",
        f"The calibration target's table cannot be used: {fault}. "
        f"Measure the target's {MARKS} marks and write them into config/target.csv (mark,x_mm,y_mm,z_mm).",
    )
