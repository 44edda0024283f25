"""narpa.dbc and narpa.can, compared with the example in protocols/can/README.md and, for every signal, with canmatrix."""
import logging
import unittest

import needs

needs.modules("can", "canmatrix", "numpy")

from narpa import dbc
from narpa.can import Bus, Catalogue, Decoder, checksum, crc8, crc16

# From protocols/can/README.md, "A worked example".
EXAMPLE = {"Time": 1_250_000_000, "Position": (1, -2, 10.5), "Attitude": (0.6, 0, 0.8, 0), "Velocity": (0, 0, -0.1), "Rate": (0, 0.01, 0)}
CLASSIC = """100#807C814A000007D4 101#40420F000000076B 102#807BE1FFFFFF0749 103#A037A00000000700 104#66662600000007CA
105#33333300000007CA 106#0000000000000733 107#000000007D00079B 108#78ECFF3F0000079A""".split()
FD = ("10F#807C814A000040420F000000807BE1FFFFFFA037A0000000666626000000333333000000000000000000000078ECFFFF000000F40100000"
      "00007000000006A11")  # fmt: skip

catalogue = Catalogue()


def candump(frames):
    return [f"{identifier:03X}#{data.hex().upper()}" for identifier, data in frames]


class Encoding(unittest.TestCase):
    def test_checksums_are_those_of_the_catalogue_of_crcs(self):
        self.assertEqual(crc8(b"123456789"), 0x4B)
        self.assertEqual(crc16(b"123456789"), 0x29B1)

    def test_pose_is_the_documented_example(self):
        self.assertEqual(candump(catalogue.at("Pose", 0x100).encode(EXAMPLE, counter=7)), CLASSIC)
        self.assertEqual(candump(catalogue.at("Pose", 0x100).encode(EXAMPLE, counter=7, fd=True)), [FD])

    def test_canmatrix_decodes_every_signal_of_every_set(self):
        logging.getLogger("canmatrix").setLevel(logging.CRITICAL)
        import canmatrix.formats

        frames = {f.arbitration_id.id: f for f in canmatrix.formats.loadp_flat(str(dbc.shipped_dbc())).frames}
        messages = dbc.read()
        self.assertEqual(messages.keys(), frames.keys())
        for identifier, message in messages.items():
            # A different value for every signal, far from 0.
            raw = {s.name: (3 + 5 * k) % (1 << min(s.length - 1, 16)) for k, s in enumerate(message.signals.values())}
            values = {name: number * message.signals[name].factor for name, number in raw.items()}
            decoded = frames[identifier].decode(bytearray(message.encode(values)))
            for name, number in raw.items():
                self.assertEqual(decoded[name].raw_value, number, f"{message.name}.{name}")
                self.assertAlmostEqual(float(decoded[name].phys_value), values[name], delta=1e-9 * abs(values[name]))

    def test_negative_values_and_words_come_back(self):
        sent = {"Time": 5, "Impulse": (-1.5, 2, -0.001), "AngularImpulse": (0, -8000, 0), "Leg": 3, "Phase": "closing", "Abort": "none"}
        decoder = Decoder(catalogue)
        [received] = [r for f in catalogue.at("Actuator").encode(sent, 0) if (r := decoder.accept(*f))]
        self.assertEqual(received["Phase"], "closing")
        for got, expected in zip(received.vector("Impulse") + received.vector("AngularImpulse"), (-1.5, 2, -0.001, 0, -8000, 0)):
            self.assertAlmostEqual(got, expected, delta=1e-9)

    def test_the_most_negative_value_is_not_available(self):
        signal = dbc.read()[0x101].signals["PositionX"]
        self.assertEqual(signal.encode(None), 1 << 47)
        self.assertIsNone(signal.decode(1 << 47))

    def test_errors_name_the_signal_and_what_was_expected(self):
        pose = catalogue.at("Pose")
        with self.assertRaisesRegex(ValueError, "Colour, expected .*PositionX"):
            pose.encode({"Colour": 1}, 0)
        with self.assertRaisesRegex(ValueError, r"RateX: 3.0 rad/s, expected -2.62142 to 2.62142"):
            pose.encode({"Rate": (3.0, 0, 0)}, 0)
        with self.assertRaisesRegex(ValueError, "Phase: 'lost', expected one of moving"):
            catalogue.at("Actuator").encode({"Phase": "lost"}, 0)
        with self.assertRaisesRegex(ValueError, "no set 'Weather'"):
            catalogue.at("Weather")


class Decoding(unittest.TestCase):
    def setUp(self):
        self.decoder = Decoder(catalogue)

    def accept(self, frames):
        return [r for identifier, data in frames if (r := self.decoder.accept(identifier, data))]

    def test_a_set_is_whole_with_its_last_frame_in_any_order(self):
        frames = catalogue.at("Pose", 0x230).encode(EXAMPLE, counter=9)
        [received] = self.accept(reversed(frames))
        self.assertEqual((received.name, received.base, received.counter), ("Pose", 0x230, 9))
        self.assertEqual(received["Time"], 1_250_000_000)
        self.assertAlmostEqual(received.vector("Position")[2], 10.5)
        self.assertAlmostEqual(received.quaternion()[0], 0.6, delta=2**-23)

    def test_frames_of_two_sets_are_not_mixed(self):
        first, second = (catalogue.at("Pose").encode({**EXAMPLE, "Time": t}, counter=t) for t in (1, 2))
        self.assertEqual(self.accept(first[:-1] + second[-1:]), [])
        self.assertEqual([r["Time"] for r in self.accept(second[:-1])], [2])

    def test_damaged_and_foreign_frames_are_ignored(self):
        frames = catalogue.at("Pose").encode(EXAMPLE, counter=0)
        damaged = [(i, bytes([d[0] ^ 1]) + d[1:]) for i, d in frames]
        self.assertEqual(self.accept(damaged), [])
        self.assertEqual(self.accept([(0x7FF, bytes(8)), (0x100, b""), (0x100, bytes(64)), (0x10F, bytes(64))]), [])

    def test_ledgers_of_other_cameras_have_their_own_identifiers(self):
        [received] = self.accept(catalogue.at("Ledger", 0x630).encode({"Frame": 4, "Delivery": "nothing"}, 1, fd=True))
        self.assertEqual((received.name, received.base, received["Delivery"]), ("Ledger", 0x630, "nothing"))

    def test_single_frames_are_sets_too(self):
        frame = (0x701, bytes(7) + checksum(0x701, bytes(7)))
        self.assertEqual(self.accept([frame])[0]["State"], "starting")


class Buses(unittest.TestCase):
    def test_two_ends_of_a_virtual_bus_understand_each_other(self):
        import can

        a, b = (Bus.__new__(Bus) for _ in range(2))
        for end in (a, b):
            end.catalogue, end.decoder, end.counters, end.fd = catalogue, Decoder(catalogue), {}, False
            end.bus = can.Bus(interface="virtual", channel="narpa-test")
        with a, b:
            for t_ns in (10, 20):
                a.send_pose(0x110, t_ns, (1, 2, 3), (1, 0, 0, 0), velocity=(0.1, 0, 0))
            first, second = b.receive(1), b.receive(1)
            self.assertEqual((first.base, first["Time"], second["Time"]), (0x110, 10, 20))
            self.assertEqual((first.counter + 1) % 256, second.counter)
            self.assertIsNone(b.receive(0.05))


if __name__ == "__main__":
    unittest.main()
