"""Messages on narpa's CAN bus: sets of signals, sent and received by their names in the DBC file.

On classic CAN a set is several frames of 8 bytes that take effect together, on CAN FD one frame of 64 bytes
(protocols/can/README.md). The sets are

    Pose (one for each body's can_id), Ledger (one for each camera), Heartbeat, Estimate,
    Attitude, Dynamics (from the dynamics), Actuator, Navigation (from the navigation),
    CameraCommand, CameraTrigger (to cameras), CameraReply, CameraState (from them), LidarBeam.
"""
import time
from dataclasses import dataclass

from narpa import dbc

POSE, LEDGER, CAMERA_COMMAND = "Pose", "Ledger", "CameraCommand"
LEDGER_BASE, STEP = 0x600, 16  # identifiers: camera k's ledger at LEDGER_BASE + STEP * k; bodies below LEDGER_BASE


def crc(data, bits, polynomial, start, final):
    value = start
    for byte in data:
        value ^= byte << bits - 8
        for _ in range(8):
            value = (value << 1 ^ (polynomial if value >> bits - 1 else 0)) & (1 << bits) - 1
    return value ^ final


def crc8(data):
    """CRC-8/SAE-J1850, the checksum of classic frames."""
    return crc(data, 8, 0x1D, 0xFF, 0xFF)


def crc16(data):
    """CRC-16/IBM-3740, the checksum of CAN FD frames."""
    return crc(data, 16, 0x1021, 0xFFFF, 0)


def checksum(identifier, data):
    """The checksum at the end of a frame. It covers the identifier and all preceding bytes."""
    covered = identifier.to_bytes(2, "little") + data
    return bytes([crc8(covered)]) if len(data) < 8 else crc16(covered).to_bytes(2, "little")


def frame_data(identifier, data):
    """The frame's bytes with their checksum at the end."""
    end = len(data) - (1 if len(data) == 8 else 2)
    return data[:end] + checksum(identifier, data[:end])


@dataclass(frozen=True)
class Received:
    """A complete set: values by the names of the signals."""

    name: str
    base: int  # base identifier; for a pose the body's can_id
    counter: int
    values: dict

    def __getitem__(self, signal):
        return self.values[signal]

    def vector(self, name):
        """The signals NAMEX, NAMEY, NAMEZ."""
        return [self.values[name + axis] for axis in "XYZ"]

    def quaternion(self, name="Attitude"):
        """The signals NAMEW, NAMEX, NAMEY, NAMEZ."""
        return [self.values[name + axis] for axis in "WXYZ"]


class SignalSet:
    """The frames of one set at one base identifier."""

    def __init__(self, name, base, classic, fd):
        self.name, self.base, self.classic, self.fd = name, base, classic, fd  # {offset: Message}; Message or None

    def encode(self, values, counter, fd=False):
        """Returns [(identifier, bytes)]. `values` may give a vector by the common name of its signals: Position=(x, y, z).
        Missing signals are 0; in a CameraCommand they are "not available", which leaves the setting unchanged."""
        offsets = {self.fd.identifier % STEP: self.fd} if fd and self.fd else self.classic
        known = {name for message in offsets.values() for name in message.signals} - {"Counter", "Crc"}
        values = expanded(values, known)
        if unknown := values.keys() - known:
            raise ValueError(f"{self.name} has no signal {', '.join(sorted(unknown))}, expected {', '.join(sorted(known))}")
        if self.name == CAMERA_COMMAND:
            values = {"Camera": 0} | {name: None for name in known - {"Camera"}} | values
        frames = []
        for offset, message in offsets.items():
            own = {name: values[name] for name in message.signals if name in values}
            identifier = self.base + offset
            frames.append((identifier, frame_data(identifier, message.encode({**own, "Counter": counter % 256}))))
        return frames


def expanded(values, known):
    out = {}
    for name, value in values.items():
        axes = "XYZ" if f"{name}W" not in known else "WXYZ"
        if name not in known and name + axes[0] in known:
            out.update(zip((name + axis for axis in axes), map(float, value), strict=True))
        else:
            out[name] = value
    return out


class Catalogue:
    """The sets of a DBC file, also at the identifiers of bodies and cameras that it does not contain."""

    def __init__(self, path=None):
        self.sets, self.owners = {}, {}  # owners: {identifier: (set, message)}
        messages = dbc.read(path)
        for base in sorted({identifier - identifier % STEP for identifier in messages}):
            group = {i % STEP: m for i, m in messages.items() if i - i % STEP == base}
            fd = group.pop(15, None)
            if fd:
                self.sets.setdefault(fd.name.split("_")[-1], SignalSet(fd.name.split("_")[-1], base, group, fd))
            else:  # sets of a single classic frame, without a CAN FD variant
                for offset, message in group.items():
                    self.sets[message.name] = SignalSet(message.name, base + offset, {0: message}, None)

    def at(self, name, base=None):
        """The set of this name. `base`: identifier of another body's pose or another camera's ledger."""
        if name not in self.sets:
            raise ValueError(f"no set {name!r} in the DBC file, expected one of {', '.join(self.sets)}")
        known = self.sets[name]
        return known if base is None else SignalSet(name, base, known.classic, known.fd)

    def of(self, identifier):
        """The set that a frame belongs to, and its message; (None, None) for a foreign frame."""
        if identifier not in self.owners:
            self.owners[identifier] = self.owner(identifier)
        return self.owners[identifier]

    def owner(self, identifier):
        base, offset = identifier - identifier % STEP, identifier % STEP
        for known in self.sets.values():
            if known.fd is None and identifier == known.base:
                return known, known.classic[0]
        name = POSE if base < LEDGER_BASE else LEDGER if base < LEDGER_BASE + 0x100 else None
        for known in self.sets.values():
            if known.fd and (known.name == name if name else known.base == base):
                message = known.fd if offset == 15 else known.classic.get(offset)
                return (self.at(known.name, base), message) if message else (None, None)
        return None, None


class Decoder:
    """Collects frames until a set is complete."""

    def __init__(self, catalogue):
        self.catalogue, self.gathered = catalogue, {}  # {base: (counter, {identifier: values})}

    def accept(self, identifier, data):
        """The set that this frame completes, or None. Frames with a wrong length or checksum are ignored."""
        known, message = self.catalogue.of(identifier)
        data = bytes(data)
        if message is None or len(data) != message.size or frame_data(identifier, data) != data:
            return None
        values = message.decode(data)
        counter = values.pop("Counter")
        values.pop("Crc")
        if known.fd is message or len(known.classic) == 1:
            return Received(known.name, known.base, counter, values)
        if self.gathered.get(known.base, (None,))[0] != counter:
            self.gathered[known.base] = counter, {}
        parts = self.gathered[known.base][1]
        parts[identifier] = values
        if len(parts) < len(known.classic):
            return None
        del self.gathered[known.base]
        return Received(known.name, known.base, counter, {k: v for part in parts.values() for k, v in part.items()})


class Bus:
    """A CAN bus, named as in narpa's options:

    vcan0, can0          SocketCAN; with CAN FD frames where fd=True
    slcan:[HOST:]PORT    narpa run --can slcan:PORT; classic frames. Also python-can's socket://HOST:PORT
    udp:GROUP            narpa run --can udp:GROUP; CAN FD frames

    The bus keeps one counter for each base identifier and increments it with each set that it sends.
    """

    def __init__(self, name, fd=False, catalogue=None, patience_s=0):
        self.catalogue = catalogue or Catalogue()
        self.decoder, self.counters = Decoder(self.catalogue), {}
        self.fd = name.startswith("udp:") or (fd and ":" not in name)
        self.bus = open_python_can(name, self.fd, patience_s)

    def send(self, name, base=None, **signals):
        """Sends a set: bus.send("Actuator", Time=t_ns, Impulse=(1, 0, 0), AngularImpulse=(0, 0, 0))."""
        import can

        chosen = self.catalogue.at(name, base)
        counter = self.counters[chosen.base] = (self.counters.get(chosen.base, -1) + 1) % 256
        for identifier, data in chosen.encode(signals, counter, self.fd):
            self.bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data, is_fd=len(data) > 8))

    def send_pose(self, can_id, t_ns, position, attitude, velocity=(0, 0, 0), rate=(0, 0, 0)):
        """A pose command: metres and m/s in world axes, (w, x, y, z) from body to world, rad/s in body axes."""
        self.send(POSE, can_id, Time=t_ns, Position=position, Attitude=attitude, Velocity=velocity, Rate=rate)

    def receive(self, timeout_s=None):
        """The next complete set, or None if there is none within timeout_s."""
        until = None if timeout_s is None else time.monotonic() + timeout_s
        while until is None or time.monotonic() < until:
            frame = self.bus.recv(None if until is None else max(0, until - time.monotonic()))
            received = frame and self.decoder.accept(frame.arbitration_id, frame.data)
            if received:
                return received
        return None

    def __iter__(self):
        """Yields messages until the bus is closed because `narpa run` has ended."""
        import can

        while True:
            try:
                message = self.receive()
            except can.CanOperationError:
                return
            yield message

    def close(self):
        self.bus.shutdown()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def open_python_can(name, fd, patience_s=0):
    """Opens a bus with python-can; retries for patience_s seconds if the bus does not exist yet."""
    import can

    if name.startswith(("slcan:", "socket://")):
        host, _, port = name.removeprefix("slcan:").removeprefix("socket://").rpartition(":")
        settings = {"interface": "slcan", "channel": f"socket://{host or '127.0.0.1'}:{port}", "sleep_after_open": 0.1}
    elif name.startswith("udp:"):
        settings = {"interface": "udp_multicast", "channel": name.removeprefix("udp:")}
    elif ":" in name:
        raise ValueError(f"no bus {name!r}, expected slcan:[HOST:]PORT, udp:GROUP, or an interface like vcan0")
    else:
        settings = {"interface": "socketcan", "channel": name, "fd": fd}
    until = time.monotonic() + patience_s
    while True:
        try:
            return can.Bus(**settings)
        except Exception:  # the type of the exception depends on the interface
            if time.monotonic() > until:
                raise
            time.sleep(0.1)
