"""Streams in Rerun's own format, read back by its own program."""

import contextlib
import importlib
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rings.recording.tests.recordings import PROVENANCE
from tactograph.graph import InputError, Session
from tactograph.graph.errors import collect_warnings
from tactograph.rings.live.nodes.view.view_rerun import view_rerun
from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.rings.mechanics.layers.pose import ObjectPose
from tests.nodes.touches import touch_of

rerun_cli = pytest.importorskip("rerun_cli", reason="'make test-all' installs it")
pytestmark = pytest.mark.slow
SIZE = (48, 64)
PROGRAM = next(Path(rerun_cli.__file__).parent.glob("rerun*"))
ENVIRONMENT = {**os.environ, "RERUN_ANALYTICS": "off"}
view_rerun_module = importlib.import_module("tactograph.rings.live.nodes.view.view_rerun")


def view(
    session: Session,
    touches: int = 3,
    markers: MarkerTracks | None = None,
    pose: ObjectPose | None = None,
    **settings: Any,
) -> None:
    for touch in range(touches):
        height = np.zeros(SIZE, np.float32)
        height[20:30, 20 + touch : 40] = 0.7
        pressed = (height > 0).astype(np.uint8)
        shown = touch_of(
            height=height, image=np.full((4, *SIZE), 0.5, np.float32), pixel=0.1,
            name=f"touch-{touch}", time=time.monotonic(), metrics={"rmse": 0.1 * touch},
            shadow=pressed, contact=pressed, error=0.02 * height, confidence=height,
            markers=markers, pose=pose,
        )  # fmt: skip
        view_rerun(shown, provenance=PROVENANCE, session=session, **{"rate_hz": 1e9, **settings})


def rerun_program(*words: object) -> str:
    """What Rerun's own program prints; an error if it finds one."""
    command = [PROGRAM, *map(str, words)]
    done = subprocess.run(
        command, check=True, capture_output=True, text=True, timeout=60, env=ENVIRONMENT
    )
    return done.stdout


def printed(file: Path, touches: int = 3, **settings: Any) -> str:
    """What Rerun's own program reads in the file of a stream."""
    session = Session()
    view(session, touches, viewer="none", file=file, **settings)
    session.close()
    return rerun_program("rrd", "print", "-vvv", file)


@pytest.fixture
def viewer() -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Rerun's program where viewers and streams meet, which needs no screen, and its address."""
    port, web = free_port(), free_port()
    command = [PROGRAM, "--serve-web", "--port", str(port), "--web-viewer-port", str(web)]
    program = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=ENVIRONMENT
    )
    for _ in range(200):
        with contextlib.suppress(OSError):
            socket.create_connection(("127.0.0.1", port), 1).close()
            break
        time.sleep(0.05)
    yield program, f"rerun+http://127.0.0.1:{port}/proxy"
    program.kill()
    program.wait()


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def test_a_stream_without_a_viewer_is_a_file_that_rerun_verifies(tmp_path: Path) -> None:
    file = tmp_path / "deeper" / "live.rrd"
    found = printed(file)
    rerun_program("rrd", "verify", file)
    entities = "film/surface camera/led1 camera/led4 height shadow section error contact"
    entities += " confidence times/height times/latency metrics/rmse touch"
    assert [name for name in entities.split() if f"/{name}" not in found] == []
    assert "Mesh3D:vertex_positions" in found
    assert "SegmentationImage" in found


def test_markers_are_arrows_over_the_first_image(tmp_path: Path) -> None:
    markers, shift = np.full((3, 3), 10, np.float32), np.ones((3, 2), np.float32)
    tracks = MarkerTracks(markers, shift, np.ones(3, np.uint8))
    found = printed(tmp_path / "live.rrd", markers=tracks)
    assert "/camera/led1/markers" in found
    assert "Arrows2D" in found


def test_a_pose_is_a_transform(tmp_path: Path) -> None:
    pose = ObjectPose(np.array([1, 2, 0.1, 0, 0, 30], np.float32), np.eye(6, dtype=np.float32))
    found = printed(tmp_path / "live.rrd", pose=pose)
    # The image's middle is at 3.15, 2.35 mm; y is up.
    for part in ("/film/object", "4.15", "-4.35"):
        assert part in found


def test_touches_beyond_the_rate_are_left_out(tmp_path: Path) -> None:
    for rate, sent in ((1e9, {*range(8)}), (1e-3, {0})):
        found = printed(tmp_path / f"{rate}.rrd", 8, rate_hz=rate)
        assert {n for n in range(8) if f"touch-{n}" in found} == sent


def test_the_file_does_not_grow_beyond_its_limit(tmp_path: Path) -> None:
    session = Session()
    with collect_warnings([]) as notes:
        for _ in range(20):
            view(session, 1, viewer="none", file=tmp_path / "live.rrd", file_gb=1e-7)
            time.sleep(0.02)
    session.close()
    assert len(notes) == 1
    assert "as large as it may be; view_rerun has ended" in notes[0]


def test_a_closed_viewer_costs_one_line_and_the_file_continues(
    tmp_path: Path, viewer: tuple[subprocess.Popen[bytes], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view_rerun_module, "CHECK_EVERY_S", 0.0)
    (program, url), file = viewer, tmp_path / "live.rrd"
    session, notes = Session(), []
    with collect_warnings(notes):
        view(session, viewer="connect", url=url, file=file)
        assert notes == []
        program.kill()
        program.wait()
        before = file.stat().st_size
        view(session, 20, viewer="connect", url=url, file=file)
    session.close()
    assert len(notes) == 1
    assert "is gone; the stream goes on" in notes[0]
    assert file.stat().st_size > before
    rerun_program("rrd", "verify", file)


def test_without_a_screen_the_error_names_the_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(InputError, match=r"no screen for a viewer.*`viewer`=none"):
        view(Session())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"viewer": "none"}, "needs a file"),
        ({"viewer": "none", "file": Path("/dev/null/live.rrd")}, "cannot be written"),
        ({"viewer": "connect", "url": "nonsense"}, "`url`=nonsense"),
        ({"viewer": "connect", "url": "rerun+http://127.0.0.1:9/proxy"}, "no viewer answers at"),
    ],
)
def test_wrong_settings_are_one_line(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        view(Session(), **settings)
    assert "\n" not in str(caught.value)


def test_without_rerun_the_error_names_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match=r"pip install 'tactograph\[rerun\]'"):
        view(Session(), viewer="none", file=tmp_path / "live.rrd")
