"""Run a job in place of the interpreter that it was meant for, and note its time, CPU time and peak memory.

Run as a file, by an interpreter without site packages: it adds some milliseconds to a job and no memory.
"""

import json
import os
import sys
import time

log, interpreter, *arguments = sys.argv[1:]
started = time.monotonic()
_, status, used = os.wait4(os.posix_spawn(interpreter, [interpreter, *arguments], os.environ), 0)
entry = {
    "arguments": arguments,
    "wall_s": time.monotonic() - started,
    "cpu_s": used.ru_utime + used.ru_stime,
    "peak_mb": used.ru_maxrss / (1 << (20 if sys.platform == "darwin" else 10)),
}
with open(log, "a", encoding="utf-8") as handle:
    handle.write(json.dumps(entry) + "\n")
sys.exit(os.waitstatus_to_exitcode(status) % 256)
