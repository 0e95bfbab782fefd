"""A part of the workflow on a Slurm cluster of one node, through the profile."""

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from project import REPOSITORY, copy_repository

# Where a job's own srun looks for it: the executor passes no variables of Slurm on.
CONF = Path("/etc/slurm/slurm.conf")
DAEMONS = ("munged", "slurmctld", "slurmd")
SLURM_CONF = """
ClusterName=test
SlurmctldHost={host}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CryptoType=crypto/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
AccountingStorageType=accounting_storage/none
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort=16817
SlurmdPort=16818
MinJobAge=300
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory=6000 State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def test_the_profile_asks_for_what_a_cluster_needs() -> None:
    profile = yaml.safe_load((REPOSITORY / "profiles" / "slurm" / "config.yaml").read_text())
    default = yaml.safe_load((REPOSITORY / "profiles" / "default" / "config.yaml").read_text())
    assert profile["executor"] == "slurm"
    assert {"slurm_partition", "mem_mb", "runtime"} <= set(profile["default-resources"])
    # What decides on reruns must not depend on where the jobs run.
    for name in ("rerun-triggers", "max-checksum-file-size", "rerun-incomplete", "keep-going"):
        assert profile[name] == default[name]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Path]:
    """A cluster of this machine for the time of a test; its folder."""
    if os.geteuid() != 0 or not all(map(shutil.which, DAEMONS)):
        pytest.skip(f"needs root and {', '.join(DAEMONS)}")
    if CONF.exists():
        pytest.skip(f"this machine has a cluster of its own: {CONF}")
    folder = tmp_path / "cluster"
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    CONF.parent.mkdir(exist_ok=True)
    CONF.write_text(SLURM_CONF.format(host=os.uname().nodename, folder=folder, cores=os.cpu_count()))
    munged = ["munged", "--foreground", "--force", f"--socket={folder}/munge.socket", f"--key-file={key}"]
    munged += [
        f"--pid-file={folder}/munged.pid",
        f"--seed-file={folder}/munge.seed",
        f"--log-file={folder}/munged.log",
    ]
    daemons = []
    try:
        for command in (munged, ["slurmctld", "-D", "-c"], ["slurmd", "-D"]):
            daemons.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
            time.sleep(1)
        for _ in range(30):
            state = subprocess.run(["sinfo", "-h", "-o", "%t"], capture_output=True, text=True, check=False)
            if state.stdout.strip() == "idle":
                break
            time.sleep(1)
        else:
            pytest.fail(f"the cluster does not start: {state.stdout} {state.stderr}")
        yield folder
    finally:
        for daemon in reversed(daemons):
            daemon.terminate()
        for daemon in daemons:
            daemon.wait(20)
        CONF.unlink()


@pytest.mark.slow
def test_a_sequence_is_processed_on_the_cluster(cluster: Path, tmp_path: Path) -> None:
    project = copy_repository(tmp_path / "project", "tiny")
    target = "results/it_zero_shot/splits.parquet"
    result = project.run(
        "--profile", "profiles/slurm", "--default-resources", "slurm_partition=main", "mem_mb=1500",
        "runtime=20", "--seconds-between-status-checks", "1", "--latency-wait", "10", target,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout[-3000:]
    assert (project.root / target).is_file()
    done = (cluster / "slurmctld.log").read_text().count("WEXITSTATUS 0")
    assert done >= 4  # simulate, ingest, annotations, splits: each a job of its own
