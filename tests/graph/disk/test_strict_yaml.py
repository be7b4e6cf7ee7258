"""YAML without surprises."""

import math
import time
from pathlib import Path
from unittest.mock import Mock

import pytest
from hypothesis import given, settings, strategies as st

from tactograph.graph import GraphError, InputError
from tactograph.graph.disk import disk_cache, strict_yaml
from tactograph.graph.disk.strict_yaml import MAX_BYTES, Document, dotted


def refusal(text: str) -> str:
    with pytest.raises(GraphError) as caught:
        Document.parse(text, "g.yaml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("no", "no"), ("yes", "yes"), ("on", "on"), ("off", "off"), ("y", "y"),
        ("true", True), ("False", False), ("null", None), ("~", None), ("", None),
        ("1e-3", 0.001), ("1E5", 1e5), ("1.", 1.0), (".5", 0.5), ("-.inf", -math.inf),
        ("010", 10), ("0o10", 8), ("0x1F", 31), ("0b11", 3), ("1_000", 1000), ("+7", 7),
        ("1:30", "1:30"), ("2020-01-01", "2020-01-01"), ("=", "="), ("0x", "0x"),
        ("12" * 100, int("12" * 100)), ("'5'", "5"), ("1.2.3", "1.2.3"),
    ],
)  # fmt: skip
def test_a_scalar_means_what_it_looks_like(text: str, value: object) -> None:
    parsed = Document.parse(f"a: {text}", "g.yaml").data["a"]
    assert parsed == value
    assert type(parsed) is type(value)


@pytest.mark.parametrize("text", ["1e-3", "no", "0x1F", "2020-01-01", "", "true", "010"])
def test_a_value_on_the_command_line_means_the_same_as_in_a_file(text: str) -> None:
    assert Document.scalar(text) == Document.parse(f"a: {text}", "g.yaml").data["a"]


@pytest.mark.parametrize("text", ["1__0", "0_", "-_", "._5", "1__0.5", "9" * 5000])
def test_a_malformed_number_is_refused(text: str) -> None:
    message = refusal(f"a: {text}")
    assert message.startswith("g.yaml:1:4: a: '")
    assert message.endswith("is not a number")
    assert len(message) < 100
    with pytest.raises(InputError, match="is not a number"):
        Document.scalar(text)


@pytest.mark.parametrize(
    "text",
    [
        "a: !!python/object/apply:os.system [ls]", "a: !!python/name:os.system", "a: !local 5",
        "a: !!int foo", "a: !!int '5'", "a: !!bool maybe", "a: !!set {b}", "a: !foo {b: 1}",
        "a: !foo [1]", "!!int a: 1", "!!omap [a: 1]", "a: !!binary aGk=", "a: !!timestamp x",
    ],
)  # fmt: skip
def test_tags_are_refused(text: str) -> None:
    assert "the tag '" in refusal(text)


@pytest.mark.parametrize(
    "text",
    [
        "a: &x [1]\nb: *x", "a: &x 1", "&x a: 1", "a: &x b\n*x : 1", "a: &x [*x]", "a: &x {b: *x}",
        "a: &a [x,x,x,x]\nb: &b [*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b]\nd: [*c,*c,*c,*c]",
    ],
)  # fmt: skip
def test_anchors_and_aliases_are_refused(text: str) -> None:
    assert "anchors and aliases are not allowed" in refusal(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("%YAML 1.1\n---\na: no", "1:1: directives (%...) are not allowed; write plain YAML"),
        ("# x\n\n%TAG ! tag:x,2000:\n---\na: 1", "3:1: directives (%...) are not allowed"),
        ("%FOO\n", "1:1: directives (%...) are not allowed; write plain YAML"),
        ("<<: {a: 1}", "1:1: keys must be plain words"),
        ("? [a]\n: 1", "1:3: keys must be plain words"),
        ("a:\n  b: 1\n  b: 2", "3:3: a.b: duplicate key"),
    ],
)
def test_yaml_beyond_the_plain_subset_is_refused_at_its_place(text: str, message: str) -> None:
    assert refusal(text).startswith(f"g.yaml:{message}")


@pytest.mark.parametrize("text", ["", "# nothing", "\n\n"])
def test_an_empty_file_is_refused(text: str) -> None:
    assert refusal(text) == "g.yaml: the file is empty; a graph file starts with 'format: 1'"


@pytest.mark.parametrize(
    "text", ["a: " + "[" * 30, "[" * 30 + "]" * 30, "{a: " * 30 + "}" * 30, "[" * 2_000]
)
def test_deep_nesting_is_refused(text: str) -> None:
    assert "nested too deeply" in refusal(text) or "is not closed" in refusal(text)


def test_a_byte_order_mark_and_a_percent_sign_inside_do_no_harm() -> None:
    assert Document.parse("\ufeffa: 1", "g.yaml").data == {"a": 1}
    assert Document.parse("a: |\n  %b\nc: '%'", "g.yaml").data == {"a": "%b\n", "c": "%"}
    assert math.isnan(Document.parse("a: .nan", "g.yaml").data["a"])
    assert "unpaired surrogate" in refusal('a: "\\uD800"')


def test_a_file_that_is_too_large_is_refused_before_it_is_parsed(tmp_path: Path) -> None:
    file = tmp_path / "g.yaml"
    file.write_text("a: [" + "a," * MAX_BYTES + "]")
    started = time.perf_counter()
    with pytest.raises(GraphError, match="too large for a graph file"):
        Document.read(file)
    assert time.perf_counter() - started < 0.5


def test_a_large_binary_file_is_reported_as_not_text(tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    file.write_bytes(b"PK\x03\x04\x00\xff" * MAX_BYTES)
    with pytest.raises(GraphError, match="not a text file"):
        Document.read(file)


def test_a_binary_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "g.yaml"
    file.write_bytes(b"a: \xff")
    with pytest.raises(GraphError, match="byte 3 is not UTF-8"):
        Document.read(file)


def test_a_folder_is_no_graph_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        Document.read(tmp_path)


def test_every_value_knows_its_place() -> None:
    """A missing value has the place of its closest parent, and a path reads like code."""
    document = Document.parse("a:\n  b: [1,\n    {c: 2}]", "g.yaml")
    assert str(document.place(("a", "b", 1, "c"))) == "g.yaml:3:6: a.b[1].c"
    assert str(document.place(("a", "missing", "x"))) == "g.yaml:1:1: a.missing.x"
    assert dotted(("patch", 0, "with", "x")) == "patch[0].with.x"


TEXT = "a: [1, 2.5, .inf, {b: no, c: null}]\nd: {e: '1', f: [[0x10]]}\n"


def test_a_file_is_parsed_once_and_then_read_from_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, str(tmp_path / "cache"))
    file = tmp_path / "g.yaml"
    file.write_text(TEXT)
    first = Document.read(file)
    parsed = Mock(side_effect=strict_yaml._parsed)
    monkeypatch.setattr(strict_yaml, "_parsed", parsed)
    strict_yaml._parsed_once.cache_clear()
    assert Document.read(file) == first == Document.parse(TEXT, str(file))
    assert parsed.call_count == 1, "for the text that comes from no file"
    (cached,) = (tmp_path / "cache").rglob("*.cached")
    cached.write_bytes(b"damaged")
    strict_yaml._parsed_once.cache_clear()
    assert Document.read(file) == first
    assert parsed.call_count == 2
    file.write_text(TEXT.replace("no", "yes"))
    assert Document.read(file).data["a"][3]["b"] == "yes"


def test_a_number_with_more_digits_than_python_writes_is_read(tmp_path: Path) -> None:
    file = tmp_path / "g.yaml"
    file.write_text(f"a: 0x{'f' * 5000}")
    assert Document.read(file).data["a"] > 0


def test_a_wrong_file_is_refused_each_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, str(tmp_path / "cache"))
    file = tmp_path / "g.yaml"
    file.write_text("a: &b 1")
    for _ in range(2):
        with pytest.raises(GraphError, match=r"g\.yaml:1:4: a: anchors"):
            Document.read(file)


@settings(max_examples=200)
@given(st.text(max_size=200) | st.text("abn019:-[]{},&*!?|>%'\"#_. \n\t", max_size=60))
def test_any_text_is_a_document_or_a_graph_error(text: str) -> None:
    try:
        assert isinstance(Document.parse(text, "g.yaml"), Document)
    except GraphError as error:
        assert str(error).startswith("g.yaml")  # noqa: PT017
        assert "\n" not in str(error)  # noqa: PT017


@given(st.text(alphabet="0123456789+-_.eExXoObBinfNaA", max_size=12))
def test_any_value_on_the_command_line_is_read_or_refused(text: str) -> None:
    try:
        assert isinstance(Document.scalar(text), str | int | float | None)
    except InputError as error:
        assert "is not a number" in str(error)  # noqa: PT017
