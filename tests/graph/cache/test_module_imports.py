"""The imports of a file are found once, by the first process that looks."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tactograph.graph.cache import module_imports as module
from tactograph.graph.cache.module_imports import keep_imports, module_imports
from tactograph.graph.disk.disk_cache import write_cached


@pytest.fixture(autouse=True)
def another_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No test knows what another has found."""
    monkeypatch.setenv("TACTOGRAPH_CACHE", str(tmp_path / "cache"))
    start_again()
    yield
    start_again()


def start_again() -> None:
    module._known.cache_clear()
    module._new.clear()


def test_another_process_knows_what_was_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "felt.py"
    file.write_text("import numpy\nfrom .soft import film\n")
    found = module_imports(file, "touch.felt")
    assert found == ["numpy", "touch.soft", "touch.soft.film"]
    keep_imports()
    start_again()
    monkeypatch.setattr(module, "_imported", lambda *_: pytest.fail("was looked for again"))
    assert module_imports(file, "touch.felt") == found


def test_a_file_that_has_changed_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "felt.py"
    file.write_text("import numpy\n")
    module_imports(file, "felt")
    keep_imports()
    start_again()
    file.write_text("import numpy, scipy\n")
    assert module_imports(file, "felt") == ["numpy", "scipy"]


def test_what_is_kept_of_a_file_goes_with_it(tmp_path: Path) -> None:
    files = [tmp_path / "felt.py", tmp_path / "film.py"]
    for file in files:
        file.write_text("import numpy\n")
        module_imports(file, file.stem)
    files[0].unlink()
    keep_imports()
    start_again()
    assert list(module._known()) == [f"film {files[1]}"]


@pytest.mark.parametrize("body", [b"[]", b"[[1]]", b'{"felt x": [1, 2]}', b'{"felt x": 3}', b"x"])
def test_what_another_version_keeps_differently_is_found_anew(tmp_path: Path, body: bytes) -> None:
    kept = module._kept_in()
    assert kept is not None
    write_cached(kept, body)
    file = tmp_path / "felt.py"
    file.write_text("import numpy\n")
    assert module_imports(file, "felt") == ["numpy"]
