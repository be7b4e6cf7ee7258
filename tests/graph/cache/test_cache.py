"""A cache holds a limited number of bytes and drops the least recently used value."""

import numpy as np

from tactograph.graph.cache.cache import MAX_RUNS, Cache, CacheKey, Run


def cache_key(name: str) -> CacheKey:
    return CacheKey(name, "out", "host")


def test_the_least_recently_used_value_is_dropped_first() -> None:
    cache = Cache(megabytes=3.5)
    for name in "abc":
        cache.put(cache_key(name), np.zeros(10**6, np.uint8))
    cache.take(cache_key("a"))
    cache.put(cache_key("d"), np.zeros(10**6, np.uint8))
    assert [name for name in "abcd" if cache_key(name) in cache] == ["a", "c", "d"]
    assert 3 * 10**6 < cache.bytes < 3.5e6


def test_a_value_larger_than_the_cache_is_not_cached() -> None:
    cache = Cache(megabytes=1)
    cache.put(cache_key("a"), np.zeros(10, np.uint8))
    cache.put(cache_key("b"), np.zeros(10**7, np.uint8))
    assert cache_key("a") in cache
    assert cache_key("b") not in cache


def test_a_value_that_is_put_twice_counts_once() -> None:
    cache = Cache()
    for _ in range(3):
        cache.put(cache_key("a"), np.zeros(1000, np.uint8))
    assert 1000 < cache.bytes < 2000
    cache.drop(cache_key("a"))
    assert (cache.bytes, len(cache)) == (0, 0)


def test_an_object_of_unknown_size_counts_as_a_large_one() -> None:
    cache = Cache()
    cache.put(cache_key("a"), (object(), 1.0))
    assert cache.bytes > 10**6


def test_the_number_of_noted_runs_is_limited() -> None:
    cache = Cache()
    for number in range(MAX_RUNS + 5):
        cache.note(str(number), Run({}, 0.0, ()))
    assert cache.run("0") is None
    assert cache.run(str(MAX_RUNS)) is not None
