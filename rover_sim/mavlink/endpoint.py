"""One MAVLink component on any number of links: who is there, what they say, what is said to them."""

from __future__ import annotations

import ipaddress
import select
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from rover_sim.mavlink.dialect import (
    MAVLINK_1,
    MAVLINK_2,
    Message,
    Packer,
    Parser,
    Signer,
    is_signed,
    mavlink,
    unsigned,
)
from rover_sim.mavlink.streams import Streams
from rover_sim.mavlink.tlog import TlogWriter
from rover_sim.mavlink.transport import Learner, Transport

# Not written to the log: a file that is fetched (it may be the log itself), and a secret key.
_UNLOGGED = (mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL, mavlink.MAVLINK_MSG_ID_SETUP_SIGNING)
SIMULATOR = int(mavlink.MAV_COMP_ID_USER1)  # the component as which the simulator itself speaks


@dataclass(frozen=True)
class Link:
    """A transport, and what its peers get without asking."""

    transport: Transport
    rates_hz: Mapping[int, float]
    hears_simulator: bool = False  # also what no vehicle could know; never a planner's link
    is_cable: bool = False  # nobody else can listen


@dataclass(eq=False)
class Channel:
    """One peer of one link.

    Sequence numbers are counted by channel, as ArduPilot and PX4 do: a peer measures link loss by their gaps, and
    what is said to others must not look like loss to it.
    """

    link: Link
    peer: str
    system: int
    parser: Parser
    streams: Streams
    signer: Signer | None = None
    number: int = 0  # of the link, as signatures tell it
    heard_version: int | None = None  # first byte of its frames
    vouched: bool = False  # has sent a frame with the right signature
    _packers: dict[int, Packer] = field(default_factory=dict)

    def note_version(self, message: Message) -> None:
        """Speak MAVLink 1 to a peer that begins so, until it shows that it knows MAVLink 2."""
        version = int(message.get_msgbuf()[0])
        if self.heard_version not in (version, MAVLINK_2):
            self.heard_version = version

    @property
    def is_private(self) -> bool:
        """Whether a secret may pass: a cable, or a peer on this machine."""
        if self.link.is_cable:
            return True
        try:
            return ipaddress.ip_address(self.peer.rpartition(":")[0]).is_loopback
        except ValueError:  # no address
            return False

    def frame(self, message: Message, component: int) -> bytes | None:
        """The message as a component says it to this peer; None if it cannot be said in the peer's MAVLink."""
        if component not in self._packers:
            self._packers[component] = Packer(self.system, component, self.signer, self.number)
        packer = self._packers[component]
        packer.version_1 = self.heard_version == MAVLINK_1
        return packer.pack(message) if packer.knows(message) else None


class Client(NamedTuple):
    """Who is talking: one system and component on one channel.

    Two ground stations may share a system number (QGroundControl and MAVProxy both are 255), so all three count.
    """

    channel: Channel
    system: int
    component: int


class Endpoint:
    """A component's links; more components of the system may use them. A log hears all that is said and heard."""

    def __init__(
        self,
        system: int,
        component: int,
        links: Iterable[Link],
        log: Link | None = None,
        others: Iterable[int] = (),
        signer: Signer | None = None,
    ) -> None:
        """``others``: components beside ``component`` that use these links; ``signer``: for all frames."""
        self.system = system
        self.component = component
        self._addresses = {0, component, *others}
        self.time_s = 0.0
        self._links = list(links)
        self._channels: dict[tuple[int, str], Channel] = {}
        self._signer = signer
        self._channel_count = 0
        self._log = None if log is None else Channel(log, "tlog", system, Parser(), Streams(log.rates_hz))
        self._tlog = log.transport if log is not None and isinstance(log.transport, TlogWriter) else None
        for number, link in enumerate(self._links):
            self._refresh(number, link, self.time_s)

    @property
    def channels(self) -> list[Channel]:
        """All listeners, the log included."""
        return [*self._channels.values(), *([self._log] if self._log else [])]

    @property
    def station_count(self) -> int:
        """Listeners other than the log."""
        return len(self._channels)

    def wait(self, seconds: float) -> bool:
        """Sleep, at most so long; True as soon as there is news on a link, which `poll` then takes."""
        handles = [handle for link in self._links for handle in link.transport.handles()]
        return bool(select.select(handles, [], [], seconds)[0])

    def poll(self, time_s: float) -> list[tuple[Client, Message]]:
        """Messages that have arrived for this component or for everyone."""
        self.time_s = time_s
        heard: list[tuple[Client, Message]] = []
        for number, link in enumerate(self._links):
            chunks = link.transport.receive(time_s)
            self._refresh(number, link, time_s)
            for peer, data in chunks:
                channel = self._channels.get((number, peer))
                if channel is None:
                    continue
                read = channel.parser.stream if link.transport.is_stream else channel.parser.datagram
                for message in read(data):
                    channel.note_version(message)
                    channel.vouched |= self._signs and is_signed(message.get_msgbuf())
                    self._record(message, time_s)
                    if self._is_for_us(message):
                        heard.append((Client(channel, message.get_srcSystem(), message.get_srcComponent()), message))
            self._turn_away(number, link, {peer for peer, _ in chunks})
        return heard

    def reply(self, client: Client, message: Message, component: int | None = None) -> None:
        """Say something to one client, as the component itself or as another."""
        self._send(client.channel, message, component)
        if self._log is not None and client.channel is not self._log and message.id not in _UNLOGGED:
            self._send(self._log, message, component)

    def stream(self, channel: Channel, message: Message) -> None:
        """Send to one listener what its schedule asks for."""
        self._send(channel, message)

    def broadcast(self, message: Message, component: int | None = None) -> None:
        """Say something to everyone, as the component itself or as another."""
        for channel in self.channels:
            self._send(channel, message, component)

    def forward(self, client: Client, message: Message) -> None:
        """Pass on what another component of this system said, to all who have not heard it; the log has."""
        for channel in self._channels.values():
            if channel is not client.channel:
                self._send(channel, message, client.component)

    def tell_as_simulator(self, message: Message) -> None:
        """Say something as the simulator, a component of its own, to those who are to hear it."""
        for channel in self.channels:
            if channel.link.hears_simulator:
                self._send(channel, message, SIMULATOR)

    def close(self) -> None:
        """Close all links and the log."""
        for link in self._links:
            link.transport.close()
        if self._log is not None:
            self._log.link.transport.close()

    def _channel(self, link: Link, peer: str) -> Channel:
        self._channel_count += 1
        number = self._channel_count & 0xFF
        signer = self._signer
        return Channel(link, peer, self.system, Parser(signer), Streams(link.rates_hz), signer, number)

    def _refresh(self, number: int, link: Link, time_s: float) -> None:
        """Peers come and go."""
        peers = link.transport.peers(time_s)
        for peer in peers:
            if (number, peer) not in self._channels:
                self._channels[number, peer] = self._channel(link, peer)
        gone = [key for key in self._channels if key[0] == number and key[1] not in peers]
        for key in gone:
            del self._channels[key]

    @property
    def _signs(self) -> bool:
        return self._signer is not None and self._signer.key is not None

    def _turn_away(self, number: int, link: Link, spoken: set[str]) -> None:
        """With a key, who speaks without it is no listener, and takes the place of none."""
        if not (self._signs and isinstance(link.transport, Learner)):
            return
        for peer in spoken:
            channel = self._channels.get((number, peer))
            if channel is None or not channel.vouched:
                link.transport.forget(peer)
        self._refresh(number, link, self.time_s)

    def _send(self, channel: Channel, message: Message, component: int | None = None) -> None:
        frame = channel.frame(message, self.component if component is None else component)
        if frame is not None:
            channel.link.transport.send(frame, channel.peer, self.time_s)

    def _record(self, message: Message, time_s: float) -> None:
        if self._tlog is not None and message.id not in _UNLOGGED:
            self._tlog.record(unsigned(message), time_s)

    def _is_for_us(self, message: Message) -> bool:
        """Own number or broadcast; MAVProxy addresses some commands to component 0."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, self.system) and (system == 0 or component in self._addresses)
