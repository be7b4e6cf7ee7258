"""Half the light, and one and a half of it, for the host: see halves.cl."""

import numpy as np


def halves(K):
    def halves(image, low, high, first, last):
        for k in range(K):
            for row in range(first, last):
                for column in range(image.shape[2]):
                    if low.size:
                        low[k, row, column] = image[k, row, column] * np.float32(0.5)
                    if high.size:
                        high[k, row, column] = image[k, row, column] * np.float32(1.5)

    return halves
