"""Tables as people save them: UTF-8 with or without byte-order mark, any separator, quoted multi-line cells."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

DELIMITERS = (",", ";", "\t")


class TableUnreadable(ValueError):
    """The file is no table at all; the message says what was read and what is expected."""


@dataclass(frozen=True)
class Row:
    """One record: ``cells`` by column name, as typed; ``overhang`` holds filled cells that no column stands over."""

    line: int
    cells: dict[str, str]
    overhang: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """Column names in their order and the rows that hold anything."""

    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    delimiter: str


def read_table(path: Path, *, known_columns: Iterable[str], needed_columns: Iterable[str]) -> Table:
    """Read a delimited table; known column names are matched whatever their case and the blanks around them.

    ``line`` of a row is the 1-based line of the file on which the record starts. Rows of empty cells are passed over.

    Raises
    ------
    TableUnreadable
        No such file, not UTF-8, no header, a needed column missing, a column twice, a quote that does not close.
    """
    text = _text_of(path)
    known = {name.casefold(): name for name in known_columns}
    delimiter = max(DELIMITERS, key=lambda d: _recognised(text, d, known))
    records = _records(path, text, delimiter)
    no_record: tuple[int, list[str]] = (1, [])
    header_line, header = next(records, no_record)
    if not header:
        raise TableUnreadable(f"{path.name}: the file is empty; expected a header row with {_listed(needed_columns)}")
    columns = [known.get(cell.strip().casefold(), cell.strip()) for cell in header]
    missing = [name for name in needed_columns if name not in columns]
    if missing:
        raise TableUnreadable(
            f"{path.name}, row {header_line}: column {_listed(missing)} is missing; read the header "
            f"{shown(delimiter.join(header))}, expected the columns {_listed(needed_columns)} "
            "(separated by comma, semicolon or tab)"
        )
    twice = sorted({name for name in columns if name and columns.count(name) > 1})
    if twice:
        raise TableUnreadable(
            f"{path.name}, row {header_line}: column {_listed(twice)} stands there more than once; expected once"
        )
    rows = tuple(_row(line, columns, cells) for line, cells in records)
    return Table(tuple(name for name in columns if name), rows, delimiter)


def shown(text: object, limit: int = 80) -> str:
    """What was read, in quotes and short enough for a message."""
    written = repr(text)
    return written if len(written) <= limit else f"{written[: limit - 2]}…{written[-1]}"


def _text_of(path: Path) -> str:
    if not path.is_file():
        raise TableUnreadable(f"{path.name}: there is no such file in {path.parent}")
    data = path.read_bytes()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise TableUnreadable(
            f"{path.name}, row {line}: read the byte 0x{data[error.start]:02x}, which is not UTF-8; "
            "expected UTF-8 (in a spreadsheet: Save as, CSV UTF-8)"
        ) from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise TableUnreadable(f"{path.name}, row {line}: read a zero byte; expected text in UTF-8")
    return text


def _recognised(text: str, delimiter: str, known: dict[str, str]) -> int:
    try:
        header = next((cells for cells in _reader(text, delimiter) if any(cells)), list[str]())
    except csv.Error:
        return 0
    return sum(cell.strip().casefold() in known for cell in header)


def _reader(text: str, delimiter: str) -> Any:
    return csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)


def _records(path: Path, text: str, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    reader = _reader(text, delimiter)
    while True:
        line = reader.line_num + 1
        try:
            cells = next(reader, None)
        except csv.Error as error:
            raise TableUnreadable(
                f"{path.name}, row {line}: the quotes do not fit ({error}); expected a cell with a quote, a line break "
                "or the separator in it to stand between quotes, and each quote inside it written twice"
            ) from None
        if cells is None:
            return
        if any(cell.strip() for cell in cells):
            yield line, cells


def _row(line: int, columns: list[str], cells: list[str]) -> Row:
    padded = cells + [""] * (len(columns) - len(cells))
    overhang = [cell for name, cell in zip(columns, padded, strict=False) if not name and cell.strip()]
    overhang += [cell for cell in padded[len(columns) :] if cell.strip()]
    return Row(line, {name: cell for name, cell in zip(columns, padded, strict=False) if name}, tuple(overhang))


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)
