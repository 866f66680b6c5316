"""A browser without a picture: it says what Chromium would, and whatever else it is told to say."""

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
    """A connection that hears everything, and keeps the last of it."""

    def __init__(self, server):
        self.messages = 0
        """So many have been heard."""
        self.last = {}
        """What the last of them told."""
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
        """All inputs of the panel."""
        return list(self.client.gui._gui_input_handle_from_uuid.values())

    def say(self, kind, **fields):
        """Send a message, however wrong."""
        self._socket.send(msgspec.msgpack.encode({"type": kind} | fields))

    def set(self, handle, value):
        """Send another value of an input."""
        self.say("GuiUpdateMessage", uuid=handle._impl.uuid, updates={"value": value})

    def heard(self, server):
        """Wait until all that was said has been read: a moved camera is the last of it."""
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
