"""The material law that came out of a diagnosis, as a table."""

from __future__ import annotations

import pandas as pd

from ..inference.curve import Curve
from ..inference.diagnosis import Diagnosis
from ..inference.fitted import Fit

__all__ = ["curve_table", "law_table"]


def law_table(diagnosis: Diagnosis, model: Fit) -> pd.DataFrame | None:
    """The law of a model, beside that of the baseline.

    Returns:
        What it depends on, the law, its standard error (``std_...``) and the law of the fitted
        baseline (``baseline_...``), with units in the names; None where the test has no such law.
    """
    experiment, baseline = diagnosis.experiment, diagnosis.baseline
    law = experiment.law(model.variants, model.values)
    if law is None:
        return None
    before = experiment.law(baseline.variants, baseline.values)
    assert before is not None
    # Each reaches its own largest value; the baseline's is linear.
    return pd.DataFrame(
        {
            law.x: law.at,
            law.y: law.value,
            f"std_{law.y}": model.error_of(law.slopes),
            f"baseline_{law.y}": before.value[-1] * law.at / before.at[-1],
        }
    )


def curve_table(curve: Curve) -> pd.DataFrame:
    """What readings know that are on one curve, with its standard error (``std_...``)."""
    return pd.DataFrame({curve.x: curve.at, curve.y: curve.value, f"std_{curve.y}": curve.std})
