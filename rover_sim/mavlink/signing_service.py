"""SETUP_SIGNING: a ground station hands over the key of message signing."""

from __future__ import annotations

from collections.abc import Mapping

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.signing import Signing
from rover_sim.mavlink.status import status_texts

_TEXT = 3  # number of this service's long texts


class SigningService:
    """Takes a key over loopback or a cable, from anyone who is believed, while the rover is disarmed."""

    def __init__(self, context: Context, signing: Signing) -> None:
        self._context = context
        self._signing = signing

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """The one message; it has no acknowledgement, so a text says what was done."""
        return {"SETUP_SIGNING": self._set_up}

    def tick(self) -> None:
        """Nothing happens by itself."""

    def _set_up(self, client: Client, message: Message) -> None:
        severity = mavlink.MAV_SEVERITY_WARNING
        if not client.channel.is_private:
            text = "Signing key refused: it may come over loopback or a serial line only"
        elif self._context.autopilot.armed:
            text = "Signing key refused: armed"
        else:
            key = bytes(message.secret_key)
            self._signing.set_key(key if any(key) else None, message.initial_timestamp)
            severity = mavlink.MAV_SEVERITY_INFO
            text = "Signing is on until restart" if self._signing.active else "Signing is off until restart"
        for part in status_texts(severity, text, _TEXT):
            self._context.endpoint.reply(client, part)
