"""Running: streams, stand-ins, buffers, failures, and nothing done behind the user's back."""

import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from tactograph.graph import InputError, NodeError, load
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.prepared_node import Prepared
from tactograph.graph.errors import DeviceError
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.pipeline import Pipeline
from tactograph.graph.run.source_stream import SourceStream
from tactograph.graph.run.step_runner import StepRunner
from tests.graph.conftest import SLOPES, STREAM, WAITING, added, graph_of, lit_by

pytestmark = pytest.mark.usefixtures("toys")


def opened(text: str, backend: str | None = "numpy", /, **given: Any) -> Pipeline:
    return open_pipeline(graph_of(text), given, backend=backend)


def test_a_source_may_yield_many_touches(backend: str) -> None:
    results = list(opened(STREAM, backend).items())
    assert [result["score"]["mean"] for result in results] == [1, 2, 3]
    assert [float(result["light"].mean()) for result in results] == [1, 2, 3]


def test_a_graph_is_rehearsed_before_a_camera_opens_and_nobody_sees_it(
    toys: list[str], backend: str
) -> None:
    text = STREAM.replace("op: touches, with: {count: $count}", "op: endless_touches")
    pipeline = opened(text, backend)
    with pytest.raises(KeyboardInterrupt):
        list(pipeline.items())
    found = [call for call in toys if call != "at_rest"]
    assert found == ["rehearsal", "noted 1", "noted 2", "noted 3", "camera closed"]


def test_nothing_is_being_done_while_a_source_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    text = STREAM.replace("op: touches, with: {count: $count}", "op: endless_touches")
    pipeline = opened(text, "opencl")
    stages: list[str] = []
    monkeypatch.setattr(SourceStream, "next", lambda stream: stages.append(pipeline.stage))
    assert list(pipeline.items()) == []
    assert stages == [""]


def test_a_step_off_the_stream_counts_where_it_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    still = "  still: {op: untouched_film, in: {flat: cal.flat}}"
    pipeline = opened(added(still, "still: still.height"))
    stages: list[str] = []
    call = StepRunner._call
    monkeypatch.setattr(StepRunner, "_call", lambda *of: stages.append(pipeline.stage) or call(*of))
    next(pipeline.items())
    assert stages[:3] == [
        "cal (at_rest), 1 of 2",
        "still (untouched_film), 2 of 2",
        "light (flat_field)",
    ]


def test_load_tells_of_a_calibration_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"calibration=.*none\.npz: there is no such file"):
        load("reconstruct", calibration=tmp_path / "none.npz")


def test_a_value_that_is_absent_from_one_item_is_not_taken_from_another(backend: str) -> None:
    results = opened(STREAM, backend).items()
    assert [result["score"]["truth"] for result in results] == [1, -1, 3]


def test_what_an_item_that_failed_left_on_the_device_is_not_taken_for_the_next() -> None:
    nodes = """  glare: {op: glared, in: {image: light}}
  whole: {op: failing, in: {image: light}, with: {at: 3}}
  sum: {op: summed, in: {image: whole, before: glare.glare}}
  save:"""
    text = WAITING.replace("  save:", nodes).replace("{light: light", "{light: sum")
    pipeline = load(graph_of(text), backend="opencl")
    dim, bright = np.ones((3, 4, 5), np.float32), np.full((3, 4, 5), 3, np.float32)
    with pytest.raises(NodeError):
        pipeline(frames=bright)
    np.testing.assert_array_equal(pipeline(frames=dim)["light"], dim)


def test_what_does_not_depend_on_the_stream_runs_once(toys: list[str], backend: str) -> None:
    list(opened(STREAM, backend).items())
    assert toys == ["at_rest", "touch 1", "noted 1", "touch 2", "noted 2", "touch 3", "noted 3"]


def test_an_item_is_read_only_when_the_one_before_is_done(toys: list[str]) -> None:
    next(opened(STREAM).items())
    assert "touch 2" not in toys


def test_repeats_compute_an_item_often_and_write_it_once(toys: list[str], backend: str) -> None:
    text = STREAM.replace("image: light}}\noutputs", "image: more}}\noutputs").replace(
        "  save:", "  more: {op: doubled, in: {image: light}}\n  save:"
    )
    results = list(opened(text, backend, count=2).items(repeats=3))
    assert [result["score"]["mean"] for result in results] == [1, 2]
    assert toys.count("doubled") == 6
    assert [word for word in toys if word.startswith("noted")] == ["noted 2", "noted 4"]


def test_a_graph_without_a_stream_has_one_item(height_file: str, backend: str) -> None:
    results = list(opened(SLOPES, backend, file=height_file).items())
    assert len(results) == 1
    truth = np.load(height_file)
    found = results[0]["height"]
    np.testing.assert_allclose(found, truth - truth.mean(), atol=0.02)


def test_every_step_of_the_plan_has_its_time() -> None:
    pipeline = opened(STREAM, "opencl")
    for result in pipeline.items():
        computed = {step.name for step in pipeline.plan.steps}
        assert computed <= {*result.times}
        assert all(ms >= 0 for ms in result.times.values())


def test_a_result_is_a_mapping_of_its_outputs() -> None:
    (result, *_) = opened(STREAM).items()
    assert set(result) == {"light", "score"}
    assert "height" not in result
    with pytest.raises(KeyError, match="no output 'height'; it has light, score"):
        result["height"]


def test_an_array_stands_in_for_a_source(toys: list[str], backend: str) -> None:
    """A view in any order does; and a result is not overwritten by the next."""
    pipeline = load(graph_of(WAITING), backend=backend)
    view = np.random.default_rng(1).random((5, 4, 3)).astype(np.float32).T
    stacks = [np.full((3, 4, 5), 0.25, np.float32), view, np.ones((3, 4, 5), np.float32)]
    found = [pipeline(frames=stack) for stack in stacks]
    for stack, result in zip(stacks, found, strict=True):
        np.testing.assert_array_equal(result["light"], stack)
        assert result["score"]["truth"] == -1, "an input that may be left out is absent"
    assert toys == ["at_rest"]


class OnAnotherDevice:
    """A tensor of a library that leaves a copy to the caller."""

    def __array__(self, dtype: object = None, copy: bool | None = None) -> np.ndarray:
        raise TypeError("copy it to the host first")


@pytest.mark.parametrize(
    ("stack", "message"),
    [
        (np.zeros((4, 5), np.float32), r"K x H x W, not one image of \(4, 5\)"),
        (np.zeros((3, 0, 5), np.float32), "holds no pixel"),
        (np.full((3, 4, 5), np.nan), "holds NaN or infinite values"),
        (np.full((3, 4, 5), np.inf), "holds NaN or infinite values"),
        (np.zeros((3, 4, 5), np.int16), r"not int16; stack\.astype\(np\.uint8\)"),
        (np.zeros((3, 4, 5), bool), "unsigned integers or floats, not bool"),
        (np.zeros((3, 4, 5), complex), "unsigned integers or floats, not complex128"),
        (np.zeros((3, 4, 5), object), "unsigned integers or floats, not object"),
        (
            np.ma.masked_array(np.ones((3, 4, 5)), np.eye(4, 5) * np.ones(3)[:, None, None]),
            "masked",
        ),
        ([[[1.0, 2.0]], [[1.0]]], "a stack of images: a list is not an array"),
        (OnAnotherDevice(), "OnAnotherDevice is not an array: copy it to the host first"),
        (np.zeros((3, 4, 6), np.float32), "6 columns of pixels in frames.image, but 5 in cal.flat"),
        (np.zeros((4, 4, 5), np.float32), "4 lights in frames.image, but 3 in cal.flat"),
    ],
)
def test_a_stack_that_does_not_fit_is_refused(stack: Any, message: str) -> None:
    pipeline = load(graph_of(WAITING), backend="numpy")
    with pytest.raises(InputError, match=message):
        pipeline(frames=stack)
    good = np.ones((3, 4, 5), np.float32)
    assert float(pipeline(frames=good)["light"].max()) == 1, "a refusal leaves no trace"


def test_an_array_replaces_any_source_of_one_array(height_file: str, backend: str) -> None:
    truth = np.load(height_file)
    (from_file,) = load(graph_of(SLOPES), file=height_file, backend=backend).items()
    pipeline = load(graph_of(SLOPES), backend=backend)
    np.testing.assert_array_equal(
        pipeline(height=truth.astype(float))["height"], from_file["height"]
    )


class OnlyDlpack:
    """An array of a library that NumPy knows by DLPack alone."""

    def __init__(self, array: np.ndarray) -> None:
        self.array = array

    def __dlpack__(self, **options: Any) -> Any:
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self) -> Any:
        return self.array.__dlpack_device__()


def test_an_array_may_come_by_dlpack() -> None:
    height = np.ones((4, 5), np.float32)
    assert load(graph_of(SLOPES), backend="numpy")(height=OnlyDlpack(height))["mask"].all()


@pytest.mark.parametrize(
    ("height", "message"),
    [
        (np.zeros(4, np.float32), r"height is float32 H x W \[mm\], not of shape \(4,\)$"),
        (np.zeros((2, 4, 5)), r"not of shape \(2, 4, 5\); several go through pipeline.stream"),
        (np.zeros((4, 5), np.uint16), r"height is float32 H x W \[mm\], not uint16"),
        (np.zeros((0, 4, 5)), "holds no pixel"),
        (np.full((4, 5), np.nan), "height holds NaN or infinite values"),
        (np.full((4, 5), 1e300), r"height: holds a height beyond 10000 mm"),
    ],
)
def test_an_array_that_does_not_fit_its_source_is_refused(height: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load(graph_of(SLOPES), backend="numpy")(height=height)


SHAPE = "  shape: {op: read_height, with: {file: $file}}\n  save:"
BOTH_HANDED_IN = WAITING.replace("nodes:", "  file: {kind: path, help: a height}\nnodes:", 1)
BOTH_HANDED_IN = BOTH_HANDED_IN.replace("prefer: [opencl, numpy]\n", "").replace("  save:", SHAPE)
BOTH_HANDED_IN = BOTH_HANDED_IN.replace("truth: frames.truth", "truth: shape")


def test_a_graph_whose_stream_is_given_needs_its_other_files_too() -> None:
    with pytest.raises(InputError, match=r"graph needs file=\.\.\. \(a height\)"):
        load(graph_of(BOTH_HANDED_IN), count=2)


@pytest.mark.parametrize("names", [(), ("light",), ("frames", "light")])
def test_arrays_are_needed_for_exactly_the_open_sources(names: tuple[str, ...]) -> None:
    pipeline = load(graph_of(WAITING), backend="numpy")
    with pytest.raises(InputError, match=r"needs arrays for \['frames'\]"):
        pipeline(**dict.fromkeys(names, np.ones((3, 4, 5), np.float32)))
    with pytest.raises(InputError, match="call the pipeline with arrays for frames"):
        next(pipeline.items())


def test_a_pipeline_with_a_stream_of_its_own_is_not_called() -> None:
    pipeline = load(graph_of(WAITING), backend="numpy", count=2)
    with pytest.raises(InputError, match=r"'frames' yields the items itself; iterate"):
        pipeline()
    assert len(list(pipeline.items())) == 2


def test_a_size_known_only_from_data_may_differ_between_items(backend: str) -> None:
    text = """
format: 1
nodes:
  frames: {op: touches}
  found:  {op: bright, in: {image: frames.image}}
outputs: {pixel: found.pixel, light: found.light}
"""
    results = list(open_pipeline(graph_of(text), {}, backend=backend).items())
    assert [result["pixel"].tolist() for result in results] == [[], [*range(20)], [*range(20)]]
    assert [result["light"].tolist() for result in results] == [[], [2.0] * 20, [3.0] * 20]


def test_a_steady_stream_allocates_nothing_after_one_item(toys: list[str], device: OpenCL) -> None:
    text = STREAM.replace("with: {count: $count}", "with: {count: $count, rows: 64, columns: 80}")
    text = text.replace("{op: at_rest}", "{op: at_rest, with: {rows: 64, columns: 80}}")
    pipeline = opened(text, "opencl", count=200)
    pool = pipeline._device.pool  # type: ignore[union-attr]
    managed: list[int] = []
    blocks: list[int] = []
    memory: list[int] = []
    tracemalloc.start()
    try:
        for _ in pipeline.items():
            managed.append(pool.nbytes)
            blocks.append(pipeline.buffers)
            memory.append(tracemalloc.get_traced_memory()[0])
            toys.clear()
    finally:
        tracemalloc.stop()
    assert len(managed) == 200
    assert set(managed) == {managed[0]}
    assert set(blocks) == {blocks[0]}
    image = 3 * 64 * 80 * 4
    assert memory[-1] - memory[20] < 5 * image, "180 items leave less than five images behind"


def test_calls_with_arrays_allocate_nothing_after_the_first() -> None:
    pipeline = load(graph_of(WAITING), backend="opencl")
    stack = np.ones((3, 4, 5), np.float32)
    pool = pipeline._device.pool  # type: ignore[union-attr]
    managed = set()
    for _ in range(50):
        pipeline(frames=stack)
        managed.add(pool.nbytes)
    assert len(managed) == 1


def test_another_size_of_image_is_taken_from_call_to_call() -> None:
    text = """
format: 1
params: {folder: {kind: path}}
nodes:
  frames: {op: read_capture, with: {folder: $folder}}
  lit: {op: label_lit, in: {light: frames.image}}
outputs: {lit: lit}
"""
    pipeline = load(graph_of(text), backend="opencl")
    for shape in ((3, 4, 5), (4, 9, 7), (3, 5, 4)):
        assert pipeline(frames=np.full(shape, 0.5, np.float32))["lit"].shape == shape[1:]


def test_a_size_that_clashes_after_good_items_gets_the_same_message(backend: str) -> None:
    pipeline = load(graph_of(WAITING), backend=backend)
    good = np.ones((3, 4, 5), np.float32)
    for _ in range(2):
        assert float(pipeline(frames=good)["light"].min()) == 1
        with pytest.raises(
            InputError, match=r"6 columns of pixels in frames.image, but 5 in cal.flat"
        ):
            pipeline(frames=np.ones((3, 4, 6), np.float32))


def test_nodes_of_one_kernel_keep_their_own_settings(backend: str) -> None:
    more = "\n".join(
        f"  n{floor}: {{op: flat_field, with: {{floor: {floor}}}, "
        "in: {image: frames.image, flat: cal.flat, dark: cal.dark}}"
        for floor in (2, 4)
    )
    text = added(more, "half: n2, quarter: n4", WAITING)
    pipeline = load(graph_of(text), backend=backend)
    for level in (1.0, 0.5):
        found = pipeline(frames=np.full((3, 4, 5), level, np.float32))
        shares = [float(found[name].max()) / level for name in ("light", "half", "quarter")]
        assert shares == [1, 0.5, 0.25]


def test_a_once_only_step_that_failed_is_tried_afresh(height_file: str) -> None:
    pipeline = opened(SLOPES, file=height_file)
    good = np.load(height_file)
    np.save(height_file, np.full((3, 3), np.nan))
    with pytest.raises(InputError, match="NaN"):
        next(pipeline.items())
    np.save(height_file, good[:5, :6])
    assert next(pipeline.items())["height"].shape == (5, 6)


@pytest.mark.parametrize(
    ("op", "kind", "message"),
    [
        ("failing", NodeError, r"node 'light' \(failing\) failed: RuntimeError: a careless node"),
        ("refusing", InputError, "image.png: too dark"),
        ("forgetful", NodeError, "declares float32 K x H x W .* but returned a NoneType"),
        ("listing", NodeError, "declares float32 K x H x W .* but returned a list"),
        ("doubtful", NodeError, "declares float32 K x H x W .* but returned float64"),
    ],
)
def test_a_node_that_fails_is_named(
    toys: list[str], op: str, kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        list(opened(lit_by(op)).items())
    assert not [word for word in toys if word.startswith("noted")]


def test_only_the_caller_may_hand_in_a_cameras_integers(backend: str) -> None:
    text = STREAM.replace("op: touches, with: {count: $count}", "op: byte_touches")
    with pytest.raises(NodeError, match=r"declares float32 K x H x W .* but returned uint8"):
        list(opened(text, backend).items())


def test_a_failure_is_not_tried_again_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*args: object) -> None:
        raise RuntimeError("the device is gone")

    pipeline = opened(STREAM, "opencl")
    monkeypatch.setattr(Prepared, "launch", fail)
    with pytest.raises(NodeError, match=r"'light' \(flat_field\) failed: .* the device is gone"):
        next(pipeline.items())


def test_pipelines_of_several_threads_do_not_disturb_one_another() -> None:
    file = graph_of(WAITING)

    def work(level: float) -> bool:
        pipeline = load(file, backend="opencl")
        stack = np.full((3, 4, 5), level, np.float32)
        found = [pipeline(frames=stack)["light"] for _ in range(20)]
        return all(np.array_equal(each, stack) for each in found)

    with ThreadPoolExecutor(3) as threads:
        assert list(threads.map(work, (0.25, 0.5, 0.75))) == [True] * 3


def test_images_for_the_device_alone_are_copied_as_integers(
    device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[np.dtype[Any]] = []
    upload = OpenCL.start_upload

    def watched(self: OpenCL, array: np.ndarray) -> Any:
        sent.append(array.dtype)
        return upload(self, array)

    monkeypatch.setattr(OpenCL, "start_upload", watched)
    text = WAITING.replace("  score:  {op: watched, in: {image: light, truth: frames.truth}}\n", "")
    pipeline = load(graph_of(text.replace(", score: score", "")), backend="opencl")
    pipeline(frames=np.zeros((3, 4, 5), np.uint8))
    assert sent == [np.float32, np.float32, np.uint8]  # flat, dark, image


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("op", ["flat_field", "doubled"])
def test_integers_are_the_same_fractions_on_device_and_host(dtype: type, op: str) -> None:
    text = WAITING.replace(
        "  frames:", "  more: {op: doubled, in: {image: frames.image}}\n  frames:"
    )
    # With a reader on the host the integers cannot go to the device as they came.
    graph = graph_of(text if op == "doubled" else WAITING)
    stack = np.arange(60, dtype=dtype).reshape(3, 4, 5) * dtype(4)
    on_host = load(graph, backend="numpy")(frames=stack)["light"]
    on_device = load(graph, backend="opencl")(frames=stack)["light"]
    np.testing.assert_array_equal(on_device, on_host)
    np.testing.assert_array_equal(on_host, stack / np.float32(np.iinfo(dtype).max))


def test_images_of_another_type_are_taken_from_call_to_call(backend: str) -> None:
    text = WAITING.replace("  score:  {op: watched, in: {image: light, truth: frames.truth}}\n", "")
    pipeline = load(graph_of(text.replace(", score: score", "")), backend=backend)
    expected = np.linspace(0, 1, 60, dtype=np.float32).round().reshape(3, 4, 5)
    for dtype in (np.uint8, np.float32, np.uint16, np.uint8, np.uint32, np.float64):
        full = np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1
        stack = expected.astype(dtype) * dtype(full)
        np.testing.assert_array_equal(pipeline(frames=stack)["light"], expected, str(dtype))


def test_labels_of_three_axes_are_no_fractions_of_full_scale(backend: str) -> None:
    nodes = """  labels: {op: labelled, in: {image: frames.image}}
  number: {op: bits, in: {labels: labels}}"""
    pipeline = load(graph_of(added(nodes, "number: number", WAITING)), backend=backend)
    stack = np.linspace(0, 1, 60, dtype=np.float32).reshape(3, 4, 5)
    np.testing.assert_array_equal(pipeline(frames=stack)["number"], stack > 0.5)


def test_a_late_device_error_names_the_node_and_ends_one_item() -> None:
    text = added("  hit: {op: struck, in: {image: light}}", "hit: hit", WAITING)
    pipeline = load(graph_of(text), backend="opencl")
    one, two = (np.full((3, 4, 5), level, np.float32) for level in (1, 2))
    with pytest.raises(DeviceError, match=r"failed at 'hit' \(struck\)"):
        pipeline(frames=two)
    np.testing.assert_array_equal(pipeline(frames=one)["hit"], one)


def test_a_device_out_of_memory_is_named_with_the_transfer(monkeypatch: pytest.MonkeyPatch) -> None:
    pipeline = load(graph_of(WAITING), backend="opencl")

    def full(self: OpenCL, array: Any) -> Any:
        raise cl.MemoryError("MEM_OBJECT_ALLOCATION_FAILURE")

    monkeypatch.setattr(OpenCL, "start_upload", full)
    with pytest.raises(DeviceError, match=r"failed at 'upload cal.*MEM_OBJECT"):
        pipeline(frames=np.ones((3, 4, 5), np.float32))


def test_an_absent_input_with_its_own_size_is_left_out(backend: str) -> None:
    text = added("  more: {op: leaned, in: {image: light}}", "more: more", WAITING)
    stack = np.ones((3, 4, 5), np.float32)
    found = load(graph_of(text), backend=backend)(frames=stack)
    np.testing.assert_array_equal(found["more"], stack)


@pytest.mark.parametrize(("maker", "reader"), [(b, c) for b in "nd" for c in "nd"])
def test_a_value_of_a_size_known_only_from_data_can_be_recalled(maker: str, reader: str) -> None:
    names = {"n": "numpy", "d": "opencl"}
    nodes = f"""  found: {{op: bright, in: {{image: light}}, backend: {names[maker]}}}
  more:
    op: leaned
    in: {{image: light, table: previous.found.light}}
    backend: {names[reader]}
  save:"""
    text = STREAM.replace("  save:", nodes).replace("{light: light", "{light: more")
    results = list(opened(text, None).items())
    assert [float(result["light"].max()) for result in results] == [1, 2, 43]
    assert [result.warnings for result in results] == [[], [], []]


@pytest.mark.parametrize(
    ("node", "error"), [("failing, with: {at: 2.0}", NodeError), ("refusing", InputError)]
)
def test_an_error_names_the_item_at_which_it_was_raised(
    node: str, error: type[InputError | NodeError]
) -> None:
    with pytest.raises(error, match=r"^touch\d: ") as told:
        list(opened(lit_by(node)).items())
    assert str(told.value).startswith(f"{told.value.item}: ")
