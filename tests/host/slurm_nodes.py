"""A Slurm of two nodes on this machine: a controller, two slurmd and munge, with a configuration of its own."""
import os
import pwd
import shutil
import signal
import subprocess
import time
from pathlib import Path

import support

PROGRAMS = ("sbatch", "squeue", "scancel", "sinfo", "slurmctld", "slurmd", "munged")
CONFIGURATION = """\
ClusterName=narpa
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort={controller_port}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=2,bf_interval=2
StateSaveLocation={folder}/state
SlurmctldPidFile={folder}/controller.pid
SlurmctldLogFile={folder}/controller.log
SlurmdSpoolDir={folder}/%n
SlurmdPidFile={folder}/%n.pid
SlurmdLogFile={folder}/%n.log
SlurmdTimeout=6
ReturnToService=2
NodeName=n1 NodeHostname=localhost NodeAddr=127.0.0.1 Port={port_1} CPUs=1
NodeName=n2 NodeHostname=localhost NodeAddr=127.0.0.1 Port={port_2} CPUs=1
PartitionName=both Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
"""


def check_installed():
    os.environ["PATH"] += ":/usr/sbin"
    missing = [p for p in PROGRAMS if not shutil.which(p)]
    if missing:
        support.skip(f"no {', '.join(missing)} (slurmctld, slurmd, slurm-client, munge)")
    if os.geteuid() != 0:
        support.skip("slurmd starts tasks as another user and needs root")


def parent_of(process):
    try:
        return int(Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[1])
    except OSError:
        return None


def kill(process):
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        pass


class Cluster:
    """`with Cluster() as cluster:`; its environment is this process's: sbatch and narpa find it."""

    def __init__(self):
        self.folder = support.work_folder()
        self.folder.chmod(0o755)  # munge refuses a socket that others cannot reach
        self.started, self.nodes = [], {}

    def __enter__(self):
        for name in ("state", "n1", "n2"):
            (self.folder / name).mkdir()
        ports = dict(controller_port=support.free_port(), port_1=support.free_port(), port_2=support.free_port())
        configuration = self.folder / "slurm.conf"
        configuration.write_text(CONFIGURATION.format(folder=self.folder, **ports))
        os.environ["SLURM_CONF"] = str(configuration)
        self.start_munge()
        self.start("slurmctld", "-D")
        for name in ("n1", "n2"):
            self.start_node(name)
        self.wait_for(lambda: self.output("sinfo", "-h", "-o", "%D %t") == "2 idle", "two idle nodes")
        return self

    def __exit__(self, *_):
        for process in reversed(self.started):
            if process.poll() is None:
                process.terminate()
                try:
                    process.wait(10)
                except subprocess.TimeoutExpired:
                    process.kill()
        for program in self.jobs_programs():
            kill(program)

    def start(self, *line, **options):
        log = (self.folder / f"{Path(line[0]).name}.out").open("a")
        self.started.append(subprocess.Popen(line, stdout=log, stderr=log, **options))
        return self.started[-1]

    def start_munge(self):
        folder = self.folder / "munge"
        folder.mkdir()
        key = folder / "key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        user = pwd.getpwnam("munge")
        for path in (folder, key):
            os.chown(path, user.pw_uid, user.pw_gid)
        files = [f"--{name}={folder / file}" for name, file in
                 (("key-file", "key"), ("socket", "socket"), ("pid-file", "pid"), ("log-file", "log"), ("seed-file", "seed"))]  # fmt: skip
        self.start("munged", "--foreground", "--force", *files, user=user.pw_uid, group=user.pw_gid)
        self.wait_for((folder / "socket").exists, "munge")

    def start_node(self, name):
        self.nodes[name] = self.start("slurmd", "-D", "-N", name)

    def lose_node(self, name):
        """As if its machine had lost power: slurmd, its step managers and the programs of its jobs are killed."""
        self.nodes[name].kill()
        self.nodes[name].wait()
        programs = self.jobs_programs(name)
        managers = {m for m in map(parent_of, programs) if m and Path(f"/proc/{m}/comm").read_text().startswith("slurmstepd")}
        for program in managers | set(programs):
            kill(program)
        return len(programs)

    def jobs_programs(self, node=""):
        """The processes of this cluster's jobs, on one node or on all: number -> environment."""
        ours = {}
        for process in Path("/proc").glob("[0-9]*"):
            try:
                variables = dict(v.split("=", 1) for v in (process / "environ").read_text(errors="replace").split("\0") if "=" in v)
            except OSError:
                continue
            on = variables.get("SLURMD_NODENAME", "") if "SLURM_JOB_ID" in variables else ""
            if on and node in ("", on) and variables.get("SLURM_CONF") == os.environ["SLURM_CONF"]:
                ours[int(process.name)] = variables
        return ours

    def output(self, *line):
        return subprocess.run(line, capture_output=True, text=True).stdout.strip()

    def wait_for(self, condition, what, seconds=90):
        until = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > until:
                for log in sorted(self.folder.glob("*.log")) + sorted(self.folder.glob("*.out")):
                    print(f"--- {log.name}\n" + "\n".join(log.read_text(errors="replace").splitlines()[-15:]))
                support.expect(False, f"{what} within {seconds} s")
            time.sleep(0.1)
