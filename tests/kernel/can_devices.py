"""The CAN interfaces of the virtual machine, for the tests in it."""
import subprocess


def add_bus(name, mtu=72):
    """Adds a virtual CAN interface and sets it up. MTU 72: CAN FD; 16: classic frames alone."""
    subprocess.run(["ip", "link", "add", "dev", name, "mtu", str(mtu), "type", "vcan"], check=True)
    set_up(name)


def set_up(name):
    subprocess.run(["ip", "link", "set", name, "up"], check=True)


def cut(name):
    subprocess.run(["ip", "link", "set", name, "down"], check=True)
