# %% [markdown]
# # How the weave changes the drape
#
# The same tows and the same shear law per area, woven in three ways, drape over a hemisphere.
# The longer the floats, the fewer crossings lock the tows, and the softer is the sheet in its
# plane; see `demos/weaves.py` for the rule, which is an assumption of this package. A coarse net
# (tows 24 mm apart, a quarter of the sheet) makes the comparison quick.
#
# ```
# python demos/weave_drape.py      # or: mpirun -n 2 python demos/weave_drape.py
# ```

# %%
from pathlib import Path

from mpi4py import MPI

import pandas as pd

import fabric_fenicsx as ff

# %% [markdown]
# The fabric of `demos/drape.yaml` with a quarter as many tows: `per_width_mm` keeps weight and
# stiffness per width.

# %%
KEYS = {
    "sheet": {"warp_spacing_mm": 24.0, "weft_spacing_mm": 24.0},
    "tow": {"per_width_mm": 12.0, "stiffness": {"bending_in_plane_Nmm": 9.5}},
}
NAMES = ("plain", "twill_2_2", "satin_8")


def main(folder: Path = Path("results/weave_drape"), duration: float = 60.0) -> dict[str, dict]:
    """Drape each weave for ``duration`` seconds; 60 is the whole draw.

    Returns:
        For each its mean float [crossings], largest and mean shear angle [degrees], force of the
        whole punch [N] and energy of the in-plane springs [N mm].
    """
    numbers = {}
    for name in NAMES:
        own = folder / name
        # The draw goes on at its speed: less time is less of it.
        case = ff.make_case(
            "drape",
            **KEYS,
            weave={"pattern": name},
            duration_s=duration,
            punch_travel_mm=65.0 * duration / 60.0,
        )
        result = ff.run(case, own, pictures=False)
        if not result["completed"]:
            raise SystemExit(f"{name}: {result['stopped_because']}")
        shear = 90.0 - pd.read_csv(own / "crossings.csv")["angle_deg"]
        quantities = result["quantities"]
        steps = pd.read_csv(own / "steps.csv")
        numbers[name] = {
            "mean_float": ff.WEAVES[name].float_length[0],
            "largest_shear_deg": quantities["largest_shear_angle_deg"],
            "mean_shear_deg": float(shear.mean()),
            "punch_force_N": quantities["punch_force_N"],
            "shear_energy_N_mm": steps["energy_rotational_spring_N_mm"].iloc[-1],
        }
        if MPI.COMM_WORLD.rank == 0:
            results = ff.read_results(own)
            net, last, _ = results.at(results.nearest(None), mirror=True)
            title = name.replace("_", " ")
            ff.draw_net(own / "drape.png", net, last, title=title, limits=(0.0, 40.0))
    return numbers


if __name__ == "__main__":
    table = main()
    if MPI.COMM_WORLD.rank == 0:
        for title, row in table.items():
            print(f"{title:12}" + "  ".join(f"{key} {value:.4g}" for key, value in row.items()))
