# %% [markdown]
# # From measured curves to what a model lacks
#
# A picture frame is measured in the model, with dry friction between the tows hidden in it. What a
# user would get, a folder of curves, is then diagnosed: the baseline of springs and dashpots is
# fitted, its residual is traced to the effect, and the run that was held out says whether the
# extended model predicts what it has not seen.
#
# ```
# python demos/hidden_friction.py
# ```
#
# The same from the command line, where the folder may be your own:
#
# ```
# fabric-fenicsx synthesise demos/picture_frame.yaml --noise 0.02 \
#     --effect "crossover_friction/Dahl:m_c_N=0.004" --out results/measured
# fabric-fenicsx diagnose results/measured
# ```

# %%
from pathlib import Path
from typing import Any

import fabric_fenicsx as ff

CASE = Path(__file__).with_name("picture_frame.yaml")
SETTINGS = ["hold_s=20", "travel_mm=80"]
RATES = (35.0, 105.0, 60.0)  # mm/min; the last run is held out
HIDDEN = ff.Hidden("crossover_friction", "Dahl", {"m_c_N": 0.01, "slip_angle_rad": 0.02})
NOISE = 0.05  # N, one sigma of a reading


# %% [markdown]
# ## Measure, diagnose, draw
#
# Out, a short hold and back at three rates. Nothing in the folder names the effect.


# %%
def main(folder: Path = Path("results/demo_hidden_friction")) -> dict[str, Any]:
    """Go round the loop once; returns the report."""
    measured = folder / "measured"
    if not measured.exists():
        case = ff.load_case(CASE, SETTINGS)
        ff.write_measurement(measured, ff.synthesise(case, [HIDDEN], NOISE, rates=RATES))
    found = ff.diagnose([ff.read_measurement(measured)], folder)
    (diagnosis,) = found.diagnoses
    names = [f"{rate:g} mm/min" for rate in RATES]
    ff.data_figure(diagnosis, names).savefig(folder / "hidden_friction.png", dpi=150)
    ff.residual_figure(diagnosis).savefig(folder / "hidden_friction_residuals.png", dpi=150)
    return found.report


if __name__ == "__main__":
    print(main()["headline"])
