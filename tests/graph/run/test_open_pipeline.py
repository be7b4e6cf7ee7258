"""Opening a graph: its requested outputs, its changes, and where it may run."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tactograph.graph import InputError, load
from tactograph.graph.run.open_pipeline import open_pipeline
from tests.fixtures import python
from tests.graph.conftest import STREAM, WAITING, Write, graph_of

pytestmark = pytest.mark.usefixtures("toys")


@pytest.fixture
def unread(tmp_path: Path) -> str:
    """A calibration file that exists; it is read with the first array."""
    file = tmp_path / "cal.npz"
    file.touch()
    return str(file)


def test_sinks_are_left_out_of_a_loaded_pipeline(toys: list[str]) -> None:
    load(graph_of(WAITING), backend="numpy")(frames=np.ones((3, 4, 5), np.float32))
    assert not [word for word in toys if word.startswith("noted")]


def test_nodes_that_only_unrequested_outputs_need_are_not_run(unread: str) -> None:
    pipeline = load("reconstruct", backend="numpy", calibration=unread, outputs=["slope"])
    assert "slope" in pipeline.plan.tasks
    assert not {"raw", "height", "score"} & set(pipeline.plan.tasks)
    with pytest.raises(InputError, match=r"has no output 'hight'; did you mean 'height'\?"):
        load("reconstruct", backend="numpy", calibration=unread, outputs=["hight"])


def test_a_fallback_is_in_the_plan(no_device: None) -> None:
    pipeline = open_pipeline(graph_of(STREAM), {})
    assert pipeline.plan.fallbacks == [
        "light runs on numpy: opencl is preferred, but no OpenCL device works"
    ]
    assert [result["score"]["mean"] for result in pipeline.items()] == [1, 2, 3]


def test_a_loaded_pipeline_warns_of_a_fallback_and_does_not_list_many(
    no_device: None, unread: str
) -> None:
    with pytest.warns(UserWarning, match="^fallback: light runs on numpy: opencl is preferred"):
        load(graph_of(WAITING))
    with pytest.warns(
        UserWarning, match="^fallback: every node runs on numpy: opencl is"
    ) as caught:
        load("reconstruct", calibration=unread)
    assert len(caught) == 1


@pytest.mark.parametrize("outputs", ["height", [], [1]])
def test_outputs_are_a_list_of_names(outputs: Any, unread: str) -> None:
    with pytest.raises(InputError, match="outputs"):
        load("reconstruct", backend="numpy", calibration=unread, outputs=outputs)


def test_strict_accepts_a_graph_without_a_fallback() -> None:
    load(graph_of(WAITING), strict=True)
    load(graph_of(WAITING), strict=True, backend="numpy")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"strict": True}, "--strict: light runs on numpy: opencl is preferred"),
        ({"backend": "opencl"}, "--backend opencl: no OpenCL device works"),
        ({"backend": "cuda"}, "no back end is called 'cuda'"),
    ],
)
def test_a_demand_that_cannot_be_met_is_refused(
    no_device: None, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        load(graph_of(WAITING), **options)


def test_numpy_looks_for_no_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tactograph.graph.backends.opencl.choose_device", None)
    assert load(graph_of(WAITING), backend="numpy").plan.device is None


def test_changes_change_parameters_of_nodes() -> None:
    pipeline = load(graph_of(WAITING), backend="numpy", changes={"cal.level": 0.5})
    assert float(pipeline(frames=np.ones((3, 4, 5), np.float32))["light"].max()) == 2


@pytest.mark.parametrize(
    ("target", "value", "message"),
    [
        ("call.level", 1, "--set: call.level: set: there is no node 'call'; did you mean 'cal'?"),
        ("cal", 1, "--set cal: write it as node.param=value"),
        ("cal.", 1, "--set cal.: write it as node.param=value"),
        ("cal.levle", 1, "--set: cal.levle: node 'at_rest' has no parameter 'levle'; did you"),
        ("cal.level", "x", "--set: cal.level: a number is needed"),
    ],
)
def test_a_wrong_change_is_reported_with_the_change(target: str, value: Any, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load(graph_of(WAITING), backend="numpy", changes={target: value})
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    "word", ["params", "changes", "device", "outputs", "cache", "nodes", "graph", "key of changes"]
)
def test_a_value_of_another_type_is_refused_by_name(word: str) -> None:
    graph, params, options = graph_of(WAITING), None, {word: 3}
    if word == "graph":
        graph, options = 3, {}
    elif word == "params":
        params, options = 3, {}
    elif word == "key of changes":
        options = {"changes": {3: 4}}
    with pytest.raises(InputError, match=r"^\w*=?3: .*needed|--set 3: write it"):
        load(graph, params, backend="numpy", **options)


def test_a_param_of_a_source_whose_images_are_handed_in_is_refused(unread: str) -> None:
    with pytest.raises(InputError, match=r"only take\.frames reads crop="):
        load("reconstruct", backend="numpy", calibration=unread, crop=[0, 0, 9, 9])


OWN_NAMES = """
format: 1
params:
  name: {kind: number}
  device: {kind: number}
  outputs: {kind: number, default: 1}
  self: {kind: number, default: 1}
nodes:
  one: {op: choosy, with: {side: left, level: $name}}
  two: {op: choosy, with: {side: left, level: $device}}
outputs: {one: one, two: two}
"""


def test_a_graph_may_be_named_by_a_path(write: Write) -> None:
    pipeline = load(Path(write(WAITING)), backend="numpy")
    assert pipeline(frames=np.ones((3, 4, 5), np.float32))["light"].max() == 1


def test_params_of_any_name_can_be_set() -> None:
    pipeline = load(graph_of(OWN_NAMES), {"device": 3, "outputs": 1, "self": 1}, name=2)
    with pipeline:
        (result,) = pipeline.items()
    assert (result["one"].max(), result["two"].max()) == (2, 3)
    with pytest.raises(InputError, match="name is given twice"):
        load(graph_of(OWN_NAMES), {"device": 3, "name": 1}, name=2)


@pytest.mark.parametrize("make", [np.float32, np.float64, np.int64, np.array])
def test_numbers_of_numpy_are_numbers(make: Any) -> None:
    graph = graph_of(OWN_NAMES)
    pipeline = load(graph, {"device": 1}, name=make(2), changes={"two.level": make(4)})
    (result,) = pipeline.items()
    assert (result["one"].max(), result["two"].max()) == (2, 4)
    changed = load(graph, {"device": 1}, name=2, changes={"two.level": make(4).item()})
    assert pipeline.plan.graph.hash == changed.plan.graph.hash


def test_libraries_for_writing_and_for_fallbacks_are_not_imported_when_a_graph_opens() -> None:
    """Matplotlib, trimesh, SciPy's transforms and trees take longer to load than a touch to
    compute."""
    script = (
        "import sys;"
        "from tactograph.graph.files.read_graph import read_graph;"
        "from tactograph.graph.run.open_pipeline import open_pipeline;"
        "graph = read_graph('reconstruct');"
        "open_pipeline(graph, graph.placeholders);"
        "print(sorted({'matplotlib', 'trimesh', 'scipy.fft', 'scipy.spatial'} & set(sys.modules)))"
    )
    assert python("-c", script).stdout == "[]\n"
