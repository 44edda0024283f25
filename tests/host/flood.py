#!/usr/bin/python3
"""A client floods the bus: no command is lost, can.log has every command, and the run does not fail."""
import importlib.util
import re
import socket
import threading
import time

import support
from support import expect

if not importlib.util.find_spec("can"):
    support.skip("no python-can; try: apt-get install python3-can")

COMMANDS, FOREIGN = 30, 200_000
LINE = b"t7F080011223344556677\r"


def flood(port):
    """Sends foreign frames as fast as the hub accepts them; returns when it has accepted all."""
    with socket.create_connection(("127.0.0.1", port)) as client:
        client.sendall(b"O\r")

        def send():
            for _ in range(FOREIGN // 1000):
                client.sendall(LINE * 1000)
            client.shutdown(socket.SHUT_WR)

        sending = threading.Thread(target=send)
        sending.start()
        while client.recv(1 << 16):
            pass
        sending.join()


folder, wire, port = support.work_folder(), support.Wire(), support.free_port()
with support.Run(support.SCENE, "--can", f"slcan:{port}", "--video", f"{support.CAMERA}=none", "--log", folder) as run:
    bus = support.open_bus(run, interface="slcan", channel=f"socket://127.0.0.1:{port}", sleep_after_open=0.1)
    flooding = threading.Thread(target=flood, args=[port])
    flooding.start()
    for k, pose in enumerate(support.flight(COMMANDS)):
        for message in wire.command(pose, k * 50_000_000, counter=k):
            bus.send(message)
        bus.recv(0)
        time.sleep(0.05)
    flooding.join()
    summary = run.stop()
    bus.shutdown()

can = summary["can"]
print(can)
expect(can["foreign_frames"] == FOREIGN, f"all {FOREIGN} foreign frames arrived")
expect(can["commands_taken"] == COMMANDS and can["commands_missed"] == 0, f"all {COMMANDS} commands arrived")
print(f"{can['frames_not_logged']} of them are not in can.log (none on a machine too slow for 10,000 a second)")
expect(any("not in can.log" in notice for notice in summary["notices"]) == (can["frames_not_logged"] > 0), "the summary states that")

lines = (folder / "can.log").read_text().splitlines()
stated = sum(int.from_bytes(bytes.fromhex(line[-8:]), "little") for line in lines if " not_logged 20000004#" in line)
foreign = sum(" 7F0#" in line for line in lines)
expect(stated == can["frames_not_logged"] and stated + foreign == FOREIGN, f"can.log has {foreign} and states that {stated} are missing")
commands = sum(bool(re.search(r" 10[0-8]#", line)) for line in lines)
expect(commands == 9 * COMMANDS, f"can.log has the {commands} frames of the commands")

from can import LogReader

expect(sum(1 for _ in LogReader(str(folder / "can.log"))) == len(lines), "python-can reads can.log")
