"""Pass 5: an array is moved where it is read, once, and nowhere else."""

import pytest

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan
from tests.graph.conftest import SLOPES, STREAM, Write
from tests.graph.plan.plans import planned


def transfers(plan: Plan) -> list[str]:
    return [step.name for step in plan.steps if step.kind in ("upload", "download")]


def test_an_array_goes_up_where_a_kernel_reads_it_and_down_where_it_is_wanted(
    write: Write, device: OpenCL
) -> None:
    text = f"prefer: [opencl]{SLOPES}"  # whatever kind of device it is
    assert sorted(transfers(planned(write(text), device))) == [
        "download again.integrate_dct", "download slope.mask", "upload height.read_height",
    ]  # fmt: skip


def test_nothing_is_moved_on_numpy_and_numbers_never_are(write: Write, device: OpenCL) -> None:
    assert transfers(planned(write(SLOPES), None)) == []
    assert not [name for name in transfers(planned(write(SLOPES), device)) if "pixel" in name]


def test_one_upload_is_shared_by_all_readers(write: Write, device: OpenCL) -> None:
    text = SLOPES.replace(
        "outputs: {", "  rest: {op: rest_at_border, in: {height: height}}\noutputs: {rest: rest, "
    )
    plan = planned(write(text), device)
    assert transfers(plan).count("upload height.read_height") == 1
    (upload,) = [step for step in plan.steps if step.kind == "upload"]
    assert upload.reads == upload.writes == (Value("height", "read_height"),)
    assert upload.why == "shared by all readers"


def test_a_value_between_two_kernels_stays_on_the_device(device: OpenCL) -> None:
    moved = " ".join(transfers(planned("reconstruct", device)))
    for value in ("relight.light.", "relight.height_0.", "label.slope"):
        assert f" {value}" not in moved


def test_a_value_outside_the_stream_is_uploaded_once(
    toys: list[str], write: Write, device: OpenCL
) -> None:
    stream = {s.name: s.stream for s in planned(write(STREAM), device).steps}
    assert stream["upload cal.flat"] is False
    assert stream["upload frames.image"] is True


def test_a_node_bound_elsewhere_costs_a_transfer_each_way(write: Write, device: OpenCL) -> None:
    text = SLOPES.replace(
        "again:  {op: integrate_dct", "again:  {backend: numpy, op: integrate_dct"
    )
    assert "download slope.slope" in transfers(planned(write(text), device))


def test_every_step_reads_what_an_earlier_one_has_brought_there(device: OpenCL) -> None:
    plan = planned("paper", device)
    there: set[tuple[Value, str]] = set()
    for step in plan.steps:
        if step.kind == "run":
            for name, value in plan.tasks[step.name].reads.items():
                is_array = plan.tasks[step.name].node.inputs[name].kind == "array"
                assert (value, step.backend if is_array else "numpy") in there
        side = {"upload": "opencl", "download": "numpy"}.get(step.kind, step.backend)
        there |= {(value, side) for value in step.writes}


@pytest.mark.parametrize("bound", [None, "numpy"])
def test_a_neutral_constant_moves_only_itself(
    write: Write, device: OpenCL, bound: str | None
) -> None:
    change = f"\n  - {{backend: light, to: {bound}}}" if bound else ""
    file = write(f"format: 1\nextends: paper\npatch:\n  - neutral: shadow{change}")
    plan = planned(file, device)
    assert not [name for name in transfers(plan) if "cal.null" in name]
    assert next(step for step in plan.steps if step.name == "shadow").reads == ()
