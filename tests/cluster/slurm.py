"""A real Slurm of one node on this machine, without systemd: started, asked and stopped. Needs root.

`python -m tests.cluster.slurm FOLDER` starts one and stops it when its standard input is closed.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "setpriv")
PATIENCE_S = 120.0
CONFIGURATION = """\
ClusterName=rahas
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CryptoType=crypto/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldDebug=verbose
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill
AccountingStorageType=accounting_storage/none
MpiDefault=none
SchedulerParameters=sched_interval=2,batch_sched_delay=0
ReturnToService=2
JobRequeue=0
SlurmdTimeout=30
MinJobAge=300
KillWait=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory_mb} State=UNKNOWN
PartitionName=work Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


class Slurm:
    """munged, slurmctld and slurmd in a folder of their own: nothing of the machine's own Slurm is touched."""

    def __init__(self, folder: Path, *, cpus: int = 2) -> None:
        self.folder, self.cpus = folder, cpus
        self.configuration = folder / "slurm.conf"
        self._munged: subprocess.Popen[bytes] | None = None
        self._controller: subprocess.Popen[bytes] | None = None
        self._node: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Slurm:
        try:
            self.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    @property
    def environment(self) -> dict[str, str]:
        """What Slurm's commands need to find this cluster and no other; the commands stand first in the path."""
        return {"SLURM_CONF": str(self.configuration), "PATH": f"{self.folder / 'bin'}:{_path()}"}

    def start(self) -> None:
        """Start the daemons; return when the node is idle."""
        missing = [name for name in PROGRAMS if shutil.which(name, path=_path()) is None]
        if missing or os.geteuid() != 0:
            raise RuntimeError(f"missing {', '.join(missing) or 'root'}: run `make cluster-test` as root on Debian")
        self.folder.mkdir(parents=True, exist_ok=True)
        self.folder.chmod(0o755)
        for name in ("state", "spool"):
            (self.folder / name).mkdir(exist_ok=True)
        self._start_munge()
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") >> 20
        text = CONFIGURATION.format(
            host=socket.gethostname().split(".")[0], folder=self.folder, cpus=self.cpus, memory_mb=memory * 9 // 10,
            controller_port=_free_port(), node_port=_free_port(),
        )  # fmt: skip
        self.configuration.write_text(text, encoding="ascii")
        srun = self.folder / "bin" / "srun"  # the plugin's job step forgets SLURM_CONF
        srun.parent.mkdir(exist_ok=True)
        srun.write_text(f'#!/bin/sh\nSLURM_CONF={self.configuration} exec {shutil.which("srun", path=_path())} "$@"\n')
        srun.chmod(0o755)
        self._controller = self._daemon("slurmctld", "-D")
        self.start_node()

    def start_node(self) -> None:
        """Start slurmd, at first or after :meth:`kill_node`; return when the node takes jobs."""
        self._node = self._daemon("slurmd", "-D")
        _wait("the node to take jobs", lambda: self._state_of_node() in ("idle", "mixed", "allocated"))

    def kill_node(self) -> None:
        """kill -9 of slurmd and of every step that it runs, as when a node loses its power."""
        assert self._node is not None
        for pid in (*self.managers(), *self.processes()):
            _kill(pid)
        self._node.kill()
        self._node.wait()

    def managers(self) -> list[int]:
        """The slurmstepd processes of this cluster's node."""
        return [pid for pid, name in self._named().items() if name.startswith("slurmstepd")]

    def processes(self) -> list[int]:
        """All that the node's jobs run, below their managers."""
        managers = self.managers()
        found = list(managers)
        parents = {int(p.name): _parent(p) for p in Path("/proc").glob("[0-9]*")}
        for pid in found:  # which grows meanwhile
            found += [child for child, parent in parents.items() if parent == pid and child not in found]
        return [pid for pid in found if pid not in managers]

    def _named(self) -> dict[int, str]:
        """Names of the processes that this cluster's slurmd started."""
        found = {}
        for process in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):  # it has just ended
                if str(self.configuration).encode() in (process / "environ").read_bytes():
                    found[int(process.name)] = (process / "comm").read_text().strip()
        return found

    def run(self, *command: str) -> str:
        """Output of one of Slurm's commands."""
        return subprocess.run(command, env=self.environment, check=True, capture_output=True, text=True).stdout

    def jobs(self) -> list[str]:
        """Ids of the jobs that wait or run."""
        return self.run("squeue", "--noheader", "--format=%i", "--states=PD,R,CF,CG").split()

    def submitted(self) -> int:
        """Number of batch jobs that the controller has taken since it was started, by its log."""
        return (self.folder / "slurmctld.log").read_text(errors="replace").count("_slurm_rpc_submit_batch_job: JobId=")

    def stop(self) -> None:
        """End all jobs and daemons, whatever state they are in."""
        if self._controller is not None and self._controller.poll() is None:
            subprocess.run(["scancel", "--user=root", "--full"], env=self.environment, check=False, timeout=20)
        for pid in (*self.managers(), *self.processes()):
            _kill(pid)
        for daemon in (self._node, self._controller, self._munged):
            if daemon is not None and daemon.poll() is None:
                daemon.terminate()
                try:
                    daemon.wait(timeout=10)
                except subprocess.TimeoutExpired:
                    daemon.kill()
                    daemon.wait()

    def _start_munge(self) -> None:
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        files = [f"--{name}-file={self.folder}/munge.{name}" for name in ("key", "log", "pid", "seed")]
        command = ["munged", "--foreground", "--force", f"--socket={self.folder}/munge.socket"]
        self._munged = self._daemon(*command, *(f for f in files if "log" not in f))
        _wait("munged", (self.folder / "munge.socket").exists)

    def _daemon(self, *command: str) -> subprocess.Popen[bytes]:
        dies_with_us = ("setpriv", "--pdeathsig", "TERM")  # even after kill -9 of what started it
        with open(self.folder / f"{command[0]}.out", "ab") as output:
            return subprocess.Popen(
                [*dies_with_us, *command], env={"HOME": "/root", **self.environment}, stdin=subprocess.DEVNULL,
                stdout=output, stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip

    def _state_of_node(self) -> str:
        try:
            return self.run("sinfo", "--noheader", "--format=%T").strip()
        except subprocess.CalledProcessError:
            return ""


def _parent(process: Path) -> int:
    try:
        return int((process / "stat").read_text().rpartition(")")[2].split()[1])
    except (OSError, IndexError):  # it has just ended
        return 0


def _path() -> str:
    return "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def _free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


def _kill(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError):  # it has just ended
        os.kill(pid, signal.SIGKILL)


def _wait(what: str, condition: Callable[[], bool]) -> None:
    limit = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > limit:
            raise TimeoutError(f"waited {PATIENCE_S:.0f} s for {what}: see the logs in the cluster's folder")
        time.sleep(0.2)


if __name__ == "__main__":
    with Slurm(Path(sys.argv[1]).resolve()) as cluster:
        print(f"export SLURM_CONF={cluster.configuration}", flush=True)
        sys.stdin.read()
