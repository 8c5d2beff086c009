"""The target's table: any order and separator, and a reason for every table that cannot be the target."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from rahas.errors import CaptureProblem
from rahas.stores.target import Mark, read_target

HEADER = "mark,x_mm,y_mm,z_mm"


def roof() -> list[list[float]]:
    rows = [(x, -abs(x - 30) / 2 + 15.0) for x in (0.0, -35.0, -70.0, 60.0, 95.0, 130.0)]
    return [[n + 1, rows[n // 3][0], -60.0 * (n % 3), rows[n // 3][1]] for n in range(18)]


def table(path: Path, rows: list[list[float]], *, header: str = HEADER, separator: str = ",") -> Path:
    lines = [header.replace(",", separator)] + [separator.join(f"{v:g}" for v in row) for row in rows]
    path.write_text("\n".join(lines), encoding="utf-8-sig")
    return path


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_rows_in_any_order(tmp_path: Path, separator: str) -> None:
    rows = roof()
    random.Random(1).shuffle(rows)
    marks = read_target(table(tmp_path / "target.csv", rows, separator=separator))
    assert [list(mark[:4]) for mark in marks] == roof()
    assert {mark.diameter_mm for mark in marks} == {None}


def test_diameter_and_decimal_comma(tmp_path: Path) -> None:
    path = table(
        tmp_path / "target.csv", [[*row, 12.5] for row in roof()], header=f"{HEADER},diameter_mm", separator=";"
    )
    path.write_text(path.read_text(encoding="utf-8").replace(".", ","), encoding="utf-8")
    assert read_target(path)[3] == Mark(4, -35.0, 0.0, -17.5, 12.5)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows[:17], "read the marks"),
        (lambda rows: [], "read the marks none"),
        (lambda rows: [*rows, rows[0]], "mark 1 stands there more than once"),
        (lambda rows: [*rows[:17], [19, *rows[17][1:]]], "expected 1 to 18"),
        (lambda rows: [*rows[:17], [17.5, *rows[17][1:]]], "a whole number"),
        (lambda rows: [*rows[:17], [18, *rows[0][1:]]], "the same place"),
        (lambda rows: [[*row[:3], 0.0] for row in rows], "one plane"),
        (lambda rows: [[row[0], 0.0, 0.0, 0.0] for row in rows], "the same place"),
        (lambda rows: [*rows[:17], [18, float("nan"), 0, 0]], "row 19, column x_mm: read 'nan', expected a number"),
        (lambda rows: [*rows[:17], [18, 0, float("inf"), 0]], "row 19, column y_mm: read 'inf'"),
        (lambda rows: [*rows[:17], [*rows[17], 5]], "after the last column"),
    ],
)
def test_wrong_tables_reject_with_a_reason(tmp_path: Path, change: object, said: str) -> None:
    path = table(tmp_path / "target.csv", change(roof()))  # type: ignore[operator]
    with pytest.raises(CaptureProblem, match=said) as caught:
        read_target(path)
    assert (caught.value.rule, caught.value.metric) == ("calibration", "target")


@pytest.mark.parametrize(
    ("content", "said"), [(None, "no such file"), ("mark,x_mm,y_mm\n", "z_mm is missing"), ("", "empty")]
)
def test_no_table_at_all(tmp_path: Path, content: str | None, said: str) -> None:
    if content is not None:
        (tmp_path / "target.csv").write_text(content)
    with pytest.raises(CaptureProblem, match=said):
        read_target(tmp_path / "target.csv")
