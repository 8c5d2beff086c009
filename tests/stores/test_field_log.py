"""The field log: what is trusted, what is refused, and how each fault is told."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rahas.errors import ExpeditionError
from rahas.stores.field_log import FieldLog, read_field_log

HEADER = "scan_id,site,notes,decision,role,calibration,capture,texture,redundant_of"


def expedition(folder: Path, *rows: str, header: str = HEADER) -> Path:
    (folder / "captures").mkdir(exist_ok=True)
    (folder / "field_log.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return folder


def faults(folder: Path) -> list[str]:
    with pytest.raises(ExpeditionError) as caught:
        read_field_log(folder)
    return str(caught.value).splitlines()


def calibrations(log: FieldLog) -> dict[str, str | None]:
    return {entry.scan_id: entry.calibration for entry in log.entries}


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("bom", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_reads_what_spreadsheets_save(tmp_path: Path, delimiter: str, bom: bytes, line_end: str) -> None:
    text = io.StringIO()
    writer = csv.writer(text, delimiter=delimiter, lineterminator=line_end)
    note = 'rain; 5" lens, "tired"\nÑandú <b>$(touch x)</b>'
    writer.writerows(
        [["scan_id", "site", "notes", "decision", "Film"], ["a-1", "Cave", note, "keep", "7"], ["b", "C", "", "", ""]]
    )
    (tmp_path / "field_log.csv").write_bytes(bom + text.getvalue().encode())
    first, second = read_field_log(tmp_path).entries
    assert (first.scan_id, first.site, first.notes, first.decision, first.extra) == (
        "a-1",
        "Cave",
        note,
        "keep",
        {"Film": "7"},
    )
    assert (first.line, second.line) == (2, 4), "lines of the file, the note holds a line break"
    assert (first.role, first.capture, first.texture, first.texture_named) == ("scan", None, None, False)


def test_all_faults_at_once_with_row_column_read_and_expected(tmp_path: Path) -> None:
    expedition(
        tmp_path,
        "a b,Cave,,keep,,,,,",
        "Index,Cave,,maybe,,,,,",
        "ok,,,,boss,,../x.mp4,/etc/passwd,",
        "OK,Cave,,,,,,,",
        "c,Cave,,,,nobody,,,ghost",
        "d,Cave,note, with a comma,,,,,,,keep",
    )
    told = faults(tmp_path)
    expected = [
        ("row 2, column scan_id", "'a b'"),
        ("row 3, column scan_id", "'Index'"),
        ("row 3, column decision", "'maybe'"),
        ("row 4, column site", "''"),
        ("row 4, column role", "'boss'"),
        ("row 4, column capture", "'../x.mp4'"),
        ("row 4, column texture", "'/etc/passwd'"),
        ("row 5, column scan_id", "'OK'"),
        ("row 6, column calibration", "'nobody'"),
        ("row 6, column redundant_of", "'ghost'"),
        ("row 7, after the last column", "'keep'"),
    ]
    for place, read in expected:
        matching = [line for line in told if place in line and f"read {read}" in line and "expected" in line]
        assert len(matching) == 1, (place, told)
    row_7_decision = [line for line in told if "row 7, column decision" in line]
    assert len(told) == len(expected) + len(row_7_decision)


@pytest.mark.parametrize(
    "bad_id", ["", "it's", 'say""x', "a b", "-a", "_a", "a" * 65, "é", "../x", "$(id)", "history", "EXPEDITION"]
)
def test_ids_that_are_none(tmp_path: Path, bad_id: str) -> None:
    expedition(tmp_path, f'"{bad_id}",Cave,,keep,,,,,')
    (told,) = faults(tmp_path)
    assert "row 2, column scan_id" in told


@pytest.mark.parametrize(
    "cell",
    [
        "..",
        "a/../../b.mp4",
        "/abs.mp4",
        "~/x.mp4",
        "C:\\x.mp4",
        "..\\x.mp4",
        "captures/../x",
        "captures/",
        ".",
        "a\x07.mp4",
        "\\\\host\\x",
    ],
)
def test_paths_that_leave_the_folder(tmp_path: Path, cell: str) -> None:
    expedition(tmp_path, f"a,Cave,,keep,,,{cell},,", f"b,Cave,,keep,,,,{cell},")
    first, second = faults(tmp_path)
    assert "row 2, column capture" in first
    assert "row 3, column texture" in second


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "there is no such file"),
        (b"", "the file is empty"),
        (b"\n\n,,,\n", "the file is empty"),
        (b"scan_id,site,notes\na,b,c\n", "decision is missing"),
        (b"scan_id,site,notes,decision,Notes\n", "more than once"),
        (b"scan_id,site,notes,decision\na,Cave,caf\xe9,keep\n", "row 2: read the byte 0xe9"),
        (b"\xff\xfes\0c\0", "not UTF-8"),
        (b'scan_id,site,notes,decision\na,Cave,"never closed,keep\nb,Cave,,keep\n', "row 2: the quotes do not fit"),
        (b"scan_id,site,notes,decision\na,Cave,x\0y,keep\n", "row 2: read a zero byte"),
    ],
)
@pytest.mark.parametrize("skip", [False, True])
def test_a_log_that_is_no_table_is_refused_whole(tmp_path: Path, content: bytes | None, said: str, skip: bool) -> None:
    if content is not None:
        (tmp_path / "field_log.csv").write_bytes(content)
    with pytest.raises(ExpeditionError, match=said):
        read_field_log(tmp_path, skip_bad_rows=skip)


def test_skipping_bad_rows_keeps_the_others_and_lists_the_faults(tmp_path: Path) -> None:
    expedition(
        tmp_path,
        "cal,Cave,,keep,calibration,,,,",
        "ca l,Cave,,keep,calibration,,,,",
        "a,Cave,,keep,,cal,,,",
        "A,Cave,,reject,,,,,",
        "b,Cave,,perhaps,,,,,",
        "c,Cave,,keep,,,,,b",
    )
    log = read_field_log(tmp_path, skip_bad_rows=True)
    assert calibrations(log) == {"cal": None, "a": "cal", "c": "cal"}
    assert log.entries[-1].redundant_of is None, "what it repeats was left out"
    assert [line.split(",")[1].strip() for line in log.skipped] == ["row 3", "row 5", "row 6"]
    assert len(faults(tmp_path)) == 3


def test_calibration_is_the_only_one_even_of_another_site(tmp_path: Path) -> None:
    expedition(tmp_path, "a,Cave,,,,,,,", "cal,River,,,calibration,,,,")
    assert calibrations(read_field_log(tmp_path)) == {"a": "cal", "cal": None}


def test_calibration_is_the_nearest_of_the_same_site(tmp_path: Path) -> None:
    expedition(
        tmp_path,
        "early,Cave,,,calibration,,,,",
        "a,Cave,,,,,,,",  # one row from early, two from late
        "x,River,,,,,,,",  # no calibration at the river
        "late,cave ,,,calibration,,,,",
        "b,Cave,,,,,,,",
        "c,Cave,,,,early,,,",
        "d,Cave,,,,,,,",  # as near to the dud as to nothing else: the dud is the operator's reject
        "dud,Cave,,reject,calibration,,,,",
    )
    assert calibrations(read_field_log(tmp_path)) == {
        **{"early": None, "late": None, "dud": None},
        **{"a": "early", "x": None, "b": "late", "c": "early", "d": "late"},
    }


def test_of_two_as_near_the_later_calibration_counts(tmp_path: Path) -> None:
    expedition(tmp_path, "one,C,,,calibration,,,,", "a,C,,,,,,,", "two,C,,,calibration,,,,")
    assert calibrations(read_field_log(tmp_path))["a"] == "two"


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (("a,C,,,calibration,b,,,", "b,C,,,calibration,a,,,"), "a → b → a"),
        (("a,C,,,calibration,a,,,",), "not of this one"),
        (("a,C,,,,b,,,", "b,C,,,,,,,"), "row 3 is a scan"),
        (("a,C,,,,,,,a",), "not of this one"),
        (("Cal1,C,,,calibration,,,,", "b,C,,,,cal1,,,"), r"is it 'Cal1'\?"),
    ],
)
def test_references_that_cannot_be(tmp_path: Path, rows: tuple[str, ...], said: str) -> None:
    expedition(tmp_path, *rows)
    with pytest.raises(ExpeditionError, match=said):
        read_field_log(tmp_path)


def test_captures_and_textures_by_name_and_by_stem(tmp_path: Path) -> None:
    expedition(
        tmp_path,
        "stem,C,,,,,,,",
        "still,C,,,,,,,",
        "named,C,,,,,captures/day 2/GOPR1.MP4,day 2\\photo.tif,",
        "sim,C,,,,,simulated/sim.mkv,simulated/sim_texture.png,",
        "gone,C,,,,,,,",
    )
    captures = tmp_path / "captures"
    for name in (
        "STEM.AVI",
        "stem.txt",
        "stem.json",
        "stem_texture.jpg",
        "stem_texture.tif",
        "stem_texture.cr2",
        ".stem.mp4",
        "gone.txt",
        "gone.xml",
    ):
        (captures / name).touch()
    (captures / "still").mkdir()
    entries = {entry.scan_id: entry for entry in read_field_log(tmp_path).entries}
    found = {
        key: (e.capture and e.capture.relative_to(captures).as_posix(), e.texture and e.texture.name)
        for key, e in entries.items()
    }
    assert found == {
        "stem": ("STEM.AVI", "stem_texture.tif"),
        "still": ("still", None),
        "named": ("day 2/GOPR1.MP4", "photo.tif"),
        "sim": ("simulated/sim.mkv", "sim_texture.png"),
        "gone": (None, None),
    }
    assert [key for key, e in entries.items() if e.texture_named] == ["named", "sim"]
    assert [key for key, e in entries.items() if e.simulated] == ["sim"]


def test_two_captures_of_one_stem_have_to_be_named(tmp_path: Path) -> None:
    expedition(tmp_path, "a,C,,,,,,,", "b,C,,,,,b.mp4,,")
    for name in ("a.mp4", "a.avi", "b.mp4", "b.avi"):
        (tmp_path / "captures" / name).touch()
    (told,) = faults(tmp_path)
    assert "row 2, column capture" in told
    assert "a.avi and a.mp4" in told


@settings(max_examples=60, deadline=None)
@given(
    notes=st.lists(
        st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=40), min_size=1, max_size=4
    )
)
def test_any_note_comes_back_as_typed(tmp_path_factory: pytest.TempPathFactory, notes: list[str]) -> None:
    folder = tmp_path_factory.mktemp("expedition")
    with open(folder / "field_log.csv", "w", encoding="utf-8", newline="") as handle:
        writer = csv.writer(handle, quoting=csv.QUOTE_ALL)
        writer.writerow(["scan_id", "site", "notes", "decision"])
        writer.writerows([f"s{n}", "Cave", note, "keep"] for n, note in enumerate(notes))
    assert [entry.notes for entry in read_field_log(folder).entries] == notes


@settings(max_examples=80, deadline=None)
@given(data=st.binary(max_size=200), header=st.booleans())
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes, header: bool) -> None:
    folder = tmp_path_factory.mktemp("expedition")
    (folder / "field_log.csv").write_bytes((HEADER.encode() + b"\n" if header else b"") + data)
    refusal = ""
    try:
        read_field_log(folder)
    except ExpeditionError as error:
        refusal = str(error)
    assert refusal == "" or "field_log.csv" in refusal
