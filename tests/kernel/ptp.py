#!/usr/bin/python3
"""Two virtual machines, joined by a network link, whose clocks are 37 s apart. ptp4l with software time stamps sets the second one's
clock by the first one's; narpa in each takes UTC from its clock and sends LiDAR packets, which state their UTC, to the other. What
the two narpas say of UTC agrees, and their reports have ptp4l's state.

Usage: ptp.py RUNRIG DIR SECONDS     boots both (runrig) and compares; in a machine: ptp.py machine 1|2

A packet's stated time is that of its only shot, after which it is sent. It arrives, by the receiver's clock (the kernel's stamp of
the received datagram), the path's delay later, plus the difference of the clocks. Of the least such delays of the two directions,
half the difference is the disagreement of the two UTCs, and half the sum, the mean delay of the path, bounds the error of that:
no packet arrives before it is sent."""
import json
import os
import re
import shutil
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))

SECOND_NS, APART_S, PORT, RUN_S = 10**9, 37, 2370, 20
SO_TIMESTAMPNS = 35
SCENE = """
[[body]]
name = "target"
sphere = {radius_m = 2}
material = {kind = "lambert", albedo = 0.6}
[[lidar]]
name = "beam"
position_m = [-10, 0, 0]
attitude_wxyz = [0.7071067811865476, 0, 0, -0.7071067811865476]
model = "beam.toml"
[time]
source = "system"
"""
BEAM = """
[lidar]
name = "altimeter"
rate_hz = 20.0
range_max_m = 100.0
range_resolution_m = 0.01
[[beam]]
azimuth_deg = 0.0
elevation_deg = 0.0
phase = 0.0
"""
# On emulated processors stamps are off by milliseconds. ptp4l waits longer than usual for the stamp of a sent message, does not take
# a late one for a clock that jumps (sanity_freq_limit), and its servo may not take noise for a large error of the frequency.
PTP4L = """
[global]
time_stamping software
network_transport UDPv4
logAnnounceInterval -1
logSyncInterval -3
logMinDelayReqInterval -3
announceReceiptTimeout 10
tx_timestamp_timeout 1000
first_step_threshold 0.00002
summary_interval -3
sanity_freq_limit 0
max_frequency 500000
pi_proportional_const 0.2
pi_integral_const 0.002
priority1 {priority}
{role}
[eth0]
"""


# --- in a virtual machine -------------------------------------------------------------------------------------------


class Receiver(threading.Thread):
    """Gathers, of each packet of the other machine, the time of its arrival less the one that it states, ns."""

    def __init__(self):
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.socket.bind(("", PORT))
        self.delays_ns = []

    def run(self):
        while True:
            packet, control, _, _ = self.socket.recvmsg(2048, 256)
            stamps = [data for level, kind, data in control if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS)]
            if packet[:4] != b"NLPP" or not stamps:
                continue
            seconds, nanoseconds = struct.unpack("qq", stamps[0][:16])
            frame_ns = int.from_bytes(packet[16:24], "little", signed=True)
            shot_ns = int.from_bytes(packet[40:44], "little")
            self.delays_ns.append(seconds * SECOND_NS + nanoseconds - frame_ns - shot_ns)


def offsets(log):
    """(offset from the master in ns, state of the servo) of each synchronisation."""
    return [(int(offset), state) for offset, state in re.findall(r"master offset +(-?\d+) (s\d)", log.read_text(errors="replace"))]


def await_lock(log):
    """Waits until the servo has followed the master for 5 s, with offsets that are mostly below 2 ms, at most 120 s."""
    begin = time.monotonic()
    while time.monotonic() < begin + 120:
        last = offsets(log)[-40:]
        if len(last) == 40 and {state for _, state in last} == {"s2"} and statistics.median(abs(o) for o, _ in last) < 2_000_000:
            break
        time.sleep(0.5)
    return {"first_ns": offsets(log)[0][0], "seconds": round(time.monotonic() - begin, 1)}


def run_machine(number):
    import support

    mine, other = f"10.77.0.{number}", f"10.77.0.{3 - number}"
    for command in ("link set eth0 up", f"addr add {mine}/24 dev eth0", "route add 224.0.0.0/4 dev eth0"):
        subprocess.run(["ip", *command.split()], check=True)
    folder = support.work_folder()
    (folder / "scene.toml").write_text(SCENE)
    (folder / "beam.toml").write_text(BEAM)
    (folder / "ptp4l.conf").write_text(PTP4L.format(priority=99 + number, role="slaveOnly 1" if number == 2 else ""))
    signals = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # from the second machine to the first
    signals.bind(("", 7000))
    receiver = Receiver()
    receiver.start()
    if number == 2:
        time.clock_settime_ns(time.CLOCK_REALTIME, time.clock_gettime_ns(time.CLOCK_REALTIME) + APART_S * SECOND_NS)
    log = folder / "ptp4l.log"
    with open(log, "wb") as out:
        ptp4l = subprocess.Popen(["ptp4l", "-f", folder / "ptp4l.conf", "-m", "-q"], stdout=out, stderr=out)
    result = {"machine": number}
    if number == 2:
        result["lock"] = await_lock(log)
        for _ in range(5):
            signals.sendto(b"locked", (other, 7000))
    else:
        signals.settimeout(240)
        signals.recv(16)
    receiver.delays_ns.clear()
    check = json.loads(support.narpa("check", folder / "scene.toml", "--json").stdout)
    result["check"] = {f["name"]: f["detail"] for f in check["machine"] if f["name"] in ("system's clock", "ptp4l")}
    with support.Run(folder / "scene.toml", "--lidar", f"beam=udp:{other}:{PORT}", "--duration", RUN_S) as run:
        summary = run.finish()
    time.sleep(25)  # the other may have begun later
    delays = sorted(receiver.delays_ns)
    result |= {"clock": summary["clock"], "packets": len(delays), "delay_min_ns": delays[0] if delays else None,
               "delay_median_ns": statistics.median(delays) if delays else None}  # fmt: skip
    result["clocksource"] = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource").read_text().strip()
    result["ptp4l"] = [line for line in log.read_text(errors="replace").splitlines() if "master offset" not in line]
    result["offsets_us"] = [offset // 1000 for offset, _ in offsets(log)[::8]]
    ptp4l.send_signal(signal.SIGTERM)
    ptp4l.wait()
    print("RESULT " + json.dumps(result), flush=True)


# --- on the host ----------------------------------------------------------------------------------------------------


def boot(runrig, rig, seconds):
    """The results of both machines, in their order."""
    sockets = tempfile.TemporaryDirectory(prefix="narpa-test-")
    machines = []
    for number in (1, 2):
        ends = [f"{sockets.name}/{n}" for n in (number, 3 - number)]
        net = f"-netdev dgram,id=link,local.type=unix,local.path={ends[0]},remote.type=unix,remote.path={ends[1]} " \
              f"-device virtio-net-pci,netdev=link,mac=52:54:00:00:00:0{number}"  # fmt: skip
        command = [runrig, rig, seconds, "/usr/bin/python3", "-B", os.path.abspath(__file__), "machine", str(number)]
        machines.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                         env={**os.environ, "NARPA_RIG_NET": net}))  # fmt: skip
    outputs = [""] * 2

    def read(index):
        outputs[index] = machines[index].communicate()[0]

    readers = [threading.Thread(target=read, args=(index,)) for index in (0, 1)]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join()
    results = []
    for machine, output in zip(machines, outputs):
        found = re.search(r"^RESULT (.*)$", output, re.M)
        if machine.returncode == 77:
            print(output)
            sys.exit(77)
        if machine.returncode != 0 or not found:
            print(*outputs, sep="\n--- the second machine ---\n")
            print(f"FAILED: machine {len(results) + 1} ended with {machine.returncode}")
            sys.exit(1)
        results.append(json.loads(found[1]))
    return results


def us(ns):
    return f"{ns / 1000:.1f} us"


def compare(master, slave):
    from support import expect

    for one in (master, slave):
        print(json.dumps(one))
    first, second = master["clock"]["ptp4l"], slave["clock"]["ptp4l"]
    expect(abs(abs(slave["lock"]["first_ns"]) - APART_S * SECOND_NS) < 2 * SECOND_NS,
           f"the clocks were {slave['lock']['first_ns'] / SECOND_NS:.3f} s apart before ptp4l set the second")  # fmt: skip
    expect(first["state"] == "MASTER" and not first["grandmaster_present"], f"the first ptp4l is {first['state']}")
    expect(second["state"] == "SLAVE" and second["grandmaster_present"], f"the second ptp4l is {second['state']}")
    expect(second["grandmaster"] == first["grandmaster"], f"its grandmaster is the first: {second['grandmaster']}")
    expect("MASTER" in master["check"]["ptp4l"] and "SLAVE" in slave["check"]["ptp4l"], "narpa check says the same")
    expect(slave["clock"]["synchronised"] and second["answered"] > 5, f"{second['answered']} answers; the kernel's clock is synchronised")
    expect(second["malformed"] == 0 and first["malformed"] == 0, "all answers are whole")
    expect(min(master["packets"], slave["packets"]) > 100, f"packets: {master['packets']} to the first, {slave['packets']} to the second")
    to_first, to_second = master["delay_min_ns"], slave["delay_min_ns"]
    disagreement_ns, delay_ns = abs(to_second - to_first) / 2, (to_first + to_second) / 2
    reported_ns = SECOND_NS * second["offset_s_max"]
    print(f"least delays: {us(to_first)} to the first, {us(to_second)} to the second; medians {us(master['delay_median_ns'])}, "
          f"{us(slave['delay_median_ns'])}")  # fmt: skip
    print(f"ptp4l's offset {us(SECOND_NS * second['offset_s'])}, at most {us(reported_ns)}; its path delay "
          f"{us(SECOND_NS * second['mean_path_delay_s'])}")  # fmt: skip
    expect(disagreement_ns <= max(delay_ns, 0) + reported_ns,
           f"the two UTCs disagree by {us(disagreement_ns)}, no more than the delay {us(delay_ns)} and the reported offset")  # fmt: skip
    # Measured on a busy machine: 0.04 and 1.4 ms, and 55 ms in a run whose servo had lost the master.
    expect(disagreement_ns < 20_000_000, "which is below 20 ms")


def main():
    if sys.argv[1] == "machine":
        return run_machine(int(sys.argv[2]))
    from support import skip

    if not (shutil.which("ptp4l") or Path("/usr/sbin/ptp4l").exists()):
        skip("no ptp4l; try: apt-get install linuxptp")
    if not shutil.which("qemu-system-x86_64"):
        skip("no qemu-system-x86_64; try: apt-get install qemu-system-x86")
    kinds = subprocess.run(["qemu-system-x86_64", "-netdev", "help"], capture_output=True, text=True).stdout
    if "dgram" not in kinds.split():
        skip("this QEMU has no -netdev dgram (before 7.2)")
    compare(*boot(*sys.argv[1:4]))


if __name__ == "__main__":
    main()
