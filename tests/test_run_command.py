"""The run command as a user meets it: files, exit codes, messages, interruption."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rover_sim.cli import COMMANDS, build_parser, main
from rover_sim.mavlink.geodesy import DEGREES_E7, GeoPoint, LocalFrame
from rover_sim.mavlink.mission_file import read_plan, read_waypoints
from rover_sim.mavlink.tlog import read_tlog
from rover_sim.run_folder import FILES
from worlds.scenario import Origin, load_scenario

SHORT = """
name = "short"
[terrain]
kind = "flat"
size_m = [12.0, 10.0]
resolution_m = 0.1
[rocks]
cfa = 0.02
min_diameter_m = 0.1
max_diameter_m = 0.4
clear_radius_m = 1.0
[soil]
preset = "firm"
[goal]
position_m = [3.0, 0.5]
time_limit_s = 60.0
"""


def _scenario(folder: Path, text: str = SHORT) -> str:
    path = folder / "short.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def _program(*arguments: str) -> list[str]:
    return [sys.executable, "-c", "from rover_sim.cli import main; raise SystemExit(main())", *arguments]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of one finished short run."""
    folder = tmp_path_factory.mktemp("run")
    assert main(["run", _scenario(folder), "--seed", "3", "--out", str(folder / "out"), "--record-video"]) == 0
    return folder / "out"


def test_a_run_leaves_every_file_of_the_contract(finished: Path) -> None:
    assert set(FILES) <= {path.name for path in finished.iterdir()}
    assert all((finished / name).stat().st_size > 0 for name in FILES)
    assert not [path for path in finished.iterdir() if path.name.startswith(".")]  # no temporary file is left


def test_the_summary_tells_what_the_trace_shows(finished: Path) -> None:
    summary = json.loads((finished / "summary.json").read_text())
    trace = np.load(finished / "trace.npz")
    assert summary["success"] is True
    assert summary["reason"] == "goal"
    assert summary["goal_distance_m"] <= 0.5
    assert summary["distance_m"] == pytest.approx(
        np.linalg.norm(np.diff(trace["position_w"], axis=0), axis=1).sum(), abs=1e-3
    )
    assert summary["frames"] == np.ceil(summary["sim_time_s"] * 2.0)
    assert np.isfinite(trace["position_w"]).all()
    assert np.abs(trace["estimate_position_w"] - trace["position_w"]).max() < 0.3


def test_both_mission_files_hold_the_mission_that_ends_at_the_goal(finished: Path) -> None:
    items, plan = read_waypoints(finished / "mission.waypoints"), read_plan(finished / "mission.plan")
    assert [item.command for item in items] == [item.command for item in plan]
    place = LocalFrame(Origin()).to_world(GeoPoint(items[-1].x / DEGREES_E7, items[-1].y / DEGREES_E7, 1380.0))
    assert np.hypot(place[0] - 3.0, place[1] - 0.5) < 0.5


def test_the_log_holds_the_mission_upload(finished: Path) -> None:
    frames = [frame for _, frame in read_tlog(finished / "telemetry.tlog")]
    message_ids = {int.from_bytes(frame[7:10], "little") for frame in frames}
    count, item_int, ack, heartbeat, position = 44, 73, 47, 0, 33
    assert {count, item_int, ack, heartbeat, position} <= message_ids


def test_the_saved_scenario_repeats_the_run_to_the_byte_in_another_process(finished: Path, tmp_path: Path) -> None:
    command = _program("run", str(finished / "scenario.toml"), "--seed", "3", "--out", str(tmp_path / "again"))
    subprocess.run(command, check=True, capture_output=True, timeout=100)
    for name in ("trace.npz", "mission.waypoints", "telemetry.tlog"):
        assert (tmp_path / "again" / name).read_bytes() == (finished / name).read_bytes(), name
    assert load_scenario(str(tmp_path / "again" / "scenario.toml")) == load_scenario(str(finished / "scenario.toml"))


def test_an_interrupted_run_leaves_a_complete_folder(tmp_path: Path) -> None:
    slow = SHORT.replace("position_m = [3.0, 0.5]", "position_m = [9.0, 0.5]").replace("12.0, 10.0", "24.0, 10.0")
    out = tmp_path / "out"
    command = _program("run", _scenario(tmp_path, slow), "--out", str(out), "--realtime")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        # The log appears when the drive is about to begin; nothing else tells from outside.
        while process.poll() is None and not ((out / "telemetry.tlog").exists() and _size(out / "telemetry.tlog")):
            try:
                process.wait(timeout=0.05)
            except subprocess.TimeoutExpired:
                continue
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    summary = json.loads((out / "summary.json").read_text())
    assert process.returncode == 1, error.decode()
    assert summary["reason"] == "aborted"
    assert summary["success"] is False
    assert set(FILES) <= {path.name for path in out.iterdir()}


def _size(path: Path) -> int:
    return path.stat().st_size


BAD = {
    "missing file": (["run", "nowhere.toml"], "nowhere.toml"),
    "unknown command": (["fly"], "fly"),
    "bad seed": (["run", "--seed", "-1"], "-1"),
    "bad url": (["run", "--connect", "carrier-pigeon:1"], "carrier-pigeon"),
    "unknown option": (["run", "--speed", "9"], "--speed"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_wrong_input_is_one_line_and_exit_code_two(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, named = BAD[case]
    try:
        code = main(arguments)
    except SystemExit as exit_:
        code = int(exit_.code or 0)
    error = capsys.readouterr().err.strip().splitlines()
    assert code == 2
    assert named in error[-1]
    assert "Traceback" not in "\n".join(error)


BAD_SCENARIOS = {
    "mistyped key": (SHORT.replace("cfa = 0.02", "cfaa = 0.02"), "cfaa"),
    "goal off the map": (SHORT.replace("[3.0, 0.5]", "[3000.0, 0.5]"), "goal"),
    "goal in a rock": (
        SHORT + '[[obstacle]]\nkind = "cylinder"\nposition_m = [3.0, 0.5]\nradius_m = 0.3\nheight_m = 1.0\n',
        "goal",
    ),
    "rate out of range": (SHORT + "[camera]\nrate_hz = 0.0\n", "rate_hz"),
    "unknown soil": (SHORT.replace('"firm"', '"jelly"'), "jelly"),
    "unknown rover": (SHORT + '[rover]\nmodel = "hovercraft"\n', "hovercraft"),
    "broken TOML": ("name = \n", "short.toml"),
}


@pytest.mark.parametrize("case", BAD_SCENARIOS)
def test_a_wrong_scenario_is_one_line_that_names_it(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text, named = BAD_SCENARIOS[case]
    assert main(["run", _scenario(tmp_path, text)]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert named in error[-1]
    assert "Traceback" not in "\n".join(error)
    assert not (tmp_path / "runs").exists()  # a run that cannot begin leaves nothing behind


def test_a_port_in_use_is_one_line_and_costs_no_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = tmp_path / "out" / "summary.json"
    before.parent.mkdir()
    before.write_text("of an earlier run", encoding="utf-8")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        url = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        assert main(["run", _scenario(tmp_path), "--out", str(tmp_path / "out"), "--connect", url]) == 3
    assert url in capsys.readouterr().err.strip().splitlines()[-1]
    assert before.read_text(encoding="utf-8") == "of an earlier run"


def test_an_out_folder_that_cannot_be_made_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("in the way")
    assert main(["run", _scenario(tmp_path), "--out", str(tmp_path / "file" / "out")]) == 2
    assert "--out" in capsys.readouterr().err.strip().splitlines()[-1]


def test_an_enclosed_goal_ends_with_a_reason(tmp_path: Path) -> None:
    ring = "".join(
        f'[[obstacle]]\nkind = "cylinder"\nposition_m = [{3 + 1.2 * np.cos(a):.3f}, {0.5 + 1.2 * np.sin(a):.3f}]\n'
        "radius_m = 0.3\nheight_m = 0.6\n"
        for a in np.linspace(0, 2 * np.pi, 14, endpoint=False)
    )
    out = tmp_path / "out"
    # Room to look for a way round without leaving the map.
    text = SHORT.replace("[12.0, 10.0]", "[40.0, 40.0]").replace("60.0", "150.0") + ring
    assert main(["run", _scenario(tmp_path, text), "--out", str(out)]) == 1
    summary = json.loads((out / "summary.json").read_text())
    assert summary["success"] is False
    # Touching the ring while looking for a gap is a planner's fault, but an honest end.
    assert summary["reason"] in {"no_path", "timeout", "collision"}


def test_the_help_imports_nothing_heavy() -> None:
    script = (
        "import sys; from rover_sim.cli import build_parser; build_parser(None).format_help();"
        "print([n for n in ('numpy', 'numba', 'cv2', 'matplotlib', 'pybullet', 'rich', 'msgspec') if n in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=20)
    assert result.stdout.strip() == "[]"


def test_every_command_has_its_own_help(capsys: pytest.CaptureFixture[str]) -> None:
    for name in COMMANDS:
        with pytest.raises(SystemExit) as ended:
            build_parser(name).parse_args([name, "--help"])
        assert ended.value.code == 0
        assert name in capsys.readouterr().out


def test_a_reader_that_goes_away_is_no_error(tmp_path: Path) -> None:
    if os.name == "nt":
        pytest.skip("pipes close differently on Windows")
    script = f"{sys.executable} -c 'from rover_sim.cli import main; raise SystemExit(main())' --help | head -1"
    shell = ["bash", "-c", script]
    result = subprocess.run(shell, capture_output=True, text=True, check=True, cwd=tmp_path, timeout=20)
    assert "usage" in result.stdout
    assert result.stderr == ""
