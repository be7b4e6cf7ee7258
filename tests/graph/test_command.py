"""The command line: exit codes, one clear line, no traceback, nothing half written."""

import errno
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import jsonschema
import numpy as np
import pytest

from tactograph.graph import command
from tactograph.graph.backends.devices import how_to_get_one
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.commands.graphs import FIRST_GRAPHS
from tactograph.graph.commands.run import _in_rows, _times
from tactograph.graph.files.graph_places import shipped
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.graph.run.open_pipeline import open_pipeline
from tests.each import each
from tests.fixtures import python
from tests.graph.conftest import SLOPES, STREAM, Command, Outcome, Write, lit_by, one_line

WRITING = """
format: 1
params:
  capture: {kind: path, help: the images}
  file: {kind: path}
  out: {kind: path}
nodes:
  frames: {op: read_capture, with: {folder: $capture}}
  lit:    {op: label_lit, in: {light: frames.image}}
  height: {op: read_height, with: {file: $file}}
  pixel:  {op: pixel_size, with: {mm: 0.1}}
  score:  {op: evaluate_height, in: {height: height, pixel: pixel, truth: frames.truth}}
  touch:
    op: join_touch
    in: {height: height, pixel: pixel, frames: frames, shadow: lit}
  save:
    op: write_result
    in: {touch: touch, metrics: score}
    with: {folder: $out, pictures: false}
outputs: {score: score}
"""


@pytest.fixture
def captures(tmp_path: Path) -> Path:
    """A stream of three captures of 24 x 32 pixels."""
    folder = tmp_path / "captures"
    random = np.random.default_rng(1)
    for name in ("a", "b", "c"):
        (folder / name).mkdir(parents=True)
        for led in range(1, 5):
            image = random.integers(50, 200, (24, 32)).astype(np.uint8)
            cv2.imwrite(str(folder / name / f"led{led}.png"), image)
    return folder


@pytest.fixture
def run_writing(
    tactograph: Command, write: Write, captures: Path, height_file: str, tmp_path: Path
) -> Command:
    """Run the graph that writes, with further options and with other places if they are named."""

    def run(*options: str, **places: object) -> Outcome:
        params = {"capture": captures, "file": height_file, "out": tmp_path / "out"} | places
        words = [f"{name}={place}" for name, place in params.items()]
        return tactograph("run", write(WRITING), *words, *options)

    return run


def test_help_lists_every_command_and_version_prints_the_version(tactograph: Command) -> None:
    done = tactograph("--help")
    assert done.code == 0
    for name in command.COMMANDS:
        assert f"\n  {name} " in done.out
    assert tactograph("--version").out.startswith("tactograph, version ")


@pytest.mark.parametrize("name", command.COMMANDS)
def test_every_command_has_help(tactograph: Command, name: str) -> None:
    done = tactograph(name, "--help")
    assert done.code == 0
    assert "Usage: " in done.out
    assert "internal error" not in done.err


@pytest.mark.parametrize(
    ("words", "advice"),
    [
        (("fly",), "--help')"),
        (("run",), "--help')"),
        (("check",), "--help')"),
        (("run", "paper", "--backend", "cuda"), "--help')"),
        (("run", "paper", "--no-such-option"), "--help')"),
        (("run",), "'tactograph graphs'"),
        (("check",), "'tactograph graphs'"),
        (("compare",), "'tactograph graphs'"),
    ],
)
def test_a_mistyped_command_exits_with_2_and_says_where_to_look(
    tactograph: Command, words: tuple[str, ...], advice: str
) -> None:
    assert advice in one_line(tactograph(*words))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", "reconstrukt"), "did you mean 'reconstruct' or 'reconstruct_far'?"),
        (("run", "zzzz"), "a pipeline that ships; 'tactograph graphs' lists all"),
        (("nodes", "zzzz"), "no node is called 'zzzz'; 'tactograph nodes' lists all"),
        (("check", "paper/no_shadow"), "no such graph file; did you mean 'paper_no_shadow'?"),
        (("run", "paper", "capture=x", "calibration=x", "crop=1,2"), "needed (x0,y0,x1,y1), not ["),
        (("run", "nowhere.yaml"), "nowhere.yaml: there is no such graph file"),
        (("run", "paper", "capture"), "as name=value, such as capture=VALUE"),
        (("run", "paper", "touch", "cal.npz"), "'touch': write values as name=value, such as capt"),
        (("--quiet", "run", "paper"), "'--quiet'; write a command's option behind"),
        (("run", "paper", "--capture", "a"), "'--capture'; a param is written capture=a (see"),
        (("run", "paper", "--capture=a"), "'--capture'; a param is written capture=a (see"),
        (("run", "paper", "--capture", "flat=a"), "a param is written capture=VALUE (see"),
        (("run", "paper", "--quiett"), "a param is written quiett=VALUE ("),
        (("run", "paper", "captur=x"), "has no parameter 'captur'; did you mean 'capture'?"),
        (("run", "paper", "zzz=x"), "paper has no parameter 'zzz' (it takes: capture, "),
        (("run", "paper", "capture=a", "capture=b"), "capture is given twice"),
        (("run", "paper", "capture="), "capture=: a path is needed"),
        (("run", "paper"), "paper needs "),
        (("run", "paper", "capture=nowhere", "calibration=cal.npz"), "no such "),
        (("run", "calibrate", "camera_mm=big"), "camera_mm=big: a number is needed"),
        (
            ("run", "calibrate", "capture=nowhere", "ball_radius_mm=4,0"),
            "not 0 at [1] (for a decimal number write a point",
        ),
        (("run", "calibrate", "camera_mm=true"), "a number is needed"),
        (("run", "calibrate", "ball_radius_mm=1__0"), "'1__0' is not a number"),
        (("run", "calibrate", "ball_center_px=1,x"), "a number is needed, not 'x'"),
        (("run", "simulate", "seed=1.5"), "seed=1.5: a whole number is needed"),
        (("run", "simulate", f"seed={'9' * 5000}"), "is not a number"),
        (("check", "calibrate", "--set", "model.without=[lobe,hairs]"), "'camera', not 'hairs'"),
        (("run", "paper", "--set", "shadow"), "--set shadow: write it as node.param=value"),
        (("run", "paper", "--set", "shadow.threshold=1__0"), "'1__0' is not a number"),
        (("check", "paper", "--set", "shadwo.threshold=1"), "did you mean 'shadow'?"),
        (("check", "paper", "--set", "shadow.threshold=-1"), "greater than 0, not -1"),
        (("check", "paper", "--set", "shadow.thresh=1"), "did you mean 'threshold'?"),
        (("resolve", "papre"), "did you mean 'paper'?"),
        (("explain", "paper", "x=1"), "has no parameter 'x'"),
        (("explain", "paper", "--device", "abacus"), "no OpenCL device's name contains 'abacus'"),
        (("draw", "paper", "--out", "x.pdf"), "the name has to end in .svg"),
        (("nodes", "flat_feild"), "did you mean 'flat_field'?"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(
    tactograph: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    error = one_line(tactograph(*words))
    assert message in error
    assert len(error) < 1000
    assert list(tmp_path.iterdir()) == []


def test_a_mistake_in_a_graph_gives_one_line_with_its_place(
    tactograph: Command, write: Write
) -> None:
    file = write(SLOPES.replace("op: height_slopes", "op: heigt_slopes"))
    for name in ("run", "check", "explain", "draw"):
        assert f"{file}:9:12: nodes.slope.op: no node" in one_line(tactograph(name, file))


def test_a_graph_is_run(about: Command, height_file: str) -> None:
    done = about("run", SLOPES, f"file={height_file}")
    assert done.code == 0, done.err
    assert done.err == ""
    assert "1: " in done.out
    assert "ms on opencl" in done.out


def test_each_item_of_a_stream_is_printed_with_its_figures(about: Command) -> None:
    done = about("run", STREAM, "count=4", "--backend", "numpy")
    heads = [line.partition(":")[0] for line in done.out.splitlines() if line[0] != " "]
    assert heads == ["1 touch1", "2 touch2", "3 touch3", "4 touch4"], "number and name"
    assert re.search(r"^  mean +4$", done.out, re.MULTILINE)


def test_figures_are_rows_and_those_of_one_led_are_in_the_row_of_their_figure() -> None:
    figures = {"entries": 28277.0, "iou": 0.97786, "iou/led1": 1.0, "iou/led2": 0.25, "gap": np.nan}
    figures |= {"error/matt": 1.5, "error": 0.25, "cut/c1": True, "cut/c2": False}
    assert _in_rows(figures) == {
        "entries": "28277", "iou": "0.9779   led1 1       led2 0.25", "gap": "nan",
        "error": "0.25     matt 1.5", "cut": "c1 yes     c2 no",
    }  # fmt: skip


def test_an_item_that_takes_longer_than_a_frame_names_its_slowest_node(
    write: Write, height_file: str
) -> None:
    params = {"file": height_file}
    (result,) = open_pipeline(write(SLOPES), params, backend="numpy").items()
    for name in result.times:
        result.times[name] = {"slope": 20.0, "again": 15.0}.get(name, 0.0)
    assert _times(result) == "35.0 ms on numpy; slowest: slope (height_slopes) 20.0 ms"
    result.times["again"] = 10.0
    assert _times(result) == "30.0 ms on numpy"


@pytest.mark.usefixtures("toys")
def test_without_a_stream_what_is_written_counts_as_well(write: Write, height_file: str) -> None:
    """As of `calibrate`, which waits longest for the ranks in its file."""
    save = "  cal: {op: at_rest}\n  save: {op: noted, in: {image: cal.flat}}\n"
    text = SLOPES.replace("outputs:", f"{save}outputs:")
    (result,) = open_pipeline(write(text), {"file": height_file}, backend="numpy").items()
    result.times["save"] = 5000.0
    assert _times(result).endswith("slowest: save (noted) 5000.0 ms")


def test_of_several_sentences_each_stands_with_its_name(about: Command, height_file: str) -> None:
    cal = "  cal: {op: at_rest}\n  seen: {op: pressed_words, in: {image: cal.flat}}\n"
    text = SLOPES.replace("outputs: {", f"{cal}outputs: {{leds: seen, film: seen, ")
    told = about("run", text, f"file={height_file}").out
    assert re.search(r"^1: .* ms .*\n  leds +nothing of .*\n  film +nothing of", told, re.MULTILINE)


def test_a_warning_names_its_item_unless_it_holds_for_all_and_is_counted(about: Command) -> None:
    done = about("run", lit_by("noticed"))
    assert done.err == "".join(f"warning: touch{n}: a warning\n" for n in (1, 2, 3))
    assert done.out.endswith("\n3 warnings, see above\n")
    at_rest = "  dark:   {op: noticed, in: {image: cal.flat}}\n  light:"
    done = about("run", STREAM.replace("  light:", at_rest).replace("flat: cal.flat", "flat: dark"))
    assert done.err == "warning: a warning\n"
    done = about("run", STREAM.replace("op: touches", "op: noticed_touches"))
    assert done.err == "warning: a warning of the source\n"
    assert done.out.endswith("\n1 warning, see above\n")
    assert about("run", STREAM, "--quiet") == Outcome(0, "", "")


def test_a_fallback_is_one_line_on_the_terminal(about: Command, no_device: None) -> None:
    done = about("run", STREAM)
    line = "light runs on numpy: opencl is preferred, but no OpenCL device works"
    assert (done.code, done.err) == (0, f"fallback: {line}\n")
    assert f"fallback: {line}" in about("explain", STREAM).out
    assert f"--strict: {line}" in one_line(about("run", STREAM, "--strict"))
    assert "--backend opencl: no" in one_line(about("run", STREAM, "--backend", "opencl"))


def test_strict_runs_a_node_without_a_kernel(about: Command) -> None:
    done = about("run", STREAM, "--strict")
    assert (done.code, done.err) == (0, "")


def test_a_result_records_where_each_node_ran_and_every_fallback(
    run_writing: Command, write: Write, tmp_path: Path, no_device: None
) -> None:
    done, out = run_writing(), tmp_path / "out"
    assert done.code == 0, done.err
    assert sorted(f.name for f in out.iterdir()) == ["a", "b", "c"]
    result = json.loads((out / "b" / "result.json").read_text())
    assert result["graph"]["hash"] == read_graph(write(WRITING)).hash
    assert result["capture"] == "b"
    assert result["device"] is None
    line = "lit runs on numpy: opencl is preferred, but no OpenCL device works"
    assert result["fallbacks"] == [line]
    nodes = {node["node"]: node for node in result["nodes"]}
    assert nodes["lit"]["backend"] == "numpy"
    assert nodes["height"]["once"]
    assert not nodes["lit"]["once"]
    assert nodes["lit"]["ms"] >= 0


def test_results_written_before_a_damaged_capture_are_complete(
    run_writing: Command, captures: Path, tmp_path: Path
) -> None:
    damaged, out = captures / "b" / "led3.png", tmp_path / "out"
    damaged.write_bytes(damaged.read_bytes()[:200])
    assert str(damaged) in one_line(run_writing("--quiet"))
    assert [f.name for f in out.iterdir()] == ["a"]
    assert sorted(f.name for f in (out / "a").iterdir()) == sorted(
        ["height.npy", "height.tiff", "result.json", "shadow.png"]
    )


def test_a_capture_of_another_size_is_refused_before_anything_is_written(
    run_writing: Command, height_file: str, tmp_path: Path
) -> None:
    np.save(height_file, np.zeros((24, 31), np.float32))
    message = one_line(run_writing())
    assert "columns of pixels in" in message
    assert "frames.image" in message
    assert "height.read_height" in message
    assert not (tmp_path / "out").exists()


def test_an_unwritable_folder_is_the_users_error(run_writing: Command, height_file: str) -> None:
    assert "cannot be written" in one_line(run_writing("--quiet", out=f"{height_file}/out"))


def test_a_node_that_fails_is_exit_code_1_and_one_line(about: Command) -> None:
    message = one_line(about("run", lit_by("failing")), code=1)
    assert "node 'light' (failing) failed: RuntimeError: a careless node" in message


class Mute(BaseException):
    """A base exception whose message cannot be read."""

    def __str__(self) -> str:
        raise ValueError


def failing(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Have the engine fail as it reads a graph."""

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("tactograph.graph.files.read_graph.read_graph", fail)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (RuntimeError("two\nlines"), "internal error: RuntimeError: two lines"),
        (Mute(), "internal error: Mute: its message cannot be read (ValueError)"),
        (BrokenPipeError("a worker's"), "internal error: BrokenPipeError: a worker's"),
        (MemoryError(), "memory"),
    ],
)
def test_an_error_of_the_engine_is_exit_code_1_and_one_line(
    tactograph: Command, monkeypatch: pytest.MonkeyPatch, error: BaseException, message: str
) -> None:
    monkeypatch.delenv("TACTOGRAPH_TRACEBACK", raising=False)
    failing(monkeypatch, error)
    assert message in one_line(tactograph("check", "paper"), code=1)


def test_ctrl_c_says_how_to_continue(tactograph: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    failing(monkeypatch, KeyboardInterrupt())
    done = tactograph("check", "paper")
    assert done.code == 130
    assert done.err.strip() == command.STOPPED_MESSAGE


def test_a_full_disk_is_named_in_the_error(
    tactograph: Command, about: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    message = one_line(about("run", lit_by("crowded")))
    assert "node 'light' (crowded): /tmp/x: No space left on device; make room, or set" in message
    failing(monkeypatch, OSError(errno.ENOSPC, "No space left on device", "/tmp/x"))
    message = one_line(tactograph("check", "paper"))
    assert "tactograph: /tmp/x: No space left on device; make room, or set TMPDIR" in message


def test_a_file_of_another_user_is_named_in_the_error(
    tactograph: Command, about: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = about("run", lit_by("forbidden"))
    assert done.code == 2
    assert "node 'light' (forbidden): /tmp/x: Permission denied" in one_line(done)
    failing(monkeypatch, PermissionError(errno.EACCES, "Permission denied", "/tmp/x"))
    done = tactograph("check", "paper")
    assert (done.code, one_line(done).strip()) == (2, "tactograph: /tmp/x: Permission denied")


@pytest.mark.slow
@each("name", shipped_names())
def test_each_shipped_graph_is_found_verified_explained_and_resolved(
    tactograph: Command, write: Write, name: str
) -> None:
    """Resolved, it is plain YAML of the same graph."""
    graph = read_graph(name)
    assert graph.name == name
    assert graph.title
    checked = tactograph("check", name)
    assert checked.code == 0, checked.err
    assert "nothing wrong" in checked.out
    explained = tactograph("explain", name, "--backend", "numpy")
    assert explained.code == 0, explained.err
    assert graph.hash in explained.out
    done = tactograph("resolve", name)
    assert done.code == 0, done.err
    assert not re.search("^extends:", done.out, re.MULTILINE)
    resolved = read_graph(write(done.out))
    assert resolved.hash == graph.hash
    assert resolved.as_dict() == graph.as_dict()


@pytest.mark.parametrize(
    "value", ["no", "'1e-3'", "1e-3", ".inf", "'null'", "'0x10'", "'2020-01-01'", "' x'", "'#'",
              "[1, '2', {a: null}]", "'%'", '"a\\nb"', '"\\u00e9"', "'&a'", "123456789012345678901"]
)  # fmt: skip
def test_resolving_keeps_values_as_they_were(tactograph: Command, write: Write, value: str) -> None:
    file = write(SLOPES.replace("mm: 0.1", f"mm: {value}"))
    resolved = write(tactograph("resolve", file).out, "again.yaml")
    assert read_graph(resolved).nodes == read_graph(file).nodes
    assert read_graph(resolved).hash == read_graph(file).hash


def test_check_lists_needed_params_written_paths_and_unused_nodes(about: Command) -> None:
    text = SLOPES.replace("params:", "params:\n  spare: {kind: text}\n  more: {kind: text}")
    text = text.replace("{op: height_slopes", "{backend: opencl, op: height_slopes")
    done = about("check", text.replace("height: again", "height: height"))
    assert done.code == 0, done.err
    assert "not used by any output: again" in done.out
    assert "\nparams that no node reads: spare, more\n" in done.out
    assert "needed; a height map" in done.out
    assert "writes: save.folder to $out" in about("check", WRITING).out


def test_check_looks_at_nodes_that_nothing_reads(tactograph: Command, write: Write) -> None:
    spare = "  spare: {op: height_slopes, in: {height: again, pixel: pixel}}\n"
    wrong = "  wrong: {op: integrate_dct, in: {slope: again, pixel: pixel}}\n"
    checked = tactograph("check", write(SLOPES.replace("outputs:", f"{spare}outputs:")))
    assert "not used by any output: spare\n" in checked.out
    file = write(SLOPES.replace("outputs:", f"{wrong}outputs:"))
    assert "nodes.wrong.in.slope: 'slope' of integrate_dct wants" in one_line(
        tactograph("check", file)
    )


def test_check_blames_no_graph_for_inherited_params(tactograph: Command, write: Write) -> None:
    """A param that a graph declares once more is not reported for it either."""
    spare = "  spare: {kind: text}\n"
    text = SLOPES.replace("params:\n", f"params:\n{spare}")
    base = write(text + "variants:\n  wide:\n    params: {more: {kind: text}}\n")
    further = write(f"format: 1\nextends: graph.yaml\nparams:\n{spare}", "further.yaml")
    assert "no node reads: spare\n" in tactograph("check", base).out
    assert "no node reads: more\n" in tactograph("check", f"{base}/wide").out
    assert "no node reads" not in tactograph("check", further).out


def test_check_looks_into_the_variants_of_a_file(tactograph: Command, write: Write) -> None:
    variant = "variants:\n  wide: {patch: [{set: pixel, with: {mm: 0.2}}]}\n"
    assert "variant wide: nothing wrong\n" in tactograph("check", write(SLOPES + variant)).out
    wrong = write(SLOPES + variant + "  far: {patch: [{set: pixle, with: {mm: 0.2}}]}\n")
    done = tactograph("check", wrong)
    assert done.code == 2
    assert f"{wrong}:14:17: variants.far.patch[0]: set: there is no node 'pixle'" in done.err


def test_check_names_groups_that_nothing_uses_and_nodes_that_no_use_needs(about: Command) -> None:
    text = """
format: 1
groups:
  back:
    inputs: {height: {}}
    nodes:
      slope: {op: height_slopes, in: {height: height, pixel: size}}
      size:  {op: pixel_size, with: {mm: 0.1}}
      raw:   {op: integrate_dct, in: {slope: slope.slope, pixel: size}}
      idle:  {op: rest_at_border, in: {height: raw}}
      flat:  {op: rest_at_border, in: {height: raw}}
    outputs: {height: raw}
  spare:
    nodes: {size: {op: pixel_size, with: {mm: 0.1}}}
nodes:
  shape: {op: shape_ball, with: {width_px: 32, height_px: 24}}
  one:   {group: back, in: {height: shape.height}}
  two:   {group: back, in: {height: one.flat}}
outputs: {height: two.height}
"""
    done = about("check", text)
    unused = [line for line in done.out.splitlines() if line.startswith("not used")]
    assert unused == [
        "not used by any output: one.idle",
        "not used by any output: two.idle",
        "not used by any node: the group spare",
    ]


def test_check_blames_no_graph_for_groups_of_files_that_it_extends(tactograph: Command) -> None:
    done = tactograph("check", "reconstruct", "--with", "stream")
    assert done.code == 0
    assert "the group" not in done.out


def test_check_accepts_a_param_without_a_value(about: Command) -> None:
    text = SLOPES.replace("params:", "params:\n  leds: {kind: text}\n  crop: {kind: numbers}")
    text = text.replace("{file: $file}", "{file: $file, crop: $crop}")
    text = text.replace("outputs:", "  more: {op: read_capture, with: {folder: x, lights: $leds}}\n"
                        "outputs: {more: more.image}\n#")  # fmt: skip
    for name in ("check", "explain", "draw"):
        done = about(name, text)
        assert done.code == 0, done.err


def test_explain_lists_boxes_and_with_all_nodes(tactograph: Command) -> None:
    boxes = tactograph("explain", "reconstruct", "--backend", "numpy").out
    nodes = tactograph("explain", "reconstruct", "--backend", "numpy", "--all").out
    assert "4 x rough_pass: 31 nodes" in boxes
    assert "rough.2.matt" not in boxes
    assert "rough.2.matt" in nodes


def test_explain_says_why_each_step_runs_where_it_does_and_what_is_left_out(about: Command) -> None:
    done = about("explain", SLOPES)
    assert done.code == 0, done.err
    for words in ("preferred", "has no opencl kernel", "once", "transfers between host and device"):
        assert words in done.out
    assert "shared by all readers" not in done.out
    every = about("explain", SLOPES, "--all").out
    assert "upload" in every
    assert "shared by all readers" in every
    out = about("explain", STREAM.replace("cal.dark}}", "cal.dark}, neutral: true}")).out
    assert "light: taken out; its readers read frames.image" in out
    assert "cal: not run; nothing reads it" in out


def test_explain_prints_brackets_unchanged(about: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    why = "no OpenCL device works (pip install 'tactograph[vkfft]')"
    monkeypatch.setattr(
        "tactograph.graph.backends.opencl.choose_device", lambda *_, **__: (None, why)
    )
    assert "tactograph[vkfft]" in " ".join(about("explain", SLOPES).out.split())


def test_draw_writes_a_file(tactograph: Command, tmp_path: Path) -> None:
    file = tmp_path / "plan.svg"
    done = tactograph("draw", "paper", "--out", file)
    assert (done.code, done.out) == (0, ""), done.err
    assert file.read_text().startswith("<svg ")


def test_nodes_lists_every_node_and_shows_the_page_of_one(tactograph: Command) -> None:
    done = tactograph("nodes")
    assert done.code == 0
    assert "flat_field " in done.out
    page = tactograph("nodes", "flat_field").out
    for words in (
        "`image` (float32 K x H x W [1])",
        "default 0.02, above 0",
        "`image` is passed on",
    ):
        assert words in page


def test_graphs_lists_shipped_graphs_with_their_titles_by_folder(tactograph: Command) -> None:
    lines = tactograph("graphs").out.splitlines()
    headings = [line.removesuffix(":") for line in lines if not line.startswith(" ")]
    folders = ["calibrate", "reconstruct", "simulate"]
    assert headings[0] == "to start with"
    assert [line.split()[0] for line in lines[1:4]] == [*FIRST_GRAPHS]
    assert headings[1 : len(folders) + 1] == folders
    assert headings[-1] == "overlays, for --with"
    listed = {line.split()[0]: line.split(None, 1)[1] for line in lines if line.startswith(" ")}
    assert listed.keys() == {*shipped_names(), *shipped("overlays")}
    assert listed["paper"] == read_graph("paper").title
    assert listed["reconstruct_no_shadow"] == read_graph("reconstruct_no_shadow").title
    names = [line.split()[0] for line in tactograph("graphs", "BALL").out.splitlines()]
    assert names[:2] == ["calibrate:", "calibrate"]
    assert "reconstruct" not in names
    assert "no graph has 'zebra'" in one_line(tactograph("graphs", "zebra"))


def test_a_node_parameter_written_as_a_param_is_refused_with_the_set_option(
    tactograph: Command,
) -> None:
    for words in (("--threshold", "3"), ("threshold=3",)):
        assert "--set shadow.threshold=VALUE" in one_line(tactograph("run", "paper", *words))


def test_help_lists_the_parameters_of_nodes_only_with_all(tactograph: Command) -> None:
    brief, full = (tactograph("run", "paper", *more, "--help").out for more in ((), ("--all",)))
    assert "capture=PATH" in brief
    assert "shadow.threshold=" in full
    assert "shadow.threshold=" not in brief


def test_check_lists_all_errors_of_a_pass(tactograph: Command, write: Write) -> None:
    text = SLOPES.replace("mm: 0.1", "mm: -1").replace("{file: $file}", "{file: $file, fiel: 3}")
    done = tactograph("check", write(text))
    assert (done.code, len(done.err.splitlines())) == (2, 2)
    assert "pixel.with.mm" in done.err
    assert "did you mean 'file'?" in done.err
    assert "1 more: 'tactograph check' lists them" in one_line(
        tactograph("run", write(text), "file=x")
    )


def test_check_lists_the_errors_of_all_variants(tactograph: Command, write: Write) -> None:
    for changes, errors in (
        (("{neutral: refine}", "{remove: shdow}"), ("no node 'refine'", "did you mean 'shadow'")),
        (
            ("{set: shadow, with: {treshold: 3}}", "{set: shadow, with: {threshold: -3}}"),
            ("did you mean 'threshold'", "should be greater than 0"),
        ),
    ):
        variants = "".join(f"  v{k}: {{patch: [{c}]}}\n" for k, c in enumerate(changes))
        done = tactograph("check", write(f"format: 1\nbase: paper\nvariants:\n{variants}"))
        assert [error in done.err for error in errors] == [True, True]


def test_warnings_of_an_item_that_fails_come_before_its_error(about: Command) -> None:
    fails = "  seen: {op: noticed, in: {image: light}}\n  save: {op: failing, in: {image: seen}}"
    text = STREAM.replace("  save:   {op: noted, in: {image: light}}", fails)
    done = about("run", text.replace("light: light,", "save: save,"), "--quiet")
    assert [line.partition(":")[0] for line in done.err.splitlines()] == ["warning", "tactograph"]


def test_devices_lists_every_device_with_its_verdict(tactograph: Command) -> None:
    done = tactograph("devices", "--require")
    assert done.code == 0, done.err
    assert "works" in done.out
    assert "in use by default: " in done.out


@pytest.mark.parametrize(
    ("patched", "value", "reason"),
    [
        ("_handles", lambda: iter(()), f"no OpenCL device works here; {how_to_get_one()}"),
        ("_run_probe", lambda _: "gave wrong numbers", "gave wrong numbers"),
    ],
    ids=["no device", "a device that computes wrongly"],
)
def test_devices_reports_that_no_device_works(
    tactograph: Command, monkeypatch: pytest.MonkeyPatch, patched: str, value: object, reason: str
) -> None:
    monkeypatch.setattr(f"tactograph.graph.backends.devices.{patched}", value)
    done = tactograph("devices")
    assert done.code == 0
    assert "graphs run on the host: " in done.out
    assert ("bad  " in done.out) == (patched == "_run_probe")
    assert reason in done.out
    assert reason in one_line(tactograph("devices", "--require"))


def test_schema_prints_a_schema(tactograph: Command) -> None:
    done = tactograph("schema")
    assert done.code == 0
    jsonschema.Draft202012Validator.check_schema(json.loads(done.out))


def test_device_takes_part_of_a_name(about: Command, device: OpenCL) -> None:
    done = about("explain", SLOPES, "--device", device.name[:8].upper())
    assert done.code == 0, done.err


def test_the_process_ends_with_the_code_and_the_line() -> None:
    done = python("-m", "tactograph.graph.command", "run", "nowhere.yaml", code=2)
    assert done.stdout == ""
    assert done.stderr == "tactograph: nowhere.yaml: there is no such graph file\n"


def printing_to(place: int) -> subprocess.CompletedProcess[str]:
    """A command that prints more than a buffer holds, to an open file."""
    words = [sys.executable, "-m", "tactograph.graph.command", "graphs"]
    return subprocess.run(words, stdout=place, stderr=subprocess.PIPE, text=True, check=False)


def test_a_command_whose_output_nobody_reads_ends_silently_with_code_141() -> None:
    read, write = os.pipe()
    os.close(read)
    done = printing_to(write)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


def test_output_that_cannot_be_printed_gives_one_line() -> None:
    with Path("/dev/full").open("w") as full:
        done = printing_to(full.fileno())
    assert done.returncode == 2
    assert done.stderr == ("tactograph: cannot write to standard output: No space left on device\n")


def after_help(statement: str, **more: str) -> str:
    """The last line of a process that shows the help and then runs a statement."""
    code = (
        "import sys, tactograph.graph.command as c\n"
        "sys.argv = ['tactograph', '--help']\n"
        f"try: c.main()\nexcept SystemExit: pass\n{statement}"
    )
    return python("-c", code, **more).stdout.splitlines()[-1]


def test_help_loads_neither_numpy_nor_the_planner() -> None:
    slow = {"networkx", "pydantic", "pyopencl", "cv2"}
    assert after_help(f"print(sorted({slow} & set(sys.modules)))") == "[]"


def test_an_escape_in_a_graph_file_or_its_name_does_not_reach_the_terminal(about: Command) -> None:
    text = SLOPES.replace("Height to slopes and back", '"\\e]0;owned\\a"')
    assert "control characters are not allowed" in one_line(about("check", text))
    message = one_line(about("check", SLOPES, "--with", "\x1b]0;owned\x07.yaml"))
    assert "\x1b" not in message
    assert r"\x1b]0;owned\x07.yaml" in message


def test_results_are_not_written_into_the_captures(run_writing: Command, captures: Path) -> None:
    before = sorted(captures.rglob("*"))
    assert "is what capture=" in one_line(run_writing(out=f"{captures}/a/.."))
    assert sorted(captures.rglob("*")) == before


def test_a_tilde_is_the_user_s_home(
    run_writing: Command, captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    done = run_writing(capture=f"~/{captures.relative_to(tmp_path)}", out="~/results")
    assert done.code == 0, done.err
    assert f"written to {tmp_path / 'results'}" in done.out
    assert (tmp_path / "results").is_dir()
    assert not (tmp_path / "~").exists()


def test_a_run_that_writes_nothing_does_not_report_written_results(
    run_writing: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tactograph.graph.commands.run._run_items", lambda *_: 0)
    assert "written" not in run_writing().out


def test_the_backend_set_for_matplotlib_is_ignored() -> None:
    statement = "import matplotlib; print(matplotlib.rcParams['backend'])"
    assert after_help(statement, MPLBACKEND="nonsense") == "agg"


@pytest.mark.parametrize(
    ("name", "message"),
    [("capture", "no such folder"), ("file", "no such"), ("out", "cannot be written")],
)
def test_a_loop_of_links_is_refused_as_a_place(
    run_writing: Command, tmp_path: Path, name: str, message: str
) -> None:
    link, back = tmp_path / "there", tmp_path / "back"
    link.symlink_to(back)
    back.symlink_to(link)
    error = one_line(run_writing("--quiet", **{name: link}))
    assert str(link) in error
    assert message in error


def test_a_stream_without_an_item_fails(about: Command) -> None:
    message = one_line(about("run", STREAM, "count=0", "--backend", "numpy"))
    assert "ended before the first item" in message


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_a_stream_also_while_python_frees_an_object(
    about: Command, toys: list[str], monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    class Freed:
        def __del__(self) -> None:
            signal.raise_signal(number)

    def summary(*_: object, **__: object) -> str:
        Freed()
        return "one item"

    monkeypatch.setattr("tactograph.graph.commands.run._summary", summary)
    text = STREAM.replace("op: touches, with: {count: $count}", "op: endless_touches")
    done = about("run", text, "--backend", "numpy")
    assert (done.code, done.err.strip()) == (0, "stopped")
    assert [call for call in toys if "noted" in call] == ["noted 1"]


WAVERS = "  seen:   {op: wavers, in: {image: frames.image}}"


@pytest.mark.parametrize(("forgotten_s", "lines"), [(10.0, 1), (-1.0, 3)])
def test_a_warning_that_comes_and_goes_is_printed_again_only_after_a_while(
    about: Command, monkeypatch: pytest.MonkeyPatch, forgotten_s: float, lines: int
) -> None:
    monkeypatch.setattr("tactograph.graph.commands.run.WARNING_INTERVAL_S", forgotten_s)
    text = STREAM.replace("touches, with: {count: $count}", "endless_touches, with: {stop_at: 5}")
    text = text.replace("  save:   {op: noted, in: {image: light}}", WAVERS)
    done = about("run", text.replace("light: light,", "seen: seen,"), "--quiet")
    assert done.err.count("parts are dark") == lines


def test_an_endless_stream_prints_an_item_only_if_more_than_numbers_of_its_sentence_changed(
    about: Command,
) -> None:
    text = STREAM.replace("touches, with: {count: $count}", "endless_touches, with: {stop_at: 5}")
    words = "  words:  {op: pressed_words, in: {image: frames.image}}"
    text = text.replace("  save:   {op: noted, in: {image: light}}", words)
    done = about("run", text.replace("light: light,", "words: words,"), "--backend", "numpy")
    printed = [line.partition(" (")[0] for line in done.out.splitlines() if "touch" in line]
    assert printed == ["1 touch1: nothing of 1.0", "3 touch3: a touch of 3.0"]
