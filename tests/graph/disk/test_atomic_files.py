"""Files appear complete or not at all."""

import errno
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from tactograph.graph import InputError
from tactograph.graph.disk.atomic_files import atomic_file, atomic_files
from tactograph.graph.errors import WriteError


def test_files_appear_when_the_block_is_done(tmp_path: Path) -> None:
    with atomic_files(tmp_path / "new" / "folder") as stage:
        (stage / "a.txt").write_text("a")
        (stage / "b.txt").write_text("b")
        assert not (tmp_path / "new" / "folder" / "a.txt").exists()
    assert sorted(f.name for f in (tmp_path / "new" / "folder").iterdir()) == ["a.txt", "b.txt"]


def test_a_single_file_keeps_its_suffix_while_it_is_written(tmp_path: Path) -> None:
    with atomic_file(tmp_path / "cal.npz") as target:
        assert target.suffix == ".npz"
        target.write_text("x")
    assert (tmp_path / "cal.npz").read_text() == "x"


def write_and_fail(folder: Path, error: BaseException) -> None:
    with atomic_files(folder) as stage:
        (stage / "a.txt").write_text("half")
        raise error


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (RuntimeError("no"), RuntimeError),
        (KeyboardInterrupt(), KeyboardInterrupt),
        (InputError("no"), InputError),
        (OSError(errno.ENOSPC, "No space left on device"), InputError),
    ],
)
def test_if_the_block_raises_nothing_appears_and_existing_files_stay(
    tmp_path: Path, error: BaseException, raised: type[BaseException]
) -> None:
    with pytest.raises(raised, match=r"^no$|^$|cannot be written: No space left"):
        write_and_fail(tmp_path, error)
    assert list(tmp_path.iterdir()) == []
    file = tmp_path / "a.txt"
    file.write_text("old")
    with pytest.raises(raised):
        write_and_fail(tmp_path, error)
    assert list(tmp_path.iterdir()) == [file]
    assert file.read_text() == "old"


def test_an_existing_file_is_replaced_and_its_neighbours_stay(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "other.txt").write_text("mine")
    with atomic_file(tmp_path / "a.txt") as target:
        target.write_text("new")
    assert (tmp_path / "a.txt").read_text() == "new"
    assert (tmp_path / "other.txt").read_text() == "mine"


class Killed(BaseException):
    """Stands for a kill: nothing runs after it."""


def write_anew(folder: Path) -> None:
    with atomic_files(folder, last="b", instead_of=["gone"]) as stage:
        for name in ("a", "b", "z"):
            (stage / name).write_text("new")


def killed_while_moving(folder: Path, monkeypatch: pytest.MonkeyPatch, moved: int) -> None:
    """Write a, b and z, with b as the last; the process dies after ``moved`` moves."""
    replace, remaining = Path.replace, [moved]

    def dying(file: Path, target: Path) -> Path:
        remaining[0] -= 1
        if remaining[0] < 0:
            raise Killed
        return replace(file, target)

    with monkeypatch.context() as during:
        during.setattr(Path, "replace", dying)
        during.setattr(shutil, "rmtree", lambda path, **_: None)
        with pytest.raises(Killed):
            write_anew(folder)


@pytest.mark.parametrize("moved", range(3))
def test_the_last_file_is_new_only_if_all_others_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moved: int
) -> None:
    for name in ("a", "b", "z", "gone"):
        (tmp_path / name).write_text("old")
    killed_while_moving(tmp_path, monkeypatch, moved)
    assert (tmp_path / "b").read_text() == "old"
    with atomic_files(tmp_path, last="b", instead_of=["gone", "a"]) as stage:
        (stage / "a").write_text("newer")
        (stage / "b").write_text("newer")
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {
        "a": "newer",
        "b": "newer",
        "z": "new" if moved == 2 else "old",
    }


def test_the_next_write_deletes_the_leftovers_of_a_killed_writer(tmp_path: Path) -> None:
    lines = (
        "import os, sys",
        "from pathlib import Path",
        "from tactograph.graph.disk.atomic_files import atomic_files",
        "with atomic_files(Path(sys.argv[1])) as stage:",
        "    (stage / 'half.npy').write_text('half')",
        "    os._exit(9)",
    )
    subprocess.run([sys.executable, "-c", "\n".join(lines), str(tmp_path)], check=False)
    assert len([*tmp_path.glob(".writing-*")]) == 1
    with atomic_file(tmp_path / "a.txt") as target:
        target.write_text("a")
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_the_files_of_another_running_writer_stay(tmp_path: Path) -> None:
    with atomic_files(tmp_path) as one, atomic_files(tmp_path) as other:
        (one / "a.txt").write_text("a")
        (other / "b.txt").write_text("b")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.txt", "b.txt"]


def test_a_disk_that_is_read_only_is_an_input_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**keywords: object) -> str:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(tempfile, "mkdtemp", refuse)
    with (
        pytest.raises(InputError, match="cannot be written: Read-only file system"),
        atomic_files(tmp_path),
    ):
        pytest.fail("the block must not run")


A_FILE = "a folder is needed, but a file has that name; give another place"


@pytest.mark.parametrize(
    ("below", "why"), [("file.txt", A_FILE), ("file.txt/deeper", A_FILE), ("n" * 300, "too long")]
)
def test_an_impossible_folder_is_an_input_error(tmp_path: Path, below: str, why: str) -> None:
    (tmp_path / "file.txt").write_text("a file, not a folder")
    with pytest.raises(InputError, match=f"written: .*{why}"), atomic_files(tmp_path / below):
        pytest.fail("the block must not run")


def write_two(folder: Path) -> None:
    with atomic_files(folder) as stage:
        (stage / "a.txt").write_text("a")
        (stage / "z.txt").write_text("z")


def test_if_one_file_cannot_be_placed_none_is_placed(tmp_path: Path) -> None:
    (tmp_path / "z.txt").mkdir()
    with pytest.raises(InputError, match=r"z\.txt is a folder"):
        write_two(tmp_path)
    assert [f.name for f in tmp_path.iterdir()] == ["z.txt"]


def test_a_file_does_not_replace_a_device_or_a_pipe(tmp_path: Path) -> None:
    """Root could replace /dev/null."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="pipe is a device or a pipe"), atomic_file(pipe):
        pytest.fail("the block must not run")
    with (
        pytest.raises(InputError, match="pipe is a device or a pipe; give another place"),
        atomic_files(tmp_path) as stage,
    ):
        (stage / "pipe").write_text("x")
    assert pipe.is_fifo()
    assert [*tmp_path.iterdir()] == [pipe]


def test_a_name_that_is_not_text_is_refused(tmp_path: Path) -> None:
    """OpenCV ends the process at such a name."""
    name = tmp_path / os.fsdecode(b"bad\xff")
    for writing in (atomic_files(name), atomic_file(name), atomic_file(name / "x")):
        with pytest.raises(InputError, match=r"bad.udcff.*: the name is not UTF-8; rename it"):
            writing.__enter__()
    assert not [*tmp_path.iterdir()]


def test_a_read_error_is_not_reported_as_a_write_error(tmp_path: Path) -> None:
    missing = tmp_path / "elsewhere" / "read.txt"
    with (
        pytest.raises(InputError, match=r"read\.txt: No such file"),
        atomic_files(tmp_path / "out"),
    ):
        missing.read_text()


def test_a_partly_written_array_is_reported_as_a_full_disk(tmp_path: Path) -> None:
    """NumPy says so without an errno."""
    with (
        pytest.raises(WriteError, match=r"out: cannot be written: No space .* disk of /.*; make"),
        atomic_files(tmp_path / "out"),
    ):
        raise OSError("76800 requested and 51168 written")
    assert not (tmp_path / "out").exists()


def test_a_full_disk_names_the_file_and_leaves_no_folder(tmp_path: Path) -> None:
    with (
        pytest.raises(WriteError, match=r"new/deep/cal\.npz: cannot be written: No space left"),
        atomic_file(tmp_path / "new" / "deep" / "cal.npz"),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert [*tmp_path.iterdir()] == []
