"""Tables: means, intervals, the best value, and every format."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph.compare.compare import Row
from tactograph.graph.compare.tables import (
    columns,
    is_best,
    make_lines,
    over_all,
    print_table,
    what_is_better,
    write_tables,
)
from tactograph.graph.errors import InputError
from tactograph.graph.show.figures import estimate


def row(variant: str, capture: str = "a", seed: int | None = None, **figures: float) -> Row:
    took = {"step": 2.0}
    return Row(variant, capture, "numpy", "0" * 16, figures, took, {"step": "numpy"}, seed=seed)


def test_the_interval_is_students() -> None:
    from scipy import stats  # seconds, for each worker that collects this file

    values = [1.0, 2.0, 4.0, 4.5]
    interval = estimate(values)
    wanted = stats.t.interval(0.95, 3, np.mean(values), stats.sem(values))
    assert (interval.low, interval.high) == pytest.approx(wanted)
    assert estimate([3.0]).half == 0
    assert estimate([2.0, 2.0]).half == 0


def test_the_interval_contains_the_mean_as_often_as_stated() -> None:
    rng = np.random.default_rng(1)
    intervals = [estimate(list(rng.normal(5, 2, 4))) for _ in range(2000)]
    assert np.mean([e.low <= 5 <= e.high for e in intervals]) == pytest.approx(0.95, abs=0.015)


def test_repeats_are_one_line() -> None:
    rows = [row("x", seed=s, error=float(s)) for s in range(3)] + [row("y", error=9.0)]
    first, second = make_lines(rows)
    assert (first.figures["error"].mean, first.figures["error"].count) == (1.0, 3)
    assert second.figures["error"].count == 1


@pytest.mark.parametrize("name", ["shadow_iou", "recall", "shadow_precision/led1"])
def test_figures_for_which_higher_is_better(name: str) -> None:
    assert what_is_better(name) == "higher"
    assert what_is_better("rmse_px") == "nearer to zero"


def test_a_verdict_on_the_input_is_no_score() -> None:
    lines = make_lines([row("x", trust=0.97, check_rest=0.1), row("y", trust=0.4, check_rest=0.9)])
    assert not any(is_best(x, name, lines) for x in lines for name in ("trust", "check_rest"))


def test_the_best_value_is_the_best_of_its_capture() -> None:
    figures = (("x", "a", -3.0, 0.5), ("y", "a", 2.0, 0.4), ("x", "b", 0.1, 0.9))
    lines = make_lines([row(v, c, error=e, iou=iou, same=1.0) for v, c, e, iou in figures])
    assert [is_best(line, "error", lines) for line in lines] == [False, True, False]
    assert [is_best(line, "iou", lines) for line in lines] == [True, False, False]
    assert not any(is_best(line, "same", lines) for line in lines)


def test_the_mean_over_captures_leaves_out_variants_that_failed() -> None:
    rows = [row(v, c, error=e) for v, c, e in (("x", "a", 1.0), ("x", "b", 3.0), ("y", "a", 1.0))]
    rows.append(Row("y", "b", "numpy", "", error="broken"))
    (mean,) = over_all(make_lines(rows))
    assert (mean.variant, mean.figures["error"].mean) == ("x", 2.0)
    assert over_all(make_lines([row("x")])) == []


def test_details_are_only_in_the_tables_for_programs(tmp_path: Path) -> None:
    rows = [Row("x_1", "a", "numpy", "h", {"iou": 0.5, "iou/led1": 0.25}, sweep={"n.p": 0.1})]
    assert columns(make_lines(rows)) == ["iou"]
    write_tables(rows, tmp_path)
    (line,) = csv.DictReader((tmp_path / "table.csv").open())
    assert (line["iou/led1"], line["n.p"], line["hash"]) == ("0.25", "0.1", "h")
    assert json.loads((tmp_path / "table.json").read_text())[0]["figures"]["iou/led1"] == 0.25
    assert "led1" not in (tmp_path / "table.md").read_text()


def test_markdown_and_latex_mark_the_best_and_escape(tmp_path: Path) -> None:
    write_tables([row("a_b", error=1.0), row("c", error=2.0), row("c", "z", error=2.0)], tmp_path)
    markdown = (tmp_path / "table.md").read_text().splitlines()
    assert len({text.count("|") for text in markdown}) == 1
    assert "| **1** |" in markdown[2]
    latex = (tmp_path / "table.tex").read_text()
    assert r"a\_b" in latex
    assert r"\textbf{1}" in latex
    assert latex.count(r"\midrule") == 3
    assert {text.count("&") for text in latex.splitlines() if "&" in text} == {4}


def test_tables_of_papers_hold_the_wanted_figures(tmp_path: Path) -> None:
    write_tables([row("x", error=1.0, iou=0.5)], tmp_path, wanted=["iou"])
    assert "error" not in (tmp_path / "table.md").read_text() + (tmp_path / "table.tex").read_text()
    assert "error" in (tmp_path / "table.csv").read_text()


def test_repeats_have_intervals_in_every_table(tmp_path: Path) -> None:
    write_tables([row("x", seed=s, error=float(s)) for s in (1, 2, 3)], tmp_path)
    (line,) = csv.DictReader((tmp_path / "table.csv").open())
    assert float(line["error_low"]) < 2 < float(line["error_high"])
    assert line["runs"] == "3"
    assert "2 ± 2.5" in (tmp_path / "table.md").read_text()
    assert r"2 $\pm$ 2.5" in (tmp_path / "table.tex").read_text()


def test_errors_of_both_signs_do_not_cancel_in_the_mean_over_captures() -> None:
    near, far = (-6.0, 5.0, -4.0), (7.0, 7.0, 7.0)
    rows = [row("near", c, error=e) for c, e in zip("abc", near, strict=True)]
    rows += [row("cancels", c, error=e) for c, e in zip("abc", (-9.0, 8.0, 1.0), strict=True)]
    rows += [row("far", c, error=e, iou=0.5) for c, e in zip("abc", far, strict=True)]
    means = over_all(make_lines(rows))
    assert [mean.figures["error"].mean for mean in means] == [5.0, 6.0, 7.0]
    assert [is_best(mean, "error", means) for mean in means] == [True, False, False]
    assert {mean.capture for mean in means} == {"mean of 3 captures, signs left out"}


def test_a_figure_is_judged_by_its_own_aim() -> None:
    one = row("x", in_90_percent_band=88, stated_over_actual=2, contacts=0, peak_px=1)
    two = row("y", in_90_percent_band=40, stated_over_actual=0.8, contacts=1, peak_px=2)
    lines = make_lines([one, two])
    assert [is_best(line, "in_90_percent_band", lines) for line in lines] == [True, False]
    assert [is_best(line, "stated_over_actual", lines) for line in lines] == [False, True]
    assert not any(is_best(line, n, lines) for line in lines for n in ("contacts", "peak_px"))


def test_the_time_of_a_single_run_is_never_the_best() -> None:
    def timed(variant: str, ms: float, seed: int) -> Row:
        return Row(variant, "a", "numpy", "", {}, {"step": ms}, seed=seed)

    single = make_lines([timed("x", 1.0, 1), timed("y", 9.0, 1)])
    assert not any(is_best(line, "ms", single) for line in single)
    runs = [(v, ms, seed) for v, ms in (("x", 1.0), ("y", 9.0)) for seed in (1, 2)]
    often = make_lines([timed(*run) for run in runs])
    assert [is_best(line, "ms", often) for line in often] == [True, False]


def shown_at(width: int, rows: list[Row], wanted: Sequence[str] = ()) -> list[str]:
    printed: list[str] = []
    print_table(rows, printed.append, width, wanted)
    return "\n".join(printed).splitlines()


def test_only_the_requested_figures_are_shown() -> None:
    rows = [row(v, error=1.0, iou=0.5, **{"iou/led1": 0.25}) for v in ("one", "two")]
    lines = shown_at(200, rows, ["iou/led1", "error"])
    assert [line.split()[-2:] for line in lines[-2:]] == [["0.25", "1"]] * 2
    with pytest.raises(InputError, match="no figure 'eror'; did you mean 'error'"):
        shown_at(200, rows, ["eror"])


@pytest.mark.parametrize("width", [200, 60, 40, 10])
def test_no_number_is_truncated_in_a_narrow_terminal(width: int) -> None:
    figures = {f"mean_error_{n}_percent": 0.123456 + n for n in range(5)}
    rows = [row(v, **figures) for v in ("first_variant", "second_variant")]
    lines = shown_at(width, rows)
    numbers = [word for line in lines for word in line.split() if "." in word]
    assert sorted(numbers) == sorted(2 * [f"{figure:.4g}" for figure in figures.values()])


def test_a_table_too_wide_has_a_column_for_each_run() -> None:
    figures = {f"mean_error_{n}_percent": 1.0 for n in range(9)}
    lines = shown_at(60, [row(v, **figures) for v in ("first", "second", "third")])
    assert lines[1].split() == ["variant", "first", "second", "third"]
    assert lines[3].split() == ["mean", "error", "0", "percent", "1", "1", "1"]
    assert max(map(len, lines)) <= 60


def test_the_terminal_table_explains_the_star() -> None:
    rows = [row("x", error=1.0, iou=0.5), row("y", error=2.0, iou=0.4)]
    assert shown_at(80, rows)[-1] == "* best of its capture: highest iou; else nearest to zero"
    assert "*" not in "".join(shown_at(80, rows[:1]))


def test_the_terminal_shows_failures_once() -> None:
    rows = [row("x", error=1.0), Row("y", "a", "numpy", "", error="no light", sweep={"n.p": 2})]
    assert shown_at(120, rows)[-1] == "failed: y on a n.p=2: no light"
    assert "\n".join(shown_at(120, rows)).count("failed") == 1
    rows += [Row("y", capture, "numpy", "", error="no light") for capture in ("b", "c", "d")]
    assert shown_at(120, rows)[-1] == "failed: y on a n.p=2 and 3 more: no light"
