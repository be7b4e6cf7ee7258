"""Lines between host and controller: what is damaged never passes, what is whole always does."""

from binascii import crc_hqx

import pytest
from hypothesis import given, strategies as st

from tactograph.rings.live.firmware.protocol import Lines, crc16, frame, unframe
from tactograph.rings.live.nodes.controller import _led_line as host

BODIES = st.text(
    st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="$*"), max_size=100
)


def test_the_checksum_is_the_one_documented() -> None:
    # The check value that catalogues of checksums give for CRC-16/CCITT-FALSE.
    assert crc16(b"123456789") == 0x29B1


@given(BODIES)
def test_the_checksum_is_that_of_the_standard_library(body: str) -> None:
    assert crc16(body.encode()) == crc_hqx(body.encode(), 0xFFFF)


@given(body=BODIES)
def test_a_whole_line_is_understood(body: str) -> None:
    assert unframe(frame(body)[:-1]) == body


@given(body=BODIES, data=st.data())
def test_a_line_with_one_altered_byte_is_refused(body: str, data: st.DataObject) -> None:
    line = frame(body)[:-1]
    place = data.draw(st.integers(0, len(line) - 1))
    other = data.draw(st.integers(0, 255).filter(lambda byte: byte != line[place]))
    altered = line[:place] + bytes([other]) + line[place + 1 :]
    assert all(unframe(part) is None for part in altered.split(b"\n"))


@given(body=BODIES, data=st.data())
def test_a_line_cut_off_is_refused(body: str, data: st.DataObject) -> None:
    line = frame(body)[:-1]
    assert unframe(line[: data.draw(st.integers(0, len(line) - 1))]) is None


@given(noise=st.binary(max_size=1000), sizes=st.lists(st.integers(1, 40)))
def test_after_any_bytes_the_next_line_is_understood(noise: bytes, sizes: list[int]) -> None:
    lines = Lines()
    rest = noise + b"\n"
    for size in sizes:
        lines.feed(rest[:size])
        rest = rest[size:]
    lines.feed(rest)
    assert lines.feed(frame("7 ok t=12")) == ["7 ok t=12"]


@pytest.mark.parametrize("word", ["", "-1", "+1", " 1", "1_0", "1e3", "1.0", "9" * 330, "300", "٣"])
def test_a_number_outside_its_range_or_in_another_spelling_is_none(word: str) -> None:
    with pytest.raises(ValueError, match="whole number from 0 to 255"):
        host.whole_number(word, 0, 255)


def test_a_number_within_its_range_is_read() -> None:
    assert [host.whole_number(word, -1) for word in ("-1", "0", "1" + "0" * 15)] == [-1, 0, 10**15]


@given(st.one_of(st.text(), BODIES, st.from_regex(r"[0-9]{1,3} (ok|no)( [a-z]*=?[0-9]*)*")))
def test_any_text_is_an_answer_an_event_or_nothing(body: str) -> None:
    assert isinstance(host.parse(body), host.Answer | host.Event | None)


def test_answers_and_events_are_distinguished() -> None:
    assert host.parse("3 ok") == host.Answer(3, {})
    assert host.parse("3 ok t=5 state=off") == host.Answer(3, {"t": "5", "state": "off"})
    assert host.parse("3 no such LED") == host.Answer(3, {}, "such LED")
    assert host.parse("! cycle 4 99") == host.Event("cycle", ("4", "99"))
    for nonsense in ("", "!", "ok", "3", "x ok", "-3 ok", "3 yes", "3 ok t5"):
        assert host.parse(nonsense) is None
