"""What rings/live/docs/hardware.md shows is what the firmware does."""

import re
import subprocess
import time
from pathlib import Path

from rings.live.tests.faulty import FaultyController
from tactograph.rings.live.firmware.protocol import unframe
from tactograph.rings.live.nodes.controller._led_line import parse

TEXT = (Path(__file__).parents[2] / "docs" / "hardware.md").read_text()


def test_every_line_shown_is_a_right_one_and_every_answer_can_be_parsed() -> None:
    lines = re.findall(r"(< )?(\$[^*\n$]+\*[0-9A-F]{4})", TEXT)
    assert len(lines) > 8
    for answer, line in lines:
        body = unframe(line.encode())
        assert body is not None, line
        assert not answer or parse(body) is not None, line


def test_the_command_that_ends_the_firmware_does() -> None:
    (command,) = re.findall(r"^stty .*$", TEXT, re.MULTILINE)
    with FaultyController() as board:
        subprocess.run(["sh", "-c", command.replace("/dev/ttyACM0", board.port)], check=True)
        end = time.monotonic() + 5
        while not board.asked_to_quit:
            assert time.monotonic() < end
            time.sleep(0.01)
