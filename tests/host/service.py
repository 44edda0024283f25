#!/usr/bin/python3
"""A run under a service manager's protocol: ready once it runs, heartbeats while its clock moves, stopping at the end."""
import os
import signal
import socket
import subprocess
import time

import support
from support import expect

WATCHDOG_S = 1.0

folder = support.work_folder()
manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
manager.bind(str(folder / "notify"))


def states(until, patience_s=60):
    """Messages with their times, up to and with this one."""
    got, end = [], time.monotonic() + patience_s
    while not got or got[-1][1] != until:
        manager.settimeout(max(0.01, end - time.monotonic()))
        try:
            got.append((time.monotonic(), manager.recv(256).decode()))
        except TimeoutError:
            expect(False, f"{until} comes, after {[text for _, text in got]}")
    return got


environment = dict(os.environ, NOTIFY_SOCKET=str(folder / "notify"), WATCHDOG_USEC=str(int(1e6 * WATCHDOG_S)))
environment.pop("WATCHDOG_PID", None)
run = subprocess.Popen([support.NARPA, "run", str(support.SCENE), "--video", f"{support.CAMERA}=none"], env=environment,
                       stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
before = states("READY=1")
expect(len(before) == 1, "the first message is READY=1")
beats = []
for _ in range(5):
    beats += states("WATCHDOG=1")
between = [b[0] - a[0] for a, b in zip(beats, beats[1:])]
expect(all(text == "WATCHDOG=1" for _, text in beats), "heartbeats follow")
expect(len(between) == 4, f"at {', '.join(f'{s:.2f}' for s in between)} s from each other, for a watchdog of {WATCHDOG_S:g} s")

run.send_signal(signal.SIGSTOP)
time.sleep(2 * WATCHDOG_S)
manager.setblocking(False)
left = 0
while True:
    try:
        manager.recv(256)
        left += 1
    except BlockingIOError:
        break
expect(left <= 1, "a process that is stopped sends no heartbeat")
run.send_signal(signal.SIGCONT)
states("WATCHDOG=1")
run.send_signal(signal.SIGTERM)
states("STOPPING=1")
expect(run.wait(60) == 0, "it ends with status 0")

broken = subprocess.run([support.NARPA, "run", str(support.SCENE), "--video", f"{support.CAMERA}=none"],
                        env=dict(environment, NOTIFY_SOCKET="nowhere"), capture_output=True, text=True)
expect(broken.returncode == 2 and "expected the path of a socket" in broken.stderr, "a bad NOTIFY_SOCKET is refused")
