"""The pool lends buffers, takes them back, and lends them in the same order."""

import pytest
from hypothesis import given, strategies as st

from tactograph.graph.backends.buffer_pool import BufferPool


class ExhaustedError(Exception):
    """The device has no more memory."""


@pytest.fixture
def pool() -> BufferPool:
    return BufferPool(bytearray, ExhaustedError)


def test_a_buffer_is_reused_only_after_its_last_reference_is_gone(pool: BufferPool) -> None:
    first = pool.take(100)
    number = first.number
    assert pool.take(100).number != number
    del first
    assert pool.take(100).number == number
    assert pool.count == 2


@given(st.lists(st.tuples(st.sampled_from([64, 100, 5000]), st.integers(0, 5)), max_size=20))
def test_the_same_steps_get_the_same_buffers_in_any_order_of_release(
    steps: list[tuple[int, int]],
) -> None:
    """Each step takes a buffer and returns it some steps later, the same for all items."""
    pool = BufferPool(bytearray, ExhaustedError)

    def item() -> list[int]:
        held: dict[int, object] = {}
        taken = []
        for at, (nbytes, stays) in enumerate(steps):
            memory = pool.take(nbytes)
            taken.append(memory.number)
            held[at + stays] = (held.get(at + stays), memory)
            held.pop(at, None)
        return taken

    assert item() == item() == item()


@given(st.integers(1, 2**40))
def test_a_buffer_is_large_enough_and_at_most_a_sixteenth_larger(nbytes: int) -> None:
    asked: list[int] = []
    BufferPool(lambda size: asked.append(size), ExhaustedError).take(nbytes)
    assert nbytes <= asked[0] <= max(nbytes * 17 / 16, nbytes + 1)


def test_a_full_device_releases_free_buffers_before_it_fails() -> None:
    allocated: list[int] = []

    def allocate(nbytes: int) -> bytearray:
        if pool.nbytes + nbytes > 300:
            raise ExhaustedError
        allocated.append(nbytes)
        return bytearray(nbytes)

    pool = BufferPool(allocate, ExhaustedError)
    pool.take(128)
    large = pool.take(256)
    assert allocated == [128, 256]
    assert (pool.count, pool.nbytes) == (1, 256)
    with pytest.raises(ExhaustedError):
        pool.take(64)
    assert len(large.buffer) == 256


def test_an_owned_buffer_has_a_unique_number_and_is_not_lent_by_the_pool(pool: BufferPool) -> None:
    mine = pool.own(bytearray(100))
    numbers = {mine.number, pool.take(100).number}
    del mine
    assert len(numbers) == 2
    assert pool.count == 1
