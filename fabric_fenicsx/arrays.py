"""Names for the arrays of annotations: of what they hold; docstrings say their shapes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

#: Of real numbers.
Array = npt.NDArray[np.float64]
#: Of whole numbers: indices and counts.
Integers = npt.NDArray[np.int64]
#: Of yes and no.
Flags = npt.NDArray[np.bool_]
