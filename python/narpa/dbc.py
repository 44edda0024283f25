"""Reads a DBC file as narpa writes it, and encodes and decodes the signals of its messages.

Signals are little-endian integers times a factor, without offset: `narpa check --dbc` writes no others, and the reader
refuses them. The most negative raw value of a signed signal means "not available" and is None here.
"""
import re
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent


def shipped_dbc():
    """The DBC file that comes with narpa: one body "chaser" at 0x100, camera 0, and the messages of a closed loop."""
    name = "protocols/can/narpa.dbc"
    below = [HERE.parents[1] / name]  # in the repository and in PREFIX/share/narpa
    below += [folder / "share/narpa" / name for folder in HERE.parents]  # PREFIX/lib/python3.*/dist-packages/narpa
    return next((path for path in below if path.is_file()), below[0])


@dataclass(frozen=True)
class Signal:
    name: str
    start: int  # bit
    length: int  # bits
    signed: bool
    factor: float
    unit: str
    choices: dict = field(default_factory=dict, compare=False)  # {raw value: name}

    def encode(self, value):
        """The raw value in two's complement. Names of enumerated values are accepted; clocks (ns, us) wrap around."""
        if isinstance(value, str):
            numbers = [number for number, word in self.choices.items() if word == value]
            if not numbers:
                raise ValueError(f"{self.name}: {value!r}, expected one of {', '.join(self.choices.values())}")
            raw = numbers[0]
        elif value is None:
            raw = -(1 << self.length - 1)
        else:
            raw = int(value) if self.factor == 1 and int(value) == value else round(value / self.factor)
            is_clock = self.unit in ("ns", "us") and not self.signed
            low, high = (1 - (1 << self.length - 1), (1 << self.length - 1) - 1) if self.signed else (0, (1 << self.length) - 1)
            if not (is_clock or low <= raw <= high):
                raise ValueError(f"{self.name}: {value} {self.unit}, expected {low * self.factor:g} to {high * self.factor:g}")
        return raw % (1 << self.length)

    def decode(self, payload):
        """Decodes the signal from the payload as one integer: a value in the signal's unit, an enumerated name, or None."""
        raw = payload >> self.start & (1 << self.length) - 1
        if self.signed and raw >> self.length - 1:
            raw -= 1 << self.length
            if raw == -(1 << self.length - 1):
                return None
        return self.choices.get(raw, raw if self.factor == 1 else raw * self.factor)


@dataclass
class Message:
    identifier: int
    name: str
    size: int  # bytes
    signals: dict = field(default_factory=dict)  # {name: Signal}

    def encode(self, values):
        """The payload with these signals; all others are 0."""
        payload = 0
        for name, value in values.items():
            payload |= self.signals[name].encode(value) << self.signals[name].start
        return payload.to_bytes(self.size, "little")

    def decode(self, data):
        payload = int.from_bytes(data, "little")
        return {name: signal.decode(payload) for name, signal in self.signals.items()}


SIGNAL = re.compile(r'SG_ (\w+) : (\d+)\|(\d+)@(\d)([+-]) \(([^,]+),([^)]+)\) \[[^]]*\] "([^"]*)"')


def read(path=None):
    """{identifier: Message} of a DBC file, by default of the one that comes with narpa."""
    path = Path(path or shipped_dbc())
    messages, message = {}, None
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if match := re.match(r"BO_ (\d+) (\w+): (\d+) ", line):
            message = Message(int(match[1]), match[2], int(match[3]))
            messages[message.identifier] = message
        elif match := SIGNAL.match(line.strip()):
            name, start, length, order, sign, factor, offset, unit = match.groups()
            if order != "1" or float(offset) != 0:
                raise ValueError(f"{path}:{number}: {name}: expected a little-endian signal without offset")
            number_factor = int(factor) if factor.isdigit() else float(factor)
            message.signals[name] = Signal(name, int(start), int(length), sign == "-", number_factor, unit)
        elif match := re.match(r"VAL_ (\d+) (\w+) (.*);", line):
            words = re.findall(r'(-?\d+) "([^"]*)"', match[3])
            messages[int(match[1])].signals[match[2]].choices.update({int(raw): word for raw, word in words})
    return messages
