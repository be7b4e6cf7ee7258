"""Pass 6: the order of the steps, and when a buffer is free again."""

import pytest

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.files.read_graph import shipped_names
from tactograph.graph.plan.draft import Value
from tests.each import each
from tests.graph.conftest import STREAM, Write
from tests.graph.plan.plans import planned

pytestmark = pytest.mark.usefixtures("toys")


@each("name", shipped_names())
def test_every_value_is_made_before_it_is_read(name: str, device: OpenCL) -> None:
    made: set[Value] = set()
    for step in planned(name, device).steps:
        assert set(step.reads) <= made
        made |= set(step.writes)


def test_sources_come_first_so_that_sizes_clash_before_anything_is_computed(
    write: Write, device: OpenCL
) -> None:
    source = "  cal:    {op: at_rest}\n"
    last = STREAM.replace(source, "").replace("outputs:", f"{source}outputs:")
    more = last.replace("  light:", "  more: {op: doubled, in: {image: frames.image}}\n  light:")
    file = write(more.replace("outputs: {", "outputs: {more: more, "))
    runs = [step.name for step in planned(file, device).steps if step.kind == "run"]
    assert runs[:2] == ["cal", "frames"]


def test_the_device_gets_work_before_the_host_begins_its_own(write: Write, device: OpenCL) -> None:
    """And before all what the host waits for."""
    text = STREAM.replace(
        "  score:",
        "  own:    {op: doubled, in: {image: frames.image}}\n"
        "  late:   {op: summed, in: {image: frames.image}}\n"
        "  score:",
    ).replace("outputs: {", "outputs: {own: own, late: late, ")
    text = text.replace("{op: watched, in: {image: light", "{op: watched, in: {image: back")
    back = "  back:   {op: doubled, in: {image: light}}\n  score:"
    steps = [s.name for s in planned(write(text.replace("  score:", back)), device).steps]
    places = [steps.index(name) for name in ("light", "download light.flat_field", "late", "own")]
    assert places == sorted(places)


def test_nodes_that_run_once_come_first_and_sinks_last(write: Write, device: OpenCL) -> None:
    """So that nothing is written if a computation fails."""
    steps = planned(write(STREAM), device).steps
    stream = [step.stream for step in steps]
    assert stream == sorted(stream)
    assert steps[-1].name == "save"


def test_the_order_is_that_of_the_file_where_the_edges_leave_a_choice(write: Write) -> None:
    text = "format: 1\nnodes:\n  frames: {op: touches}\n" + "".join(
        f"  n{number}: {{op: doubled, in: {{image: frames.image}}}}\n" for number in (9, 3, 7)
    )
    file = write(text + "outputs: {a: n3, b: n7, c: n9}")
    assert [step.name for step in planned(file, None).steps] == ["frames", "n9", "n3", "n7"]


def test_a_device_value_is_released_after_its_last_reader(write: Write, device: OpenCL) -> None:
    released = {
        value: step.name for step in planned(write(STREAM), device).steps for value in step.release
    }
    assert released == {
        Value("frames", "image"): "light",
        Value("light", "flat_field"): "download light.flat_field",
    }


@each("name", shipped_names())
def test_each_value_of_the_stream_is_released_exactly_once_and_never_read_again(
    name: str, device: OpenCL
) -> None:
    plan = planned(name, device)
    steps = [step for step in plan.steps if step.stream]
    recalled = {value for task in plan.tasks.values() for value in task.recalls.values()}
    on_device = {
        value
        for step in steps
        if step.kind == "upload" or (step.backend == "opencl" and step.kind != "download")
        for value in step.writes
    }
    released: list[Value] = []
    for step in steps:
        if step.backend == "opencl":
            assert not set(step.reads) & set(released)
        released += step.release
    assert len(set(released)) == len(released)
    assert on_device - recalled <= set(released)
    assert not recalled & set(released)


@pytest.mark.parametrize(
    ("graph", "names"),
    [
        # It would keep the host from it, and the device is idle once the sizes are there.
        ("precise", ("first.pass.mean", "first.rest", "first.pass.rises", "first.pass.raw")),
        # The device checks the touch while the host looks for contacts.
        ("reconstruct", ("download height.distort_height", "judge.evidence", "measure.contact")),
    ],
    ids=["sizes are waited for after the host's own work", "the touch is checked meanwhile"],
)
def test_host_and_device_are_busy(device: OpenCL, graph: str, names: tuple[str, ...]) -> None:
    steps = [step.name for step in planned(graph, device).steps]
    places = [steps.index(name) for name in names]
    assert places == sorted(places)
