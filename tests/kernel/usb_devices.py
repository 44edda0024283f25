"""USB devices of this machine over USB/IP, for the tests in the virtual machine."""
import subprocess
import time
from pathlib import Path

from support import expect


def wait_until(what, condition, seconds=60):
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            expect(False, what)
        time.sleep(0.1)


def attach(port):
    """Attaches the device at this port; retries until the server listens."""
    command = ["usbip", "--tcp-port", str(port), "attach", "-r", "127.0.0.1", "-b", "1-1"]
    wait_until(f"usbip attaches port {port}", lambda: subprocess.run(command, capture_output=True).returncode == 0)


def ports_used():
    status = Path("/sys/devices/platform/vhci_hcd.0/status").read_text().splitlines()[1:]
    return [line.split()[1] for line in status if line.split()[2] == "006"]  # VDEV_ST_USED


def detach(port):
    subprocess.run(["usbip", "detach", "-p", str(int(port))], check=True, capture_output=True)


def usb_camera():
    """The capture device that uvcvideo has created for the camera, or None."""
    for folder in sorted(Path("/sys/class/video4linux").glob("video*")):
        if "narpa camera" in (folder / "name").read_text() and (folder / "index").read_text().strip() == "0":
            if (device := Path("/dev") / folder.name).exists():
                return str(device)
    return None
