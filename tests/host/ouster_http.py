#!/usr/bin/python3
"""The start-up sequence of a driver with an emulated OS1 on the network: it reads the firmware version, sets the destination of
the packets, restarts the sensor, reads the metadata, and decodes the packets that arrive. Clients with malformed or huge
requests get errors, and they and silent clients do not disturb the packets.
"""
import json
import socket
import urllib.error
import urllib.parse
import urllib.request

import support
from support import expect

try:
    import numpy as np

    from narpa import ouster
except ImportError as error:
    support.skip(f"{error} (python3-numpy)")

SCENE = """
[scene]
name = "shell"
epoch = 2026-11-21T12:00:00Z
[ambient]
radiance = 1
[[body]]
name = "shell"
sphere = {radius_m = 30}
material = {kind = "lambert", albedo = 0.5}
[[lidar]]
name = "os1"
model = "os1-16"
columns = 512
"""
CENTRE_M = np.array([0.0, 0.0, 0.0])  # of the shell; the base of the LiDAR is at the same point


class Client:
    def __init__(self, port):
        self.port, self.url = port, f"http://127.0.0.1:{port}/api/v1/"

    def get(self, path):
        with urllib.request.urlopen(self.url + path, timeout=120) as answer:
            return answer.read().decode()

    def post(self, path, body):
        request = urllib.request.Request(self.url + path, data=body, headers={"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=120) as answer:
            return answer.read().decode()

    def refused(self, method, *arguments):
        try:
            method(*arguments)
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()
        return 200, ""

    def raw(self, data):
        """Sends data; returns all that is received until the server closes the connection."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=120) as s:
            s.sendall(data)
            answer = b""
            while piece := s.recv(4096):
                answer += piece
        return answer


def receiver():
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    s.bind(("127.0.0.1", 0))
    s.settimeout(20)
    return s, s.getsockname()[1]


def turn_of(s, sensor):
    """The packets of the next complete turn."""
    packets = []
    while len(packets) < sensor.columns // ouster.COLUMNS:
        packet = sensor.packet(s.recv(65536))
        if packet.column[0] == 0:
            packets = []
        if packets or packet.column[0] == 0:
            packets.append(packet)
    return packets


def check_turn(packets, sensor, what):
    columns = np.concatenate([p.column for p in packets])
    expect((columns == np.arange(sensor.columns)).all() and len({p.frame_id for p in packets}) == 1, f"{what}: a whole turn, in order")
    points = np.concatenate([sensor.positions(p.column, p.fields["range"]).reshape(-1, 3) for p in packets])
    off = np.abs(np.linalg.norm(points - CENTRE_M, axis=1) - 30).max()
    expect(len(points) == 16 * sensor.columns and off < 0.000501, f"{what}: {len(points)} points within {1000 * off:.3f} mm of the surface")


def expect_silence(s):
    s.settimeout(0.5)
    try:
        for _ in range(1000):  # 3 s
            s.recv(65536)
    except socket.timeout:
        expect(True, "without a destination packets end")
        return
    expect(False, "without a destination packets end")


def start(client, port):
    """Starts the sensor in the sequence of Ouster's driver."""
    firmware = json.loads(client.get("system/firmware"))["fw"]
    expect("v2.4.0" in firmware, f"firmware {firmware}")
    active = json.loads(client.get("sensor/cmd/get_config_param?args=active"))
    expect(active["udp_dest"] == "" and active["lidar_mode"] == "512x10", "the active configuration has no destination yet")
    expect(client.get("sensor/cmd/set_udp_dest_auto") == "{}", "the destination is set to the client")
    staged = json.loads(client.get("sensor/cmd/get_config_param?args=staged"))
    expect(staged["udp_dest"] == "127.0.0.1", "and is staged")
    staged["udp_port_lidar"] = port
    value = urllib.parse.quote(json.dumps(staged))
    expect(client.get(f"sensor/cmd/set_config_param?args=.+{value}") == '"set_config_param"', "the whole configuration is taken")
    expect(client.get("sensor/cmd/reinitialize") == "{}", "the sensor starts anew")


def check_abuse(client):
    expect(client.raw(b"\x16\x03\x01\x02\x00\r\n\r\n").startswith(b"HTTP/1.1 400"), "malformed: refused")
    expect(client.raw(b"GET /" + b"a" * 1_000_000 + b" HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 431"), "a huge head: refused")
    status, words = client.refused(client.post, "sensor/config", b"x" * 10_000_000)
    expect(status == 413 and "longer than" in words, f"a huge body: refused, {words.strip()}")
    for body, expected in ((b'{"lidar_mode": "2048x10"}', "the emulated scene sets it"), (b'{"udp_dest": "a"}', "IPv4"), (b"{", "not JSON")):
        status, words = client.refused(client.post, "sensor/config", body)
        expect(status == 400 and expected in words, f"{body.decode()}: {words.strip()}")
    expect(client.refused(client.get, "sensor/nothing")[0] == 404, "an unknown resource: 404")


def main():
    folder = support.work_folder()
    scene = folder / "shell.toml"
    scene.write_text(SCENE)
    port = support.free_port()
    client, (s, udp_port) = Client(port), receiver()
    with support.Run(scene, "--lidar", f"os1=ouster:{port}", "--duration", 600) as run:
        run.wait_for("Ouster sensor")
        start(client, udp_port)
        metadata = json.loads(client.get("sensor/metadata"))
        sensor = ouster.Sensor(metadata)
        expect(metadata["config_params"]["udp_port_lidar"] == udp_port, "the metadata have the port that was asked for")
        check_turn(turn_of(s, sensor), sensor, "as configured")

        silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(20)]
        for c in silent:
            c.sendall(b"GET / HT")
        before = turn_of(s, sensor)
        check_turn(before, sensor, "with silent clients on all connections")
        for c in silent:
            c.close()
        check_abuse(client)
        check_turn(turn_of(s, sensor), sensor, "after all of these")

        other, other_port = receiver()
        client.post("sensor/config", json.dumps({"udp_port_lidar": other_port}).encode())
        check_turn(turn_of(other, sensor), sensor, "at another port")
        client.post("sensor/config", b'{"udp_dest": ""}')
        expect_silence(other)
        report = run.stop()
    lidar = report["lidars"][0]
    sink = lidar["sinks"][0]
    expect(lidar["packets"] > sink["sent"] > 100 and sink["dropped"] == 0, f"{sink['sent']} of {lidar['packets']} packets were asked for")


main()
