"""Serial links: a POSIX terminal device in raw mode."""

from __future__ import annotations

import os

from rover_sim.errors import InputError, LinkError
from rover_sim.mavlink.sockets import CHUNK_BYTES
from rover_sim.mavlink.transport import LinkUrl

_MOST_UNSENT_BYTES = 65536  # about a minute of 9600 baud: what is older is of no use


class SerialPort:
    """One device with one peer at its other end; a device that is pulled out is a peer that is gone."""

    is_stream = True

    def __init__(self, url: LinkUrl) -> None:
        self._peer = url.host
        self._unsent = bytearray()
        self._device: int | None = _opened(url)

    def peers(self, time_s: float) -> tuple[str, ...]:  # noqa: ARG002  (the interface passes the time)
        """The other end, while the device is there."""
        return () if self._device is None else (self._peer,)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:  # noqa: ARG002
        """Send; a frame that finds the line full is lost whole."""
        if len(self._unsent) + len(frame) <= _MOST_UNSENT_BYTES:
            self._unsent += frame
        self._flush()

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:  # noqa: ARG002
        """Bytes since the last call."""
        self._flush()
        if self._device is None:
            return []
        try:
            data = os.read(self._device, CHUNK_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:  # hung up: a line without news says "would block"
            self.close()
        return [(self._peer, data)] if data else []

    def handles(self) -> tuple[int, ...]:
        """The device, while it is there."""
        return () if self._device is None else (self._device,)

    def close(self) -> None:
        """Release the device."""
        if self._device is not None:
            os.close(self._device)
            self._device = None

    def _flush(self) -> None:
        try:
            while self._unsent and self._device is not None:
                del self._unsent[: os.write(self._device, self._unsent)]
        except BlockingIOError:
            pass  # the line is slower than we are: the rest goes out next time
        except OSError:
            self.close()


def _opened(url: LinkUrl) -> int:
    """The device in raw mode at the URL's speed; raises LinkError if there is none, InputError for the speed."""
    try:
        import termios
        import tty
    except ImportError as error:  # Windows
        raise LinkError(f"link {url.text!r}: serial devices need Linux or macOS") from error
    speed = getattr(termios, f"B{url.port}", None)
    if speed is None:
        raise InputError(f"link {url.text!r}: speed {url.port}; allowed: a standard one such as 57600 or 115200")
    try:
        device = os.open(url.host, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise LinkError(f"link {url.text!r}: cannot open {url.host} ({error.strerror})") from error
    try:
        tty.setraw(device)
        settings = termios.tcgetattr(device)
        settings[4] = settings[5] = speed
        termios.tcsetattr(device, termios.TCSANOW, settings)
    except termios.error as error:
        os.close(device)
        raise LinkError(f"link {url.text!r}: {url.host} is not a serial device") from error
    return device
