"""A log or a configuration that cannot be trusted is refused before anything runs, and none of its text is executed."""

from __future__ import annotations

import pytest

from tests.workflow.expedition import ROWS, Expedition, Run, row

HEADER = "scan_id,site,notes,decision\n"


def refused(expedition: Expedition, *arguments: str) -> Run:
    """Run; it has to fail without having done anything."""
    before = sorted(p.name for p in expedition.root.iterdir() if p.name != ".snakemake")
    run = expedition.run(*arguments)
    assert run.status != 0, run.output
    assert "Traceback (most recent" not in run.output
    assert sorted(p.name for p in expedition.root.iterdir() if p.name != ".snakemake") == before
    assert run.started == set()
    return run


def assert_told(run: Run, *facts: str) -> None:
    """One line of the output holds all the facts."""
    assert any(all(fact in line for fact in facts) for line in run.output.splitlines()), (facts, run.output)


def test_wrong_rows(expedition: Expedition) -> None:
    """All that is wrong is told in one go, each with row, column, what was read and what is expected."""
    injected = expedition.root / "executed"
    expedition.log(
        [
            *ROWS,
            row("ROCK"),
            row("it's"),
            row(f"$(touch {injected})"),
            row("`touch executed`"),
            row("index"),
            row("lost", calibration="nobody"),
            row("a", role="calibration", calibration="b"),
            row("b", role="calibration", calibration="a"),
            row("out", capture="../../etc/passwd"),
            row("maybe", decision="perhaps"),
        ]
    )
    run = refused(expedition)
    for line, column, read, expected in (
        (5, "scan_id", "'ROCK'", "row 3 has 'rock' already"),
        (6, "scan_id", '"it\'s"', "letters, digits"),
        (7, "scan_id", "'$(touch", "letters, digits"),
        (8, "scan_id", "'`touch executed`'", "letters, digits"),
        (9, "scan_id", "'index'", "names of the results folder"),
        (10, "calibration", "'nobody'", "the scan_id of another row"),
        (11, "calibration", "'b'", "no cycle: a → b → a"),
        (12, "calibration", "'a'", "no cycle: b → a → b"),
        (13, "capture", "'../../etc/passwd'", "'..' is refused"),
        (14, "decision", "'perhaps'", "keep, reject or nothing"),
    ):
        assert_told(run, f"field_log.csv, row {line}, column {column}", f"read {read}", expected)
    assert not list(expedition.root.rglob("executed"))


def test_wrong_rows_left_out(finished: Expedition) -> None:
    finished.log([*ROWS, row("far"), row("it's"), row("new", capture="far.mkv", decision="reject")])
    assert finished.run().status != 0
    run = finished.run("--config", "skip_bad_rows=true")
    assert run.status == 0, run.output
    assert run.started == {"new"}
    assert finished.verdict("new") == "not_processed: operator"
    closing = run.output[run.output.index("4 captures:") :]
    assert "field_log.csv, row 5, column scan_id: read 'far'" in closing
    assert 'field_log.csv, row 6, column scan_id: read "it\'s"' in closing


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, ("field_log.csv", "there is no such file")),
        ("scan_id,site,notes\na,b,c\n", ("field_log.csv, row 1", "column decision is missing", "scan_id,site,notes")),
        (HEADER.encode() + b"a,R\xedo,,\n", ("field_log.csv, row 2", "0xed", "UTF-8")),
    ],
)
def test_no_log_to_read(expedition: Expedition, text: str | bytes | None, told: tuple[str, ...]) -> None:
    log = expedition.root / "field_log.csv"
    log.unlink()
    if text is not None:
        log.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert_told(refused(expedition), *told)


def test_wrong_configuration(expedition: Expedition) -> None:
    expedition.configure(
        "capture_review:\n  min_object_spam: 0.4\n  max_jitter_px: .nan\n"
        "phase:\n  method: magic\nclouds:\n  deband: 1\n"
    )
    run = refused(expedition)
    for line, key, read in (
        (2, "capture_review.min_object_spam", "an unknown key (is it min_object_span?)"),
        (3, "capture_review.max_jitter_px", "nan"),
        (5, "phase.method", "'magic'"),
        (6, "clouds", "an unknown key (is it cloud?)"),
    ):
        assert_told(run, f"config/config.yaml, line {line}, key {key}", f"read {read}", "expected")


@pytest.mark.parametrize("name", ["config/config.yaml", "config.yaml"])
def test_configuration_is_data(expedition: Expedition, name: str) -> None:
    """Neither Snakemake's template language nor YAML's tags run anything."""
    code = f"open('{expedition.root / 'executed'}', 'w')"
    (expedition.root / name).write_text(f'__use_yte__: true\n?{code}: 1\nx: !!python/object/apply:os.system ["ls"]\n')
    run = expedition.run("--dry-run")
    assert not (expedition.root / "executed").exists()
    if name.startswith("config/"):
        assert run.status != 0
        assert "config/config.yaml" in run.output


def test_files_of_an_expedition_are_not_imported(finished: Expedition) -> None:
    for name in ("json.py", "numpy.py", "snakemake.py"):
        (finished.root / name).write_text(f"open({str(finished.root / 'executed')!r}, 'w')\n")
    (finished.scan("far") / "report.html").unlink()
    run = finished.run()
    assert run.status == 0, run.output
    assert run.pages == ["far"]
    assert not (finished.root / "executed").exists()


def test_unknown_options(expedition: Expedition) -> None:
    run = refused(expedition, "--config", "include_rejcted=far")
    assert_told(run, "--config", "'include_rejcted'", "include_rejected, skip_bad_rows")
    assert_told(refused(expedition, "--config", "include_rejected=rok"), "include_rejected", "'rok'")


BOOK = """\
setups: {bench: {}}
captures:
  new: {setup: bench, scene: {kind: circle}, camera: {frame_rat: 30}}
"""


def test_wrong_simulation_book(finished: Expedition) -> None:
    """Refused before the run, with the place; but only where a capture has to be rendered from it."""
    (finished.root / "config" / "simulation.yaml").write_text(BOOK)
    finished.log([*ROWS, row("new", capture="simulated/new.mkv")])
    told = ("config/simulation.yaml, line 3, key captures.new.camera.frame_rat", "read 30")
    assert_told(refused(finished), *told)
    finished.log([*ROWS, row("new", capture="simulated/new.mkv", decision="reject")])
    run = finished.run()
    assert run.status == 0, run.output
    assert finished.verdict("new") == "not_processed: operator"
