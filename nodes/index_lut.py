"""Index the look-up tables once, so that nearest neighbours are found fast."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from tactograph.graph import Port, node
from tactograph.nodes import F4, LutLight, LutLit, LutSlope


class LutIndex(NamedTuple):
    entries: Annotated[F4, Port("M K", "1")]
    slopes: Annotated[F4, Port("M 2", "mm/mm")]
    trees: tuple


@node
def index_lut(light: LutLight, slope: LutSlope, lit: LutLit) -> LutIndex:
    """Build tables."""
    K = light.shape[1]
    full = (1 << K) - 1
    ents, slos, trees = [], [], []
    off = 0
    for t in range(K + 1):
        need = full if t == 0 else full & ~(1 << (t - 1))
        ch = (lit & need) == need
        e = light[ch].copy()
        if t:
            e[:, t - 1] = 0
        ents.append(e)
        slos.append(slope[ch])
        trees.append((cKDTree(e) if len(e) else None, off))
        off += len(e)
    return LutIndex(np.concatenate(ents), np.concatenate(slos), tuple(trees))
