#!/usr/bin/python3
"""Sends a VLP-16's packets by broadcast and multicast: to the broadcast address of a network, to 255.255.255.255 and to a
multicast group. Each has several receivers; all receive the bytes of the capture of the same run. PCL's unmodified grabber
decodes the broadcast packets and the capture to the same points. Runs in a network namespace with loopback only."""
import os
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import support
from support import expect

try:
    import can, serial  # noqa: F401: needed by support.open_bus
except ImportError as error:
    support.skip(f"{error} (python3-can, python3-serial)")

from narpa import pcap  # noqa: E402: support has set the path

RECEIVER = Path(os.environ["NARPA_BUILD_DIR"]) / "bin/pcl_receiver"
GROUP, TTL = "239.255.23.68", 5
SINKS = {"network": ("192.168.1.255", 2368, ""), "all": ("255.255.255.255%lo", 2468, ""), "group": (f"{GROUP}%lo", 2568, f",ttl={TTL}")}
PCL_PORT = 2668  # PCL does not share its port with other receivers
IP_RECVTTL = 12  # linux/in.h; the socket module has no name for it
COMMANDS, PACE_S = 26, 0.05  # a quarter of a second, in steps of 8 packets


def receiver(port, group=None):
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    s.setsockopt(socket.IPPROTO_IP, IP_RECVTTL, 1)
    if group:
        s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + socket.inet_aton("127.0.0.1"))
    s.bind((group or "", port))
    s.settimeout(2)
    return s


def received(s):
    """All data packets received, and their IP time-to-live values."""
    packets, ttls = [], set()
    try:
        while True:
            data, control, _, _ = s.recvmsg(2000, 64)
            packets.append(data)
            ttls |= {struct.unpack("i", value)[0] for level, kind, value in control if kind == socket.IP_TTL}
            s.settimeout(0.2)
    except TimeoutError:
        return packets, ttls


def fly(run, port):
    wire = support.Wire()
    bus = support.open_bus(run, interface="slcan", channel=f"socket://127.0.0.1:{port}", sleep_after_open=0.1)
    for i in range(COMMANDS):
        pose = support.Pose([0.01 * i, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0])
        for message in wire.command(pose, 10_000_000 * i, i):
            bus.send(message)
        time.sleep(PACE_S)
    bus.shutdown()


def points_of(output):
    return [line for line in output.splitlines() if line[:1].isdigit()]


def inside():
    for command in ("link set lo up", "addr add 192.168.1.201/24 brd 192.168.1.255 dev lo"):
        subprocess.run(["ip", *command.split()], check=True)
    refused = support.narpa("run", support.SCENE, "--can", "udp:239.74.163.2", "--lidar", f"{support.LIDAR}=udp:{GROUP}:2368", "--duration", 0.1, status=3)
    expect(b"no route there: name the interface" in refused.stderr, "a group without a route is told, and what to do")

    folder, can_port = support.work_folder(), support.free_port()
    receivers = {name: [receiver(port, GROUP if name == "group" else None) for _ in range(2)] for name, (_, port, _) in SINKS.items()}
    pcl = None
    if RECEIVER.exists():
        pcl = subprocess.Popen([RECEIVER, "VLP-16", "udp", "192.168.1.255", str(PCL_PORT), "1", "30"], stdout=subprocess.PIPE, text=True)
        expect(pcl.stdout.readline() == "ready\n", "PCL listens")
    capture = folder / "top.pcap"
    sinks = [f"udp:{host}:{port}{options}" for host, port, options in SINKS.values()] + [f"udp:192.168.1.255:{PCL_PORT}", str(capture)]
    arguments = [word for sink in sinks for word in ("--lidar", f"{support.LIDAR}={sink}")]
    with support.Run(support.SCENE, "--can", f"slcan:{can_port}", *arguments, "--lockstep") as run:
        fly(run, can_port)
        summary = run.stop()
    print("summary:", summary["lidars"])
    expected = [payload for payload in pcap.udp_payloads(capture) if len(payload) == 1206]
    expect(len(expected) > 150, f"the capture has {len(expected)} data packets")
    for name, (host, port, _) in SINKS.items():
        for i, s in enumerate(receivers[name]):
            packets, ttls = received(s)
            expect(packets == expected, f"{host}: receiver {i + 1} has the bytes of the capture ({len(packets)} packets)")
            expect(name != "group" or ttls == {TTL}, f"{host}: they came with the time to live {sorted(ttls)}")
    if pcl:
        live, _ = pcl.communicate(timeout=600)
        recorded = subprocess.run([RECEIVER, "VLP-16", "pcap", capture, "1", "30"], stdout=subprocess.PIPE, text=True)
        expect(pcl.returncode == 0 and recorded.returncode == 0, "PCL got a sweep, and one from the capture")
        points = points_of(live)
        expect(len(points) > 5000 and points == points_of(recorded.stdout), f"PCL decodes the same {len(points)} points from both")


if sys.argv[1:] == ["inside"]:
    inside()
else:
    support.enter_own_network(__file__, "inside")
