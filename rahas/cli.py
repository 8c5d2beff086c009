"""The command line: what the rules call, and what people call beside `snakemake`."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from rahas.errors import ExpeditionError


def main(arguments: list[str] | None = None) -> int:
    """Entry point of ``rahas``; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options) or 0)
    except ExpeditionError as error:
        print(f"rahas: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # `rahas audit | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        print(f"rahas: {error}; nothing was left half-written, run the same command again", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="rahas", description="Measured surfaces from a hand-cranked scanner.")
    commands = parser.add_subparsers(required=True, metavar="command")

    new = commands.add_parser("new", help="make a folder for your own expedition")
    new.add_argument("folder", type=Path)
    new.set_defaults(run=_new)

    simulate = commands.add_parser("simulate", help="render a capture that config/simulation.yaml describes")
    simulate.add_argument("scan_id")
    simulate.add_argument("--expedition", type=Path, default=Path())
    simulate.add_argument("--stamp", type=Path, help=argparse.SUPPRESS)
    simulate.set_defaults(run=_simulate)

    job = commands.add_parser("job", help="run one job of the workflow (called by its rules)")
    job.add_argument("name")
    job.add_argument("scan_id")
    job.add_argument("--stamp", type=Path, required=True)
    _add_expedition(job)
    job.set_defaults(run=_job)

    why = commands.add_parser("why", help="say why a scan has no such artifact; fails if it has none")
    why.add_argument("scan_id")
    why.add_argument("artifact")
    _add_expedition(why)
    why.set_defaults(run=_why)

    summary = commands.add_parser("summary", help="write results/index.html and scans.csv; print the closing lines")
    summary.add_argument("--stamp", type=Path, help=argparse.SUPPRESS)
    _add_expedition(summary)
    summary.set_defaults(run=_summary)

    audit = commands.add_parser("audit", help="check artifacts against their records, and what they were made from")
    audit.add_argument("asked", nargs="*", metavar="ARTIFACT|SCAN", help="with all that it was made from; none: all")
    audit.add_argument("--json", action="store_true", help="print everything as JSON instead of a table")
    audit.add_argument("--explain", action="store_true", help="draw the lineage as a tree")
    audit.add_argument("--dependents", action="store_true", help="only list what was made from it; raw files, too")
    _add_expedition(audit)
    audit.set_defaults(run=_audit)

    diff = commands.add_parser("diff", help="say what changed from one run to another, and by how much")
    side = "an expedition, a results folder, or a run of results/history: 0003, latest, -1 (the one before the latest)"
    diff.add_argument("before", help=side)
    diff.add_argument("after", help="likewise")
    diff.add_argument("--page", type=Path, metavar="FILE.html", help="write a page with difference maps, too")
    diff.add_argument("--json", action="store_true", help="print everything as JSON instead of a table")
    diff.add_argument("--expedition", type=Path, default=Path(), help="whose history is meant; the current folder")
    diff.set_defaults(run=_diff)

    export = commands.add_parser("export", help="write the provenance of all results as an RO-Crate and as a table")
    export.add_argument("--output", type=Path, metavar="FOLDER", help="of the crate; the expedition's own")
    _add_expedition(export)
    export.set_defaults(run=_export)

    config = commands.add_parser("config", help="write config/config.yaml and its schema from the parameter models")
    config.add_argument("--expedition", type=Path, default=Path())
    config.set_defaults(run=_config)
    return parser


def _add_expedition(command: argparse.ArgumentParser) -> None:
    command.add_argument("--expedition", type=Path, default=Path())
    command.add_argument("--options", default="{}", help="the keys of snakemake --config, as JSON")


def _new(options: argparse.Namespace) -> None:
    from rahas.tasks import new

    new.run(options.folder)


def _simulate(options: argparse.Namespace) -> None:
    from rahas.tasks import render
    from rahas.tasks.plan import write_stamp

    root = options.expedition.resolve()
    render.run(root, options.scan_id)
    if options.stamp:
        write_stamp(root / options.stamp, {"rendered": options.scan_id})


def _job(options: argparse.Namespace) -> None:
    _one_thread_each()
    from rahas.tasks import job
    from rahas.tasks.expedition import open_expedition

    expedition = open_expedition(options.expedition.resolve(), json.loads(options.options))
    job.run(expedition, options.name, options.scan_id, expedition.root / options.stamp)


def _why(options: argparse.Namespace) -> int:
    from rahas.tasks import why
    from rahas.tasks.expedition import open_expedition

    expedition = open_expedition(options.expedition.resolve(), json.loads(options.options))
    return why.run(expedition, options.scan_id, options.artifact)


def _summary(options: argparse.Namespace) -> None:
    from rahas.tasks import summary
    from rahas.tasks.expedition import open_expedition
    from rahas.tasks.plan import Plan, write_stamp

    expedition = open_expedition(options.expedition.resolve(), json.loads(options.options))
    closing = summary.run(expedition.results, expedition.entries, unfinished=Plan(expedition).unfinished())
    if options.stamp:
        write_stamp(expedition.root / options.stamp, {"rows": len(expedition.entries)})
    print(closing, file=sys.stderr)
    if expedition.skipped:
        print("Left out of the log by skip_bad_rows:", *expedition.skipped, sep="\n  ", file=sys.stderr)


def _audit(options: argparse.Namespace) -> int:
    from rahas.tasks import audit
    from rahas.tasks.expedition import open_expedition

    expedition = open_expedition(options.expedition.resolve(), json.loads(options.options))
    asks = {"as_json": options.json, "explain": options.explain, "show_dependents": options.dependents}
    return audit.run(expedition, options.asked, **asks)


def _diff(options: argparse.Namespace) -> int:
    _one_thread_each()
    from rahas.tasks import diff

    return diff.run(
        options.before, options.after, expedition=options.expedition, page=options.page, as_json=options.json
    )


def _export(options: argparse.Namespace) -> None:
    from rahas.tasks import export
    from rahas.tasks.expedition import open_expedition

    expedition = open_expedition(options.expedition.resolve(), json.loads(options.options))
    exported = export.run(expedition, options.output)
    print(f"{exported.crate} and {exported.table.name}: {exported.actions} actions")


def _config(options: argparse.Namespace) -> None:
    from rahas.stores.config import write_defaults

    write_defaults(options.expedition)


def _one_thread_each() -> None:
    """Jobs run side by side: each keeps to one core where libraries would take all."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")


if __name__ == "__main__":
    sys.exit(main())
