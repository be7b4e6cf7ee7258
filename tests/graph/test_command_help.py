"""Help of the command line: on graphs, on near misses, and by completion in a shell."""

import json
from pathlib import Path

import pytest

from tactograph.graph.files.read_graph import shipped_names
from tests.fixtures import python
from tests.graph.conftest import STREAM, Command

COMMAND = """
import sys
from tactograph.graph.command import main
sys.argv = ["tactograph"]
main()
"""
ANSWERS = """
import json, os, sys
from tactograph.graph.command import main
asked = json.loads(sys.argv[1])
sys.argv = ["tactograph"]
for variables in asked:
    os.environ.update(variables)
    try:
        main()
    except SystemExit:
        print(end="\\0", flush=True)
"""


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        (("grpahs",), "did you mean 'graphs'?"),
        (("comapre",), "did you mean 'compare'?"),
        (("paper",), "'tactograph run paper'"),
        (("mine.yaml",), "'tactograph run mine.yaml'"),
        (("run", "paper", "--quite"), "--quiet"),
        (("run", "calibrat", "--help"), "did you mean 'calibrate'"),
    ],
)
def test_a_near_miss_is_answered_with_a_suggestion(
    tactograph: Command, typed: tuple[str, ...], message: str
) -> None:
    done = tactograph(*typed)
    assert done.code == 2
    assert message in done.err


@pytest.mark.parametrize("command", ["run", "explain", "bench"])
def test_help_after_a_graph_lists_its_params(about: Command, command: str) -> None:
    text = STREAM.replace("default: 3}", "default: 3, help: so many touches}")
    text = text.replace("params:", "params:\n  place: {kind: path, help: a folder}")
    words = " ".join(about(command, text, "--help").out.split())
    assert "place=PATH needed; a folder count=INTEGER default 3; so many touches" in words


def test_help_without_a_graph_lists_options_alone(tactograph: Command) -> None:
    done = tactograph("run", "--device", "x", "--help")
    assert done.code == 0
    assert "Params of" not in done.out


def completed(shell: str, *asked: tuple[str, int]) -> list[list[str]]:
    """The completions for words after the command's name, and the number of the last word.

    One process answers all, as starting it takes longer than an answer.
    """
    variables = [
        {
            "COMP_WORDS": f"tactograph {words}",
            "COMP_CWORD": words.rpartition(" ")[2] if shell == "fish" else str(number),
        }
        for words, number in asked
    ]
    done = python("-c", ANSWERS, json.dumps(variables), _TACTOGRAPH_COMPLETE=f"{shell}_complete")
    return [answer.split() for answer in done.stdout.split("\0")[:-1]]


OFFERED = {
    ("grap", 1): {"plain,graphs"},
    ("run paper_no_f", 2): {"plain,paper_no_flat"},
    ("run paper cal", 3): {"plain,calibration="},
    ("run paper capture = x cal", 6): {"plain,calibration="},
    ("run paper capture = x", 5): {"file,x"},
    ("run paper another_sensor = fa", 5): {"plain,false"},
    ("run nowhere x", 3): set(),
    ("compare paper paper_no_f", 3): {"plain,paper_no_flat"},
    ("compare precise_abl", 2): {"plain,precise_ablation"},
    ("check precise_abl", 2): {"plain,precise_ablation"},
    ("run precise_abl", 2): {"file,precise_abl"},
    ("run paper --with drawn_t", 4): {"plain,drawn_touches"},
    ("run reconstruct --with no_", 4): {"plain,no_flat"},
    ("run see_touch --with follow_", 4): {"file,follow_"},
    ("run paper --with drawn_touches cou", 5): {"plain,count="},
}


def test_bash_completes_graphs_params_values() -> None:
    found = completed("bash", *OFFERED)
    assert dict(zip(OFFERED, map(set, found), strict=True)) == OFFERED


def test_a_shell_that_does_not_split_a_word_completes_the_value_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "touches").mkdir()
    monkeypatch.chdir(tmp_path)
    assert completed("fish", ("run paper capture=tou", 3)) == [["plain,capture=touches/"]]


def test_every_graph_is_offered() -> None:
    (offered,) = completed("bash", ("run ", 2))
    assert offered == [f"plain,{name}" for name in shipped_names()]


def test_no_space_follows_a_name_whose_value_is_still_to_come() -> None:
    script = python("-c", COMMAND, _TACTOGRAPH_COMPLETE="bash_source").stdout
    assert "compopt -o nospace" in script
