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
    from rahas.tasks import simulate
    from rahas.tasks.plan import write_stamp

    root = options.expedition.resolve()
    simulate.run(spec_path=root / "config" / "simulation.yaml", scan_id=options.scan_id, captures=root / "captures")
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


def _config(options: argparse.Namespace) -> None:
    from rahas.stores.config import write_defaults

    write_defaults(options.expedition)


def _one_thread_each() -> None:
    """Jobs run side by side: each keeps to one core where libraries would take all."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")


if __name__ == "__main__":
    sys.exit(main())
