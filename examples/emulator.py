#!/usr/bin/python3
"""Replaces `narpa run` in lockstep: hands over a frame whenever one is due. The frames are black: draw your own instead.

Usage: emulator.py BUS FIFO      BUS: udp:239.74.163.2, or vcan0 with CAN FD

When the chaser's pose for time t arrives (the poses of the other bodies arrive before it), the ledger of every frame due
by t is sent and the frame is written to the FIFO. Then the heartbeat reports that the emulator has reached t.
"""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
from narpa import y4m
from narpa.can import Bus

WIDTH, HEIGHT, RATE_HZ = 320, 240, 1
PERIOD_NS = 1_000_000_000 // RATE_HZ
CHASER = 0x100  # can_id of the chaser in scene.toml


def draw(t_ns):
    """The frame exposed at this time."""
    return np.zeros((HEIGHT, WIDTH), np.uint8)


def send_ledger(bus, frame, t_ns):
    """Ledger of a frame with zero exposure time at t_ns, one sample per pixel, and hand-over 1 us later. Times are us after t_ns."""
    bus.send("Ledger", Frame=frame, Camera=0, PoseCounter=frame % 256, ExposureMid=t_ns, PoseTime=t_ns,
             ExposureStart=0, ExposureEnd=0, RenderStart=0, RenderEnd=0, HandOver=1, Deadline=PERIOD_NS // 1000,
             SamplesPerPixel=1, ExpectedError=0, Samples=WIDTH * HEIGHT, Rays=0, Step="refined", Passes=0, PoseStale=0,
             DeadlineMet=1, PoseKnown=1, BudgetKind="samples", Budget=1, Delivery="frame")  # fmt: skip


def main(bus_name, fifo):
    video, frame, finished = None, 0, False
    with Bus(bus_name, fd=True) as bus:
        print("ready", flush=True)
        for message in bus:
            if message.name == "Dynamics" and message["Phase"] == "finished":
                finished = True  # the poses for this time are still to arrive
            if message.name != "Pose" or message.base != CHASER:
                continue
            t_ns = message["Time"]
            while frame * PERIOD_NS <= t_ns:
                send_ledger(bus, frame, frame * PERIOD_NS)
                video = video or y4m.Writer(fifo, WIDTH, HEIGHT, RATE_HZ)  # waits for a reader
                try:
                    video.write(draw(frame * PERIOD_NS))
                except BrokenPipeError:
                    print("the video has no reader any more")
                frame += 1
            bus.send("Heartbeat", Time=t_ns // 1000, State="lockstep")
            print(f"{t_ns * 1e-9:8.2f} s, {frame} frames", flush=True)
            if finished:
                break


if __name__ == "__main__":
    main(*sys.argv[1:])
