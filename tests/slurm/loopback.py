"""SLURM on one node, this machine, over the loopback: controller, node daemon and munge, started and ended here."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "squeue")
PLACES = ("/usr/sbin", "/sbin")


def reason_to_skip() -> str | None:
    """Why SLURM cannot be started here, None where it can."""
    lacking = [name for name in PROGRAMS if where(name) is None]
    if lacking:
        return f"SLURM is not installed ({', '.join(lacking)} missing): apt-get install slurm-wlm munge"
    return None if os.geteuid() == 0 else "its daemons must be started as root"


def where(name: str) -> str | None:
    """A program of the system."""
    return shutil.which(name, path=os.pathsep.join([os.environ.get("PATH", ""), *PLACES]))


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def settings(folder: Path, cpus: int) -> str:
    """slurm.conf."""
    host = socket.gethostname().split(".")[0]
    values = {
        "ClusterName": "loopback",
        "SlurmctldHost": f"{host}(127.0.0.1)",
        "SlurmctldPort": free_port(),
        "SlurmdPort": free_port(),
        "AuthType": "auth/munge",
        "AuthInfo": f"socket={folder}/munge/socket",
        "SlurmUser": "root",
        "SlurmdUser": "root",
        "ProctrackType": "proctrack/linuxproc",
        "TaskPlugin": "task/none",
        "SelectType": "select/cons_tres",
        "SelectTypeParameters": "CR_Core",
        "SchedulerType": "sched/builtin",
        "SchedulerParameters": "batch_sched_delay=1,sched_interval=2",
        "SlurmdParameters": "config_overrides",
        "ReturnToService": 2,
        "MpiDefault": "none",
        "JobAcctGatherType": "jobacct_gather/none",
        "AccountingStorageType": "accounting_storage/none",
        "OverTimeLimit": 0,
        "KillWait": 5,
        "MinJobAge": 3600,
        "StateSaveLocation": folder / "state",
        "SlurmdSpoolDir": folder / "spool",
        "SlurmctldPidFile": folder / "slurmctld.pid",
        "SlurmdPidFile": folder / "slurmd.pid",
        "SlurmctldLogFile": folder / "slurmctld.log",
        "SlurmdLogFile": folder / "slurmd.log",
    }
    lines = [f"{key}={value}" for key, value in values.items()]
    lines.append(f"NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} State=UNKNOWN")
    lines.append(f"PartitionName=debug Nodes={host} Default=YES MaxTime=INFINITE State=UP")
    return "\n".join(lines) + "\n"


class Slurm:
    """A running SLURM; end it."""

    def __init__(self, folder: Path, cpus: int = 4) -> None:
        self.folder = folder
        for name in ("state", "spool", "munge"):
            (folder / name).mkdir(parents=True)
        folder.chmod(0o755)
        (folder / "munge").chmod(0o755)
        (folder / "slurm.conf").write_text(settings(folder, cpus))
        self.environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}
        version = re.search(r"(\d+)\.(\d+)", self.ask("slurmctld", "-V"))
        if version is not None and (int(version[1]), int(version[2])) >= (23, 11):
            (folder / "cgroup.conf").write_text("CgroupPlugin=disabled\n")
        self._start_munge()
        self.ask("slurmctld", "-i", "-c")
        self.ask("slurmd", "-c")
        self.wait_for(lambda: "idle" in self.ask("sinfo", "-h", "-o", "%T"), 60)

    def _start_munge(self) -> None:
        home = self.folder / "munge"
        (home / "key").write_bytes(os.urandom(128))
        (home / "key").chmod(0o400)
        names = {"key-file": "key", "socket": "socket", "pid-file": "pid", "log-file": "log", "seed-file": "seed"}
        self.ask("munged", "--force", *(f"--{option}={home / name}" for option, name in names.items()))

    def ask(self, *words: object) -> str:
        """What a command of SLURM says; refuses one that fails."""
        line = [where(str(words[0])) or str(words[0]), *map(str, words[1:])]
        done = subprocess.run(line, env=self.environment, capture_output=True, text=True, check=False, timeout=60)
        assert done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
        return done.stdout

    def states(self) -> dict[str, str]:
        """State of every job that the controller knows, by its name (JOB_TASK)."""
        rows = self.ask("squeue", "-h", "-r", "-t", "all", "-o", "%i %T").split("\n")
        return dict(row.split() for row in rows if row)

    def sound_states(self) -> dict[str, str]:
        """The same, where no job has failed."""
        found = self.states()
        assert "FAILED" not in found.values(), f"{found}\n{self.log()}"
        return found

    def wait_for(self, condition: Callable[[], object], seconds: float) -> None:
        """Wait until the condition holds."""
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"{self.states()}\n{self.log()}"
            time.sleep(0.5)

    def log(self) -> str:
        """The end of what the controller wrote."""
        path = self.folder / "slurmctld.log"
        return path.read_text(errors="replace")[-3000:] if path.exists() else ""

    def end(self) -> None:
        """Kill all jobs and end the daemons that were started here; wait until they are gone."""
        with suppress(AssertionError, subprocess.TimeoutExpired):
            for job in {name.split("_")[0] for name in self.states()}:
                self.ask("scancel", "--signal=KILL", "--full", job)
                self.ask("scancel", job)
        pids = []
        for file in ("slurmd.pid", "slurmctld.pid", "munge/pid"):
            with suppress(OSError, ValueError):
                pids.append(int((self.folder / file).read_text()))
        for kind in (signal.SIGTERM, signal.SIGKILL):
            for pid in pids:
                with suppress(ProcessLookupError):
                    os.kill(pid, kind)
            end = time.monotonic() + 10
            while any(_runs(pid) for pid in pids) and time.monotonic() < end:
                time.sleep(0.2)


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
