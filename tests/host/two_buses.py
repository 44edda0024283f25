#!/usr/bin/python3
"""A rehearsal over two redundant slcan buses, one of which is cut on the way: it docks all the same, and both are counted.

Usage: two_buses.py                      the test
       two_buses.py through PROGRAM      (by the rehearsal) PROGRAM with a relay before bus A, which ends after so many bytes"""
import json
import os
import re
import select
import socket
import subprocess
import sys
import threading
from pathlib import Path

import support
from support import expect

BUILD = Path(os.environ["NARPA_BUILD_DIR"])
CUT_AFTER_BYTES = 100_000  # of those that a program gets from bus A


def relay(port):
    """Listens in front of a hub for one client; returns the port. Cuts the connection after CUT_AFTER_BYTES, for good."""
    listener = socket.create_server(("127.0.0.1", 0))

    def run():
        client, _ = listener.accept()
        hub = socket.create_connection(("127.0.0.1", port))
        listener.close()
        for side in (client, hub):
            side.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        left = CUT_AFTER_BYTES
        while left > 0:
            for side in select.select([client, hub], [], [])[0]:
                data = side.recv(65536)
                if not data:
                    return
                (client if side is hub else hub).sendall(data)
                left -= len(data) if side is hub else 0
        client.close(), hub.close()
        print("bus A is cut", flush=True)

    threading.Thread(target=run, daemon=True).start()
    return listener.getsockname()[1]


def through(program):
    a, b = re.fullmatch(r"slcan:(\d+)\+slcan:(\d+)", os.environ["BUS"]).groups()
    command = [BUILD / "bin" / program, os.environ["SCENARIO"], "--can", f"slcan:{relay(int(a))}", "--can", f"slcan:{b}",
               "--lockstep", "--seed", os.environ["SEED"]]  # fmt: skip
    if program == "narpa-navigation":
        command += ["--ready-fd", os.environ["READY_FD"]]
        for video in os.environ["VIDEO"].split():
            command += ["--video", video]
    done = subprocess.run([str(word) for word in command], pass_fds=[int(os.environ["READY_FD"])] if "READY_FD" in os.environ else [])
    sys.exit(done.returncode)


def main():
    folder = support.work_folder() / "out"
    wrapped = f"{sys.executable} -B {__file__} through"
    support.narpa("rehearse", "dispersions", "--can", "slcan:0", "--can", "slcan:0", "-o", folder,
                  "--dynamics", f"{wrapped} narpa-dynamics", "--navigation", f"{wrapped} narpa-navigation")  # fmt: skip
    result = json.loads((folder / "result.json").read_text())
    expect(result["passed"], "docked: all gates passed")
    for name in ("dynamics", "navigation"):
        expect("bus A is cut" in (folder / f"{name}.log").read_text(), f"bus A of the {name} was cut")
    text = (folder / "emulator.log").read_text()
    uses = re.findall(r"(\d+) frames used, (\d+) as duplicates or not in use, (\d+) sent", text)
    expect(len(uses) == 2, f"the report has both buses: {uses}")
    (_, _, sent_a), (used_b, _, sent_b) = (map(int, use) for use in uses)
    expect(used_b > 0 and sent_b >= sent_a > 0, "B was used, and both have sent")
    expect(sum(int(d) for _, d, _ in uses) > 100, "frames of both were counted as duplicates before the cut")


if __name__ == "__main__":
    through(sys.argv[2]) if sys.argv[1:2] == ["through"] else main()
