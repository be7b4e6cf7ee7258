"""What the machine can do: bytes copied and float32 operations per second, on all cores.

python benchmarks/floors.py
"""

import time
from collections.abc import Callable

import numpy as np


def main() -> None:
    source = np.ones(1 << 26, np.float32)
    target = np.empty_like(source)
    seconds = fastest(lambda: np.copyto(target, source))
    print(f"copy: {2 * source.nbytes / seconds / 1e9:.1f} GB/s moved, one thread")
    a = np.ones((2048, 2048), np.float32)
    seconds = fastest(lambda: a @ a)
    print(f"multiply and add: {2 * len(a) ** 3 / seconds / 1e9:.0f} GFLOP/s")


def fastest(call: Callable[[], object]) -> float:
    times = []
    for _ in range(10):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


if __name__ == "__main__":
    main()
