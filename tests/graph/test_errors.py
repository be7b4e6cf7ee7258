"""A path that does not exist is named with its closest neighbour."""

from pathlib import Path

import pytest

from tactograph.graph.errors import missing


@pytest.mark.parametrize(
    ("path", "end"),
    [
        ("captures/tuch", "captures/tuch: there is no such folder; did you mean 'touch'?"),
        ("capturs/touch", "there is no such folder, nor '{0}/capturs'; did you mean 'captures'?"),
        ("captures/ball", "captures/ball: there is no such folder"),
    ],
)
def test_a_missing_path_names_the_closest_name(tmp_path: Path, path: str, end: str) -> None:
    (tmp_path / "captures" / "touch").mkdir(parents=True)
    assert missing(tmp_path / path, "folder").endswith(end.format(tmp_path))


@pytest.mark.parametrize("to", ["gone", "touch"])
def test_a_link_to_nothing_is_not_its_own_neighbour(tmp_path: Path, to: str) -> None:
    link = tmp_path / "touch"
    link.symlink_to(to)
    said = missing(link, "folder")
    assert said == f"{link}: there is no such folder; '{link}' is a link to '{to}'"


def test_a_folder_that_cannot_be_listed_gives_no_advice(tmp_path: Path) -> None:
    assert missing(tmp_path / "a\0b", "file").endswith("there is no such file")
