"""Call a function of OpenCV by its name."""

from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from tactograph.rings.filters.nodes._opencv_functions import Arguments, call_opencv, checked_call
from tactograph.sdk import Light, node


@node(neutral="light")
def opencv(
    light: Light, *, call: Annotated[dict[str, Arguments], AfterValidator(checked_call)]
) -> Light:
    """Return the result of a function of OpenCV for each LED's image; on the host only.

    ``call: {Sobel: {dx: 1, dy: 0}}`` names the function and its arguments as OpenCV's
    documentation does; constants are given by name (``borderType: BORDER_REFLECT``), and a
    kernel as a list of rows.  `_opencv_functions` lists the functions: blur, GaussianBlur,
    medianBlur, bilateralFilter, filter2D, sepFilter2D, Sobel, Scharr, Laplacian, erode, dilate.
    Where OpenCV leaves ``borderType`` to a default, the default here is ``BORDER_REPLICATE``.

    Parameters
    ----------
    light : K x H x W
    call
        The function and its arguments; checked, and tried on a small image, before anything
        runs.

    Raises
    ------
    InputError
        If the function is not listed, or its arguments are not right.
    """
    return np.asarray([call_opencv(plane, call) for plane in light], np.float32)
