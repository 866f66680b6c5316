"""A browser without a picture: it sends what Chromium would, and any other message on request."""

from __future__ import annotations

import threading
import time

import msgspec
import viser
import zstandard
from deadlines import DEADLINE_S
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

CAMERA = {
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [3.0, 3.0, 3.0],
    "fov": 1.3,
    "near": 0.1,
    "far": 1000.0,
    "image_height": 640,
    "image_width": 1000,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


class RawBrowser:
    """A connection that receives every message, and keeps the last one."""

    def __init__(self, server):
        self.messages = 0
        """The number of messages received."""
        self.last = {}
        """The content of the last message."""
        before = set(server.get_clients())
        address = f"ws://127.0.0.1:{server.get_port()}"
        self._socket = connect(address, subprotocols=[f"viser-v{viser.__version__}"])
        self._hearing = threading.Thread(target=self._hear, daemon=True)
        self._hearing.start()
        self.say("ViewerCameraMessage", **CAMERA)
        deadline = time.monotonic() + DEADLINE_S
        while not (new := set(server.get_clients()) - before):
            assert time.monotonic() < deadline, "the server to know the browser"
            time.sleep(0.005)
        self.client = server.get_clients()[new.pop()]

    def inputs(self):
        """Return all inputs of the panel."""
        return list(self.client.gui._gui_input_handle_from_uuid.values())

    def say(self, kind, **fields):
        """Send a message, valid or not."""
        self._socket.send(msgspec.msgpack.encode({"type": kind} | fields))

    def set(self, handle, value):
        """Send a new value of an input."""
        self.say("GuiUpdateMessage", uuid=handle._impl.uuid, updates={"value": value})

    def heard(self, server):
        """Wait until the server has read all messages: send a moved camera, and wait for it."""
        place = [time.monotonic() % 1e3, 0.0, 0.0]
        self.say("ViewerCameraMessage", **CAMERA | {"position": place})
        deadline = time.monotonic() + DEADLINE_S
        while list(self.client.camera.position) != place:
            assert time.monotonic() < deadline, "the camera to be heard"
            assert self.client.client_id in server.get_clients(), "the connection has ended"
            time.sleep(0.005)

    def close(self):
        self._socket.close()
        self._hearing.join()

    def _hear(self):
        try:
            while True:
                data = self._socket.recv()
                size = int.from_bytes(data[8:16], "little")
                told = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])
                self.last = msgspec.msgpack.decode(told)
                self.messages += 1
        except ConnectionClosed:
            pass
