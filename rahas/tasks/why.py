"""Why an artifact that was asked for by name is not there."""

from __future__ import annotations

import sys

from rahas.stores.atomic import read_json
from rahas.tasks.expedition import Expedition


def run(expedition: Expedition, scan_id: str, artifact: str) -> int:
    """Return 0 if the artifact lies there; else print the reason and return 1."""
    scan = expedition.scan(scan_id)
    if (scan.path / artifact).exists():
        return 0
    print(f"rahas: results/{scan_id}/{artifact} is not made.", file=sys.stderr)
    if scan.qa.is_file():
        qa = read_json(scan.qa)
        print(f"rahas: {scan_id} is {qa['verdict'].replace('_', ' ')}:", file=sys.stderr)
        for reason in qa["reasons"]:
            print(f"  {reason['rule']}: {reason['message']}", file=sys.stderr)
        print(
            f"  `--config include_rejected={scan_id}` processes it all the same where that can be done.",
            file=sys.stderr,
        )
    return 1
