"""Decks with the fibres of a fabric: CalculiX runs them; those of others, read back.

Strips are compared with classical laminate theory.
"""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_output import NET
from test_shell_mesh import (
    GAMMA,
    KINDS,
    flat_mesh,
    on_surface,
    pv_mesh,
    run_folder,
    strip,
    translation_surface,
)
from test_views import command, sheared

from fabric_fenicsx.inputs.deck import read_deck
from fabric_fenicsx.output.shells import Placement
from fabric_fenicsx.solving.snapshot import at_rest

E1, E2, NU12, NU23, G12, G23 = 120e3, 8e3, 0.3, 0.4, 4e3, 3e3

MATERIAL = f"""*MATERIAL, NAME=UD
*ELASTIC, TYPE=ENGINEERING CONSTANTS
{E1}, {E2}, {E2}, {NU12}, {NU12}, {NU23}, {G12}, {G12},
{G23}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a run that ended in uniform shear."""
    return run_folder(tmp_path_factory.mktemp("sheared"), NET, sheared(GAMMA)[0])


@pytest.fixture(scope="module")
def unsheared(tmp_path_factory):
    return run_folder(tmp_path_factory.mktemp("at rest"), NET, at_rest(NET))


LENGTH, WIDTH, FORCE = 40.0, 10.0, 100.0


def pulled_strip(kind: str, *, flat: bool) -> str:
    """A deck of a strip along x under a uniform stress, with a section that says nothing of fibres.

    It is free to contract and to shear; where `flat`, it may not bend or twist.
    """
    points, elements = strip(kind, LENGTH, WIDTH, 8, 2)
    lines = ["*HEADING", "a strip", "*NODE, NSET=ALL"]
    lines += [f"{k}, {x}, {y}, 0." for k, (x, y) in enumerate(points.tolist(), start=1)]
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=STRIP"]
    lines += [", ".join(map(str, [k, *row])) for k, row in enumerate(elements.tolist(), start=1)]
    lines += [*MATERIAL.splitlines(), "*SHELL SECTION, ELSET=STRIP, MATERIAL=UD", "9.", "*STEP"]
    lines += ["*STATIC", "*BOUNDARY"]
    left, right = (np.flatnonzero(points[:, 0] == x) + 1 for x in (0.0, LENGTH))
    # A stress that is uniform needs no more than a rigid support.
    lines += [f"{left[0]}, 1, 2", f"{right[0]}, 2, 2"]
    lines += ["ALL, 3, 6"] if flat else ["ALL, 3, 3"]
    weights = np.array([1, 1]) / 2 if KINDS[kind] < 5 else np.array([1, 4, 1]) / 6
    loads = np.zeros(len(left))
    for start in range(0, len(left) - 1, len(weights) - 1):
        loads[start : start + len(weights)] += weights / 2
    lines.append("*CLOAD")
    for ends, sign in ((left, -1.0), (right, 1.0)):
        lines += [f"{k}, 1, {sign * FORCE * w}" for k, w in zip(ends, loads, strict=True)]
    return "\n".join([*lines, "*NODE PRINT, NSET=ALL", "U", "*END STEP"]) + "\n"


def displacements(folder: Path, name: str) -> dict[int, np.ndarray]:
    """What CalculiX finds in a deck for each node."""
    ccx = shutil.which("ccx")
    if ccx is None:
        policy = ["apt-cache", "policy", "calculix-ccx"]
        if "Candidate: 2" in subprocess.run(policy, capture_output=True, text=True).stdout:
            pytest.fail("there is no ccx: make setup installs calculix-ccx")
        pytest.skip("there is no ccx, and this Debian has no package of it")
    done = subprocess.run([ccx, name], cwd=folder, capture_output=True, text=True, timeout=100)
    assert "Job finished" in done.stdout and "*ERROR" not in done.stdout, done.stdout[-3000:]
    assert "WARNING" not in done.stdout, done.stdout
    text = (folder / f"{name}.dat").read_text().splitlines()
    return {int(w[0]): np.array(w[1:], float) for w in map(str.split, text) if len(w) == 4}


def strains(folder: Path, name: str) -> np.ndarray:
    """ε_x, ε_y and γ_xy of a strip that CalculiX has pulled."""
    u = displacements(folder, name)
    points = read_deck(folder / f"{name}.inp").points
    at = {tuple(p[:2]): u[k] for k, p in enumerate(points.tolist(), start=1)}
    a, b, c = (at[corner] for corner in ((0.0, 0.0), (LENGTH, 0.0), (0.0, WIDTH)))
    along, across = (b - a) / LENGTH, (c - a) / WIDTH
    return np.array([along[0], across[1], along[1] + across[0]])


def stiffness(angle: float) -> np.ndarray:
    """Q̄ of a ply whose fibres are turned by an angle from x, classical laminate theory."""
    compliance = np.array([[1 / E1, -NU12 / E1, 0.0], [-NU12 / E1, 1 / E2, 0.0], [0, 0, 1 / G12]])
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s]])
    turn = np.vstack([turn, [-c * s, c * s, c * c - s * s]])
    # σ in the ply is T σ, and ε in the strip is Tᵀ ε.
    return np.linalg.inv(turn.T @ compliance @ turn)


@pytest.mark.parametrize(
    ("kind", "degrees"),
    [("S8R", 0.0), ("S8R", 30.0), ("S8R", 45.0), ("S6", 30.0), ("S4", 30.0), ("S3", 30.0)],
)
def test_a_strip_pulled_off_its_fibres(unsheared, tmp_path, kind, degrees):
    """1/E_x = c⁴/E1 + s⁴/E2 + (1/G12 − 2 ν12/E1) s² c², and how far it shears."""
    (tmp_path / "strip.inp").write_text(pulled_strip(kind, flat=False))
    options = [
        "--material",
        "UD",
        "--thickness",
        0.5,
        "--plies",
        "warp",
        "--rotate",
        0,
        0,
        -degrees,
    ]
    out = ["--out", tmp_path / "mapped.inp"]
    assert command("map", unsheared, tmp_path / "strip.inp", *options, *out) == 0
    angle = np.radians(degrees)
    c, s = np.cos(angle), np.sin(angle)
    stress = FORCE / WIDTH / 0.5
    young = 1.0 / (c**4 / E1 + s**4 / E2 + (1.0 / G12 - 2.0 * NU12 / E1) * s * s * c * c)
    found = strains(tmp_path, "mapped")
    assert found[0] == pytest.approx(stress / young, rel=1e-4)
    expected = np.linalg.solve(stiffness(angle), [stress, 0.0, 0.0])
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4 * expected[0])


@pytest.mark.parametrize("constant", ["volume-fraction", "thickness"])
@pytest.mark.parametrize("layup", ["warp-weft", "symmetric"])
def test_a_strip_of_sheared_fabric_is_the_laminate_of_its_plies(folder, tmp_path, layup, constant):
    """Kept flat, ε = A⁻¹ N with the plies at their own angles, 25 and 75 degrees from the strip.

    The layer is thin: CalculiX makes solids of the plies, which slide on each other near free edges
    (0.6 % in ε_x where the layer is 0.5 mm thick).
    """
    (tmp_path / "strip.inp").write_text(pulled_strip("S8R", flat=True))
    options = ["--material", "UD", "--thickness", 0.05, "--plies", layup, "--constant", constant]
    options += ["--warp-share", 0.4, "--rotate", 0, 0, -5.0]
    out = ["--out", tmp_path / "mapped.inp"]
    assert command("map", folder, tmp_path / "strip.inp", *options, *out) == 0
    thickness = 0.05 / np.cos(GAMMA) if constant == "volume-fraction" else 0.05
    plies = {np.radians(25.0): 0.4, np.radians(75.0): 0.6}
    membrane = sum(share * thickness * stiffness(angle) for angle, share in plies.items())
    expected = np.linalg.solve(membrane, [FORCE / WIDTH, 0.0, 0.0])
    np.testing.assert_allclose(strains(tmp_path, "mapped"), expected, rtol=1e-4)


@pytest.mark.parametrize("kind", ["S6", "S8R"])
def test_a_curved_part_is_as_stiff_in_any_coordinates(tmp_path, kind):
    """Every element has axes of its own; CalculiX presses the part where it is, and turned away."""
    run = run_folder(tmp_path / "run", *on_surface(12.0))
    points, elements = strip(kind, 60.0, 50.0, 4, 3)
    there = Placement((0.3, -1.1, 2.0), (30.0, -400.0, 7.0))
    places = translation_surface(*(points - 25.0).T)[0]
    own = (places - np.array(there.offset)) @ there.rotation
    clamped = [f"{k}, 1, 6" for k in np.flatnonzero(points[:, 0] == 0.0) + 1]
    found = []
    for name, nodes, options in (
        ("there", places, []),
        ("own", own, ["--rotate", *np.degrees(there.angles), "--offset", *there.offset]),
    ):
        lines = ["*NODE, NSET=ALL"]
        lines += [", ".join(map(repr, [k, *p])) for k, p in enumerate(nodes.tolist(), start=1)]
        lines += [f"*ELEMENT, TYPE={kind}, ELSET=PART"]
        lines += [", ".join(map(str, [k, *e])) for k, e in enumerate(elements.tolist(), start=1)]
        lines += [*MATERIAL.splitlines(), "*STEP", "*STATIC", "*BOUNDARY", *clamped]
        lines += ["*DLOAD", "PART, P, 0.001", "*NODE PRINT, NSET=ALL", "U", "*END STEP"]
        (tmp_path / f"{name}.inp").write_text("\n".join(lines) + "\n")
        options += ["--thickness", 0.5, "--material", "UD", "--out", tmp_path / f"{name}_map.inp"]
        assert command("map", run, tmp_path / f"{name}.inp", *options) == 0
        sections = read_deck(tmp_path / f"{name}_map.inp").deck.sections
        assert len(sections) == len(elements)
        found.append(np.array(list(displacements(tmp_path, f"{name}_map").values())))
    largest = np.linalg.norm(found[0], axis=1).max()
    assert largest > 0.01
    np.testing.assert_allclose(found[1], found[0] @ there.rotation, atol=1e-4 * largest)


def test_calculix_takes_a_deck_that_is_half_covered(unsheared, tmp_path):
    """The half without fabric keeps its 9 mm and its fibres along x, the other one gets 0.5 mm."""
    (tmp_path / "strip.inp").write_text(pulled_strip("S8R", flat=False))
    out = tmp_path / "mapped.inp"
    options = ["--material", "UD", "--thickness", 9.0, "--plies", "warp", "--out", out]
    assert command("map", unsheared, tmp_path / "strip.inp", *options, "--offset", 124, 0, 0) == 0
    assert "EVERY" not in out.read_text() and "STRIP_UNCOVERED" in out.read_text()
    expected = np.linalg.solve(stiffness(0.0), [FORCE / WIDTH / 9.0, 0.0, 0.0])
    np.testing.assert_allclose(strains(tmp_path, "mapped"), expected, rtol=1e-3, atol=1e-12)


def test_a_part_of_an_abaqus_model_gets_its_sections_inside_the_part(unsheared, tmp_path):
    path, out = tmp_path / "model.inp", tmp_path / "mapped.inp"
    path.write_text(
        "*HEADING\nx\n*PART, NAME=Rig\n*NODE\n1, 5., 5., 5.\n*END PART\n*PART, NAME=Skin\n"
        "*NODE\n1, 0., 0.\n2, 10., 0.\n3, 10., 10.\n4, 0., 10.\n"
        "*ELEMENT, TYPE=S4R, ELSET=SKIN\n1, 1, 2, 3, 4\n*END PART\n*ASSEMBLY, NAME=A\n"
        "*INSTANCE, NAME=I, PART=Skin\n*END INSTANCE\n*NSET, NSET=N, INSTANCE=I\n1\n"
        "*END ASSEMBLY\n*MATERIAL, NAME=UD\n*STEP\n*STATIC\n*END STEP\n"
    )
    np.testing.assert_array_equal(read_deck(path).points[0], [0.0, 0.0, 0.0])
    options = ["--material", "UD", "--thickness", 0.25, "--solver", "abaqus", "--out", out]
    assert command("map", unsheared, path, *options) == 0
    lines = out.read_text().splitlines()
    at = {line: k for k, line in enumerate(lines)}
    assert at["*DISTRIBUTION TABLE, NAME=FABRIC_ANGLE"] < at["*PART, NAME=Rig"]
    section = at["*SHELL SECTION, ELSET=FABRIC, COMPOSITE, ORIENTATION=FABRIC_FIRST"]
    assert at["*PART, NAME=Skin"] < section < at["*ASSEMBLY, NAME=A"]
    assert lines[section + 3] == "*END PART"


def keywords(path):
    """(keyword line, data lines) of a deck, read by nothing of the package."""
    found = []
    for line in path.read_text().splitlines():
        if line.startswith("*"):
            found.append((line, []))
        else:
            found[-1][1].append(line)
    return found


@pytest.mark.parametrize("layup", ["warp-weft", "symmetric", "bisector"])
def test_an_abaqus_deck_has_the_directions_as_distributions(folder, tmp_path, layup):
    """Sets, tables and references as the keyword reference of Abaqus has them."""
    part = flat_mesh("S6")
    pv_mesh(part).save(tmp_path / "part.vtu")
    out = tmp_path / "mapped.inp"
    options = ["--material", "UD", "--thickness", 0.3, "--solver", "abaqus", "--plies", layup]
    assert command("map", folder, tmp_path / "part.vtu", *options, "--out", out) == 0
    blocks = keywords(out)
    options_of = [
        {k.strip(): v for k, _, v in (w.partition("=") for w in key.split(","))}
        for key, _ in blocks
    ]
    tables = {
        o["NAME"]: d
        for o, (_, d) in zip(options_of, blocks, strict=True)
        if "*DISTRIBUTION TABLE" in o
    }
    assert tables == {
        "FABRIC_AXES": ["COORD3D, COORD3D"],
        "FABRIC_ANGLE": ["ANGLE"],
        "FABRIC_LENGTH": ["LENGTH"],
    }
    fields = {}
    for given, (_, data) in zip(options_of, blocks, strict=True):
        if "*DISTRIBUTION" in given:
            assert given["LOCATION"] == "ELEMENT" and data[0].startswith(", ")
            values = np.array([[float(w) for w in row.split(",")] for row in data[1:]])
            np.testing.assert_array_equal(values[:, 0], part.numbers)
            assert len(data[0].split(",")) == values.shape[1]
            fields[given["NAME"]] = given["TABLE"], values[:, 1:]
    (orientation,) = (d for k, d in blocks if k == "*ORIENTATION, NAME=FABRIC_FIRST")
    assert orientation == ["FABRIC_FIRST_AXES", "3, 0."]
    kind, axes = fields["FABRIC_FIRST_AXES"]
    assert kind == "FABRIC_AXES"
    _, warp, weft = sheared(GAMMA)
    first = (warp + weft) / np.linalg.norm(warp + weft) if layup == "bisector" else warp
    np.testing.assert_allclose(axes[:, :3], np.tile(first, (len(axes), 1)), atol=1e-9)
    across = np.cross(part.normals, first)
    np.testing.assert_allclose(axes[:, 3:], across, atol=1e-9)
    (section,) = (d for k, d in blocks if k.startswith("*SHELL SECTION"))
    # Angle from the first ply, its share of the thickness.
    expected = {
        "warp-weft": [(0.0, 0.5), (50.0, 0.5)],
        "symmetric": [(0.0, 0.25), (50.0, 0.5), (0.0, 0.25)],
        "bisector": [(0.0, 1.0)],
    }[layup]
    for line, (angle, share) in zip(section, expected, strict=True):
        thickness, points, material, turned = (word.strip() for word in line.split(","))
        assert (points, material) == ("3", "UD")
        kind, values = fields[thickness]
        assert kind == "FABRIC_LENGTH"
        np.testing.assert_allclose(values, share * 0.3 / np.cos(GAMMA), rtol=1e-8)
        if angle:
            kind, values = fields[turned]
            assert kind == "FABRIC_ANGLE"
            np.testing.assert_allclose(values, angle, atol=1e-7)
        else:
            assert turned == "0."
    assert any(key == "*ELEMENT, TYPE=STRI65, ELSET=PART" for key, _ in blocks)


def test_openradioss_drape(folder, tmp_path):
    """Columns of 10, 10, 20 and 20 as OpenRadioss reads them; degrees from the reference."""
    both = tmp_path / "part.vtu"
    quads, triangles = flat_mesh("S4"), flat_mesh("S3")
    above = replace(triangles, points=triangles.points + np.array([0.0, 0.0, 1.0]))
    pv_mesh(quads).merge(pv_mesh(above)).save(both)
    out = tmp_path / "fabric.rad"
    options = ["--reference", 0, 1, 0, "--out", out]
    assert command("map", folder, both, *options) == 0
    lines = [line for line in out.read_text().splitlines() if not line.startswith("#")]
    count = len(quads.numbers) + len(triangles.numbers)
    assert len(lines) == 2 * (count + 2)
    # The warp is 20 degrees from x, the weft 20 degrees from y; the layer is 1 / cos γ as thick.
    for number, (title, angle) in enumerate((("fabric warp", -70.0), ("fabric weft", -20.0)), 1):
        block = lines[(number - 1) * (count + 2) :][: count + 2]
        assert block[:2] == [f"/DRAPE/{number}", title]
        rows_ = [(r[:10], int(r[10:20]), float(r[20:40]), float(r[40:60])) for r in block[2:]]
        assert all(len(row) == 60 for row in block[2:])
        assert sorted({row[0] for row in rows_}) == ["SH3N      ", "SHELL     "]
        assert [row[0].strip() for row in rows_].count("SHELL") == len(quads.numbers)
        assert [row[1] for row in rows_] == list(range(1, count + 1))
        np.testing.assert_allclose([row[2] for row in rows_], 1.0 / np.cos(GAMMA), rtol=1e-8)
        np.testing.assert_allclose([row[3] for row in rows_], angle, atol=1e-7)
    assert command("map", folder, both, "--constant", "thickness", *options) == 0
    row = out.read_text().splitlines()[5]
    assert float(row[20:40]) == 1.0
