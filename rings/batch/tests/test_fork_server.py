"""A batch's processes: safe in any folder, deaf to Ctrl-C, and gone with the one they work for."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tactograph.rings.batch.fork_server import ctrl_c_later

Start = Callable[..., "subprocess.Popen[str]"]

TWO_AT_WORK = """
import time
from tactograph.rings.batch.fork_server import start_processes
processes = start_processes(2)
for each in [processes.submit(time.sleep, 600) for _ in range(2)]:
    each.result()
"""
ONE_CHUNK = """
import time
from rings.batch.tests.stores import TAKING, job_of
from tests.graph.conftest import graph_of
from tactograph.rings.batch.processes import Processes
list(Processes(job_of(graph_of(TAKING)), 1, time.sleep).run([600]))
"""
CTRL_C_WHILE_IT_IMPORTS = """
import signal
from tactograph.rings.batch.fork_server import start_importing, start_processes
signal.signal(signal.SIGINT, lambda *_: None)
start_importing()
input()
print(start_processes(1).submit(int).result())
"""
FROM_HERE = """
import sys
sys.path.remove("")
from tactograph.rings.batch.fork_server import start_processes
print(start_processes(1).submit(int).result())
"""
ASKED_FOR_DEVICES = """
import os
os.environ.pop("PYOPENCL_HOME", None)  # of the tests' own process
from tactograph.rings.batch.fork_server import start_processes
ask = "import tactograph.graph.backends.devices as devices; devices.find_devices()"
start_processes(1).submit(exec, ask).result()
print("asked")
"""


@pytest.fixture
def start() -> Iterator[Start]:
    """Run a script in a session of its own, of which nothing is left in the end."""
    started: list[subprocess.Popen[str]] = []

    def run(script: str, folder: Path | None = None) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        command = [sys.executable, "-c", script]
        started.append(
            subprocess.Popen(
                command, cwd=folder, stdin=pipe, stdout=pipe, stderr=pipe, text=True,
                start_new_session=True,
            )
        )  # fmt: skip
        return started[-1]

    yield run
    for process in started:
        for pid in session(process.pid):
            os.kill(pid, signal.SIGKILL)
        process.communicate()


def session(leader: int) -> list[int]:
    """The processes of a session that are not dead."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            state, _, _, of = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
        except (OSError, ValueError):
            continue
        if int(of) == leader and state != "Z":
            found.append(int(folder.name))
    return found


def is_importing_server(pid: int) -> bool:
    folder = Path(f"/proc/{pid}")
    try:
        is_server = "multiprocessing.forkserver" in (folder / "cmdline").read_text()
        return is_server and "/numpy/" in (folder / "maps").read_text()
    except OSError:
        return False


def wait_for(is_so: Callable[[], bool]) -> bool:
    """Wait for something that comes soon, or never."""
    until = time.monotonic() + 60
    while not is_so() and time.monotonic() < until:
        time.sleep(0.02)
    return is_so()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_processes_end_with_the_one_that_started_them(start: Start, number: int) -> None:
    main = start(TWO_AT_WORK)
    # Beside it and them, the server and the one that looks after semaphores.
    assert wait_for(lambda: len(session(main.pid)) == 5)
    main.send_signal(number)
    assert wait_for(lambda: not session(main.pid))


@pytest.mark.slow
def test_ctrl_c_ends_running_work(start: Start) -> None:
    main = start(ONE_CHUNK)
    assert wait_for(lambda: len(session(main.pid)) == 4)
    main.send_signal(signal.SIGINT)
    assert wait_for(lambda: not session(main.pid))
    assert main.communicate()[1].endswith("KeyboardInterrupt\n")


def test_ctrl_c_while_the_server_imports_is_not_the_server_s(start: Start) -> None:
    main = start(CTRL_C_WHILE_IT_IMPORTS)
    assert wait_for(lambda: any(map(is_importing_server, session(main.pid))))
    os.killpg(main.pid, signal.SIGINT)
    assert main.communicate("\n") == ("0\n", "")


@pytest.mark.parametrize("module", ["numpy", "random", "threading"])
def test_no_import_is_from_the_working_folder(start: Start, tmp_path: Path, module: str) -> None:
    (tmp_path / f"{module}.py").write_text("open('ran', 'w')\n")
    assert start(FROM_HERE, tmp_path).communicate() == ("0\n", "")
    assert not (tmp_path / "ran").exists()


def test_a_process_asks_for_devices_that_its_parent_never_asked_for(start: Start) -> None:
    assert start(ASKED_FOR_DEVICES).communicate() == ("asked\n", "")


def test_ctrl_c_waits_for_the_end_of_a_block() -> None:
    reached = []
    with pytest.raises(KeyboardInterrupt), ctrl_c_later():  # noqa: PT012
        signal.raise_signal(signal.SIGINT)
        reached.append("the end")
    assert reached
