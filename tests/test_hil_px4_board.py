"""PX4 on a board, with a pseudo-terminal in the place of the serial line."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from rover_sim.driven_rover import home
from rover_sim.errors import InputError, LinkError
from rover_sim.hil.autopilot_link import AutopilotLink
from rover_sim.hil.handling import measure_handling
from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.px4_parameters import parameters
from rover_sim.hil.px4_peer import BOARD, Px4Peer
from rover_sim.hil.px4_session import STEPS_PER_S, Clockwork, Px4Session
from rover_sim.hil.serial_board import BoardPort, SharedLine, is_board, open_board
from rover_sim.hil.session import Driven, Watchers
from rover_sim.mavlink.dialect import Packer, mavlink
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.transport import LinkUrl
from rover_sim.pacing import Pace, wait_for_news
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, Traverse
from tests.px4_board import BoardOnPty, Px4Board
from tests.px4_board_vehicle import DrivingBoard
from tests.px4_double import Outputs
from tests.px4_rig import Drive, session
from tests.sim_factory import make_world, slope
from worlds.build import build_world
from worlds.scenario import Camera, Goal, Origin, Rocks, Scenario, SoilChoice, Terrain

LINE = "/dev/ttyACM0,921600"


def test_a_board_drives_at_the_pace_of_the_wall_clock() -> None:
    """Woken by a heartbeat, told sensors and never the truth; how steadily they went out is in the summary."""
    drive, pace = Drive(make_world(slope(0.0, 16.0)), 2.0), Pace(0.25)
    with BoardOnPty(Px4Board(lambda checks: Outputs(checks.elapsed_usec > 500_000, 0.5, 0.5))) as pty:
        line = SharedLine(open_board(f"{pty.device},921600"))
        summary = session(drive, line.simulator, wait_for_news, left_s=pace.left_s, profile=BOARD).run()
        line.close()
    believed = pty.checks.believed
    assert believed.sensors >= 490
    assert believed.truth is None
    assert pty.board.heartbeats >= 2
    assert drive.simulation.chassis_motion[0] > 0.3
    assert summary["hil"]["lockstep"] is None
    assert 0.0 < summary["hil"]["beat"]["rate_hz"] < 260.0
    assert set(summary["hil"]["beat"]) == {"rate_hz", "median_ms", "p99_ms", "longest_ms"}


def test_a_board_that_is_not_in_hil_mode_is_told_from_one_that_is_silent() -> None:
    drive, said = Drive(make_world(slope(0.0)), 1.0), list[str]()
    with BoardOnPty(Px4Board(in_hil=False)) as pty:
        line = SharedLine(open_board(pty.device))
        with pytest.raises(LinkError, match=r"waited 1 s for HIL mode .*SYS_HITL must be 1"):
            session(
                drive,
                line.simulator,
                wait_for_news,
                patience_s=1.0,
                profile=BOARD,
                watchers=Watchers(say=said.append),
            ).run()
        line.close()
    assert said[0] == "waiting for a HEARTBEAT of PX4 at the link"


def test_a_board_that_is_pulled_out_is_a_lost_link() -> None:
    pty = BoardOnPty(Px4Board())
    drive = Drive(make_world(slope(0.0)), 4.0, lambda step: pty.end() if step == 250 else None)
    with pty:
        line = SharedLine(open_board(pty.device))
        summary = session(
            drive, line.simulator, wait_for_news, left_s=Pace(0.25).left_s, patience_s=0.3, profile=BOARD
        ).run()
        line.close()
    assert (summary["reason"], summary["detail"]) == ("link_lost", "waited 0.3 s for PX4 at the link")


def test_a_board_that_starts_again_is_found_again(tmp_path: Path) -> None:
    """Its device goes and comes back, and the traverse begins anew."""
    device = tmp_path / "board"
    boards = [BoardOnPty(Px4Board(lambda _: Outputs(True, 0.1, 0.1))) for _ in range(2)]

    def plug(board: BoardOnPty) -> None:
        device.unlink(missing_ok=True)
        device.symlink_to(board.device)
        board.__enter__()

    def restart(step: int) -> None:
        if step == 100:
            boards[0].end()
            plug(boards[1])

    plug(boards[0])
    world = make_world(slope(0.0))
    line = SharedLine(BoardPort(LinkUrl("board", "serial", str(device), 921600)))
    try:
        drives = [Drive(world, 4.0, restart), Drive(world, 1.0)]
        left_s = Pace(0.25).left_s
        summary = session(drives, line.simulator, wait_for_news, left_s=left_s, profile=BOARD).run()
    finally:
        line.close()
        boards[1].end()
    assert (summary["hil"]["restarts"], summary["hil"]["steps"]) == (1, 250)
    assert boards[1].checks.believed.sensors >= 230


@pytest.mark.slow
def test_a_mission_over_one_line_at_the_pace_of_the_wall_clock() -> None:
    """HIL messages, missions and telemetry on the same pseudo-terminal; the board drives by its own clock."""
    scenario = Scenario(
        name="bench",
        terrain=Terrain(kind="flat", size_m=(10.0, 8.0), resolution_m=0.1),
        rocks=Rocks(cfa=0.0),
        soil=SoilChoice(preset="firm"),
        camera=Camera(rate_hz=1.0),
        goal=Goal(position_m=(2.0, 0.0), time_limit_s=60.0),
    )
    world, rover = build_world(scenario, 0), load_rover("husky")
    frame = LocalFrame(world.origin)
    place = frame.to_geo(home(world))
    handling = measure_handling(rover, world.soil, scenario.gravity_m_s2)
    values = parameters(rover, handling, scenario.goal.radius_m, board=True)
    board = DrivingBoard(Origin(place.latitude_deg, place.longitude_deg, place.altitude_m), values)
    with BoardOnPty(board) as pty:
        line = SharedLine(open_board(pty.device))

        def begin() -> Driven:
            link, outputs = AutopilotLink(frame, home(world), line.planner), OutputDriver(rover.footprint())
            return Driven(Traverse(world, rover, outputs, link, RunOptions(link_grace_s=31.0), STEPS_PER_S), outputs)

        def meet(driven: Driven) -> Px4Peer:
            x, y, z = driven.traverse.simulation.chassis_motion[:3].tolist()
            return Px4Peer(line.simulator, frame, (x, y, z), pty.device, BOARD)

        clockwork = Clockwork(wait_for_news, Pace(BOARD.forgiven_s).left_s, 10.0)
        with Px4Session(begin, meet, clockwork) as served:
            summary = served.run()
        line.close()
    assert summary["reason"] == "goal", summary
    assert board.rover.driven
    assert board.checks.believed.truth is None
    assert summary["hil"]["beat"]["rate_hz"] < 255.0


def test_planner_and_stations_share_the_line() -> None:
    """What the planner's end and a station say reaches the board; what the board says reaches them both."""
    station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    station.bind(("127.0.0.1", 0))
    station.settimeout(5.0)
    arm = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, *(0.0,) * 6)
    with BoardOnPty(Px4Board()) as pty:
        line = SharedLine(open_board(pty.device), [f"udpout:127.0.0.1:{station.getsockname()[1]}"])
        hello = Packer(1, 200).pack(mavlink.MAVLink_heartbeat_message(0, 8, 0, 0, 0, 3))
        (name,) = line.simulator.peers(0.0)
        line.simulator.send(hello, name, 0.0)
        line.planner.send(Packer(1, 191).pack(arm), name, 0.0)
        heard: dict[str, bytes] = {"simulator": b"", "planner": b""}
        while not (heard["simulator"] and heard["planner"]):
            wait_for_news(line.simulator.handles(), 1.0)
            heard["simulator"] += b"".join(data for _, data in line.simulator.receive(0.0))
            heard["planner"] += b"".join(data for _, data in line.planner.receive(0.0))
        data, here = station.recvfrom(2048)
        assert data[0] == heard["planner"][0] == 0xFD
        station.sendto(Packer(255, 190).pack(arm), here)
        while len(pty.board.others) < 2:
            wait_for_news(line.simulator.handles(), 0.1)
            line.pull(0.0)
        line.planner.close()  # as at the end of a traverse, of which there may be another
        assert line.simulator.peers(0.0)
        line.close()
    station.close()
    assert [message.get_srcComponent() for message in pty.board.others] == [191, 190]


def test_a_speed_that_cannot_carry_the_sensors_is_refused() -> None:
    with pytest.raises(InputError, match=r"speed 57600 is too slow .* allowed: 230400 or more"):
        open_board("/dev/ttyUSB0,57600")


def test_a_missing_device_is_a_link_error() -> None:
    with pytest.raises(LinkError, match="No such file or directory"):
        open_board("/dev/no-such-board")
    assert is_board(LINE)
    assert not is_board("127.0.0.1:4560")


def test_stations_beside_a_board_speak_by_datagrams() -> None:
    with (
        BoardOnPty(Px4Board()) as pty,
        pytest.raises(InputError, match=r"--connect .tcp:127\.0\.0\.1:5760.: allowed beside a board"),
    ):
        SharedLine(open_board(pty.device), ["tcp:127.0.0.1:5760"])
