"""ArduPilot's side of the JSON physics link, imitated: in memory, deterministic, on a clock that is passed in.

It behaves as SITL of ArduRover 4.6 was measured or read to behave, its text scanner included, and it is not ArduPilot:
a run with it is no run with the autopilot. In strict mode, the default, whatever SITL would tolerate or only print a
line about is an error here.
"""

from __future__ import annotations

import re
import struct
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import isnan

BUFFER_BYTES = 65_000
RESEND_S = 1.1  # 11 polls of 100 ms
NEUTRAL = (1500,) * 4 + (1000,) * 12  # channels before the autopilot writes any
Vector = tuple[float, ...]

_NUMBER = r"[+-]?(?:nan|inf(?:inity)?|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
_SCALAR = re.compile(rf"\s*({_NUMBER})", re.IGNORECASE)
_ELEMENT = re.compile(rf"\s*({_NUMBER})", re.IGNORECASE)
# Section, key, how many numbers (0: a scalar), mandatory; in the order in which SITL looks for them.
_TABLE: tuple[tuple[str, str, int, bool], ...] = (
    ("", "timestamp", 0, True),
    ("imu", "gyro", 3, True),
    ("imu", "accel_body", 3, True),
    ("", "position", 3, True),
    ("", "attitude", 3, False),
    ("", "quaternion", 4, False),
    ("", "velocity", 3, True),
    *(("", f"rng_{number}", 0, False) for number in range(1, 7)),
    ("windvane", "direction", 0, False),
    ("windvane", "speed", 0, False),
    ("", "airspeed", 0, False),
    ("", "no_time_sync", 0, False),
)


class SitlAbortError(Exception):
    """SITL ends with a floating point exception."""


class RefusalError(AssertionError):
    """Strict mode: the back end did something that SITL would only tolerate."""


@dataclass(frozen=True)
class Accepted:
    """What the autopilot believes of the physics after a reply."""

    time_s: float
    values: dict[str, Vector]

    def vector(self, key: str) -> Vector:
        return self.values[key]


PwmSource = Callable[[float, Accepted | None], Sequence[int]]


def neutral(time_s: float, state: Accepted | None) -> Sequence[int]:
    """An autopilot that drives nothing."""
    del time_s, state
    return NEUTRAL


def pack(rate_hz: int, count: int, pwm: Sequence[int]) -> bytes:
    """A servo packet of 16 or 32 channels."""
    magic = {16: 18458, 32: 29569}[len(pwm)]
    return struct.pack(f"<HHI{len(pwm)}H", magic, rate_hz, count, *pwm)


def clamped(pwm: Sequence[int]) -> tuple[int, ...]:
    """Rover's simulation clamps channels 1 and 3: an output that is off arrives as 1000, full speed astern."""
    return tuple(min(max(value, 1000), 2000) if number in (0, 2) else value for number, value in enumerate(pwm))


def mix(throttle: float, steering: float) -> tuple[int, int]:
    """Pulses of left and right side; positive steering is clockwise, saturation is shared."""
    most = max(1.0, abs(throttle) + abs(steering))
    left, right = (throttle + steering) / most, (throttle - steering) / most
    return round(1500 + 500 * left), round(1500 + 500 * right)


def servos(left: int, right: int) -> tuple[int, ...]:
    """Sixteen channels with SERVO1 and SERVO3 driven."""
    return (left, 1500, right, 1500, *NEUTRAL[4:])


@dataclass
class Scan:
    """What the text scanner found in one message."""

    found: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    unparsable: str | None = None

    @property
    def refused(self) -> str | None:
        """Why no step is made; None where the message is taken."""
        if self.missing:
            return f"Failed to find key {', '.join(self.missing)}; Did not contain all mandatory fields"
        if not {"attitude", "quaternion"} & set(self.found):
            return "Did not receive attitude or quaternion"
        return None


def scan(text: str, values: dict[str, Vector]) -> Scan:
    """Read a message into ``values`` as SITL does: first occurrence of a name, no look at quotes or structure."""
    seen = Scan()
    for section, key, count, mandatory in _TABLE:
        name = f"{section}.{key}" if section else key
        begin = text.find(section)
        place = -1 if begin < 0 else text.find(key, begin + len(section) + 1)
        if place < 0:
            if mandatory:
                seen.missing.append(name)
            continue
        seen.found.append(name)
        rest = text[place + len(key) + 2 :]
        if count == 0:
            match = _SCALAR.match(rest)
            values[name] = (_number(match[1]) if match else 0.0,)
        elif not _scan_array(rest, name, count, values):
            seen.unparsable = name
            break
    return seen


def _scan_array(rest: str, name: str, count: int, values: dict[str, Vector]) -> bool:
    """sscanf of "[%f, %f, ...]": numbers before the first mismatch are kept."""
    numbers = list(values.get(name, (0.0,) * count))
    place, good = 1, rest.startswith("[")
    for index in range(count):
        if not good:
            break
        if index:
            good = rest[place : place + 1] == ","
            place += 1
        match = _ELEMENT.match(rest, place) if good else None
        good = match is not None
        if match is not None:
            numbers[index], place = _number(match[1]), match.end()
    values[name] = tuple(numbers)
    return good


def _number(text: str) -> float:
    value = float(text)
    if isnan(value) or value in (float("inf"), float("-inf")):
        raise SitlAbortError("Floating point exception - aborting")
    return value


class ArduPilotDouble:
    """One SITL process: `packets` are what it sends at a time, `deliver` is a datagram that reaches it.

    ``step_s``: the step agreed with the physics, checked in strict mode; None takes any.
    """

    def __init__(
        self,
        pwm: PwmSource = neutral,
        *,
        rate_hz: int = 240,
        step_s: float | None = 1.0 / 240.0,
        channels: int = 16,
        strict: bool = True,
    ) -> None:
        self._pwm, self._target_hz, self._step_s, self._channels, self.strict = pwm, rate_hz, step_s, channels, strict
        self.rate_hz = float(rate_hz)
        self.count = 0
        self.clock_s = 0.0
        self.last_time_s = 0.0  # of the physics
        self.alive = True
        self.log: list[str] = []
        self.values: dict[str, Vector] = {}
        self.states: list[Accepted] = []
        self._buffer = b""
        self._inbox: deque[bytes] = deque()
        self._sent: bytes | None = None  # the packet that waits for its reply
        self._sent_s = 0.0
        self._requests = self._replies = 0
        self._answers: dict[int, bytes] = {}  # first reply to each count

    @property
    def state(self) -> Accepted | None:
        """The last accepted state."""
        return self.states[-1] if self.states else None

    @property
    def jammed(self) -> bool:
        """Whether the buffer is full: nothing is parsed any more."""
        return len(self._buffer) >= BUFFER_BYTES

    def packets(self, now_s: float) -> list[bytes]:
        """Take in the replies that have come, and say what is sent now: a new packet, or the old one after silence."""
        sent: list[bytes] = []
        if self._sent is None:
            sent.append(self._request(now_s))
        while self._inbox:
            self._work(self._inbox.popleft())
            if self._sent is None:
                sent.append(self._request(now_s))
        if not sent and now_s - self._sent_s >= RESEND_S - 1e-9:
            sent.append(self._repeat(now_s))
        return sent

    def deliver(self, data: bytes) -> None:
        """A reply arrives; nobody looks at where it comes from."""
        self._replies += 1
        self._check_reply(data)
        self._inbox.append(data)

    def restart(self) -> None:
        """A new process: count, clock and all that was believed begin anew."""
        self.__init__(  # type: ignore[misc]
            self._pwm, rate_hz=self._target_hz, step_s=self._step_s, channels=self._channels, strict=self.strict
        )

    def _request(self, now_s: float) -> bytes:
        pwm = clamped(self._pwm(self.clock_s, self.state))
        pwm = (*pwm, *(1000,) * (self._channels - len(pwm)))
        self._sent = pack(int(self.rate_hz), self.count, pwm)
        return self._repeat(now_s)

    def _repeat(self, now_s: float) -> bytes:
        assert self._sent is not None
        self._sent_s = now_s
        self._requests += 1
        return self._sent

    def _work(self, data: bytes) -> None:
        """One datagram from the queue; whatever comes of it, the packet is asked for anew or the next one is."""
        if self.jammed:
            return
        self._buffer += data[: BUFFER_BYTES - len(self._buffer)]
        last = self._buffer.rfind(b"\n")
        first = self._buffer.rfind(b"\n", 0, last) if last > 0 else -1
        self._sent = None
        if first < 0:
            self._refuse("no message between two line ends")
        else:
            self._parse(self._buffer[first + 1 : last].decode("ascii", "replace"), last)
        self.rate_hz += min(max(self._target_hz - self.rate_hz, -1.0), 1.0)

    def _parse(self, text: str, last: int) -> None:
        try:
            seen = scan(text, self.values)
        except SitlAbortError:
            self.alive = False
            raise
        if seen.refused is not None:
            self._refuse(seen.refused)
            return
        if seen.unparsable is not None:
            self._note(f"Failed to parse {seen.unparsable}")
        self._check_order(text, seen)
        self._buffer = self._buffer[last:]
        self._accept()

    def _accept(self) -> None:
        (time_s,) = self.values["timestamp"]
        step_s = time_s - self.last_time_s
        if step_s < 0.0:
            self._note("Detected physics reset")
            step_s = 0.0
        if self.strict and self._step_s is not None and abs(step_s - self._step_s) > 1e-9:
            raise RefusalError(f"a step of {step_s!r} s, agreed: {self._step_s!r}")
        self.last_time_s = time_s
        self.clock_s += step_s
        if 0.0 < step_s < 0.1:
            self.rate_hz = 1.0 / step_s
        self.count += 1
        self.states.append(Accepted(self.clock_s, dict(self.values)))

    def _refuse(self, text: str) -> None:
        """No step: the same count is asked for again."""
        self._note(text)

    def _note(self, text: str) -> None:
        self.log.append(text)
        if self.strict:
            raise RefusalError(text)

    def _check_reply(self, data: bytes) -> None:
        if not self.strict:
            return
        if not (data.startswith(b"\n") and data.endswith(b"\n") and data.count(b"\n") == 2):
            raise RefusalError("a message is a line end, one line and a line end")
        if self._replies > self._requests:
            raise RefusalError("more than one reply to a packet")
        if self._answers.setdefault(self.count, data) != data:
            raise RefusalError(f"two different replies to frame {self.count}")

    def _check_order(self, text: str, seen: Scan) -> None:
        """Strict: keys stand in the order in which they are looked for."""
        if not self.strict:
            return
        places = [text.find(f'"{name.rpartition(".")[2]}":') for name in seen.found]
        if -1 in places or places != sorted(places):
            raise RefusalError(f"keys not in the order {seen.found}: {text}")
