"""Fibres on the shell elements of a part, against closed forms; decks run by CalculiX.

A translation surface x(u, v) = p(u) + q(v) of two curves by their arc lengths is a Chebyshev net:
tows along p′ and q′ keep their length, and sin γ = p′ · q′.
"""

from __future__ import annotations

import base64
import shutil
import struct
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
from solve import orders
from test_output import NET, square
from test_views import command, sheared, write_step

from fabric_fenicsx.inputs.deck import read_deck
from fabric_fenicsx.inputs.shell_mesh import ShellMesh, padded
from fabric_fenicsx.output.fibres import FibreMap, fibre_map
from fabric_fenicsx.output.results import write_setup
from fabric_fenicsx.output.shells import Placement, on_shells, warp_share
from fabric_fenicsx.solving.snapshot import at_rest

ROOT = Path(__file__).parents[1]
GAMMA = np.radians(40.0)
RADIUS = 70.0

E1, E2, NU12, NU23, G12, G23 = 120e3, 8e3, 0.3, 0.4, 4e3, 3e3
MATERIAL = f"""*MATERIAL, NAME=UD
*ELASTIC, TYPE=ENGINEERING CONSTANTS
{E1}, {E2}, {E2}, {NU12}, {NU12}, {NU23}, {G12}, {G12},
{G23}
"""
KINDS = {"S3": 3, "S4": 4, "S6": 6, "S8R": 8}


def strip(kind: str, length: float, width: float, n: int, m: int):
    """Points (p, 2) and elements (n, k), from 1, of a strip in n by m elements or pairs of them."""
    size = KINDS[kind]
    step = 1 if size < 5 else 2
    across = m * step + 1
    x, y = np.meshgrid(
        np.linspace(0.0, length, n * step + 1), np.linspace(0.0, width, across), indexing="ij"
    )

    def at(i, j):
        return i * across + j + 1

    elements = []
    for i in range(0, n * step, step):
        for j in range(0, m * step, step):
            square_ = [(i, j), (i + step, j), (i + step, j + step), (i, j + step)]
            faces = [square_] if size in (4, 8) else [square_[:3], [square_[0], *square_[2:]]]
            for face in faces:
                sides = zip(face, [*face[1:], face[0]], strict=True)
                middles = [((a + c) // 2, (b + d) // 2) for (a, b), (c, d) in sides]
                elements.append([at(*p) for p in (face if step == 1 else face + middles)])
    return np.column_stack([x.ravel(), y.ravel()]), np.array(elements)


def mesh_of(kind: str, places, elements) -> ShellMesh:
    count = len(elements)
    return ShellMesh(
        np.asarray(places, dtype=float),
        np.arange(1, len(places) + 1),
        padded([np.asarray(elements, dtype=np.int64) - 1]),
        np.arange(1, count + 1),
        [kind] * count,
    )


def flat_mesh(kind: str, *, z: float = 0.0, side: float = 40.0) -> ShellMesh:
    """A square about the origin."""
    points, elements = strip(kind, 2.0 * side, 2.0 * side, 3, 4)
    return mesh_of(kind, np.column_stack([points - side, np.full(len(points), z)]), elements)


def translation_surface(u, v):
    """Place, warp and weft of the surface of two circles."""
    zero = np.zeros_like(u)
    place = [RADIUS * np.sin(u / RADIUS), RADIUS * np.sin(v / RADIUS)]
    place.append(RADIUS * (2.0 - np.cos(u / RADIUS) - np.cos(v / RADIUS)))
    warp = np.stack([np.cos(u / RADIUS), zero, np.sin(u / RADIUS)], axis=-1)
    weft = np.stack([zero, np.cos(v / RADIUS), np.sin(v / RADIUS)], axis=-1)
    return np.stack(place, axis=-1), warp, weft


def curved(spacing: float) -> FibreMap:
    """The net on the surface."""
    net = square(-60.0, 60.0, spacing)
    place, warp, weft = translation_surface(*net.points.T[:2])
    up = np.cross(warp, weft)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    along = np.where((net.node_family == net.node_family[0])[:, None], warp, weft)
    directors = np.stack([along, np.cross(up, along), up], axis=1)
    shear = np.arcsin(np.einsum("ij,ij->i", warp, weft))[net.crossings[:, 0]]
    return fibre_map(
        net,
        replace(
            at_rest(net), displacement=place - net.points, directors=directors, shear_angle=shear
        ),
    )


@pytest.mark.parametrize("kind", KINDS)
def test_uniform_shear_is_the_same_in_every_element(kind):
    """Exact, on the fabric's other side and on elements that look the other way too."""
    snapshot, warp, weft = sheared(GAMMA)
    mesh = flat_mesh(kind, z=-0.3)
    back = replace(mesh, nodes=flipped(mesh))
    for one in (mesh, back):
        fibres = on_shells(fibre_map(NET, snapshot), one)
        count = len(one.numbers)
        assert fibres.covered.all()
        np.testing.assert_allclose(fibres.distance, 0.3, rtol=1e-12)
        np.testing.assert_allclose(fibres.warp, np.tile(warp, (count, 1)), atol=1e-12)
        np.testing.assert_allclose(fibres.weft, np.tile(weft, (count, 1)), atol=1e-12)
        np.testing.assert_allclose(fibres.shear, GAMMA, rtol=1e-12)
    # Two thirds of the fibres are warp. The product of thickness and fraction is the areal volume.
    thick = fibres.layer(0.3, 0.5, constant="volume-fraction", share=2 / 3)
    np.testing.assert_allclose(thick.thickness, 0.3 / np.cos(GAMMA), rtol=1e-12)
    np.testing.assert_allclose(thick.fraction, [[0.5 * 2 / 3, 0.5 / 3]] * count, rtol=1e-12)
    dense = fibres.layer(0.3, 0.5, constant="thickness", share=2 / 3)
    np.testing.assert_allclose(dense.thickness, 0.3, rtol=1e-12)
    np.testing.assert_allclose(dense.fraction.sum(axis=1), 0.5 / np.cos(GAMMA), rtol=1e-12)
    assert warp_share(NET) == pytest.approx(0.5, rel=1e-12)


def flipped(mesh: ShellMesh):
    """Nodes in the other sense of rotation."""
    size = int(mesh.sizes[0])
    half = size // 2 if size > 4 else size
    corners = mesh.nodes[:, :half][:, ::-1]
    # From the last corner back: the side before a corner comes after it.
    middles = np.roll(mesh.nodes[:, half:size][:, ::-1], -1, axis=1) if size > 4 else None
    return padded([corners if middles is None else np.hstack([corners, middles])])


def test_directions_on_a_curved_surface_converge_with_the_square_of_the_size():
    errors = []
    for n in (5, 10, 20):
        fabric = curved(120.0 / n)
        # Elements across the meshes of the fabric, turned by 30 degrees.
        points, elements = strip("S4", 50.0, 40.0, n, n)
        points = (points - [25.0, 20.0]) @ np.array([[0.75**0.5, 0.5], [-0.5, 0.75**0.5]]) + 20.0
        mesh = mesh_of("S4", translation_surface(*points.T)[0], elements)
        fibres = on_shells(fabric, mesh)
        assert fibres.covered.all()
        middles = points[elements - 1].mean(axis=1)
        _, warp, weft = translation_surface(*middles.T)
        shear = np.arcsin(np.einsum("ij,ij->i", warp, weft))
        assert np.degrees(np.abs(shear).max()) > 13.0
        wrong = [
            *(fibres.warp - warp).T,
            *(fibres.weft - weft).T,
            fibres.shear - shear,
            fibres.density - 1.0 / np.cos(shear),
            fibres.distance / RADIUS,
            # The angle between what is written is the shear angle.
            np.einsum("ij,ij->i", fibres.warp, fibres.weft) - np.sin(shear),
        ]
        errors.append(np.sqrt(np.mean(np.square(wrong), axis=1)))
        for vectors in (fibres.warp, fibres.weft):
            np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=1e-12)
            np.testing.assert_allclose(
                np.einsum("ij,ij->i", vectors, mesh.normals), 0.0, atol=1e-12
            )
    assert np.max(errors[-1]) < 5e-3
    assert orders(errors).min() > 1.8, errors


def test_a_part_in_coordinates_of_its_own_gets_the_same_fibres():
    """The part is moved and turned away, and brought back by its placement."""
    fabric = curved(12.0)
    points, elements = strip("S8R", 60.0, 50.0, 6, 5)
    places = translation_surface(*(points - 25.0).T)[0]
    there = Placement((0.3, -1.1, 2.0), (30.0, -400.0, 7.0))
    turn = there.rotation
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    # About x first, about z last: R x = Rz (Ry (Rx x)).
    quarter = Placement((np.pi / 2, 0.0, np.pi / 2)).rotation
    np.testing.assert_allclose(quarter @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(quarter @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    expected = on_shells(fabric, mesh_of("S8R", places, elements))
    own = (places - np.array(there.offset)) @ turn
    found = on_shells(fabric, mesh_of("S8R", own, elements), placement=there)
    # Fabric and part turned together: nothing but the directions turns with them.
    moved = replace(
        fabric,
        place=(fabric.place - np.array(there.offset)) @ turn,
        **{name: getattr(fabric, name) @ turn for name in ("warp", "weft", "normal")},
    )
    together = on_shells(moved, mesh_of("S8R", own, elements))
    for other in (found, together):
        np.testing.assert_array_equal(other.covered, expected.covered)
        np.testing.assert_allclose(other.warp, expected.warp @ turn, atol=1e-9)
        np.testing.assert_allclose(other.weft, expected.weft @ turn, atol=1e-9)
        for name in ("distance", "shear", "density"):
            np.testing.assert_allclose(
                getattr(other, name), getattr(expected, name), rtol=1e-9, atol=1e-9
            )


def test_what_the_fabric_does_not_cover_gets_no_direction():
    fabric = fibre_map(NET, at_rest(NET))  # from -144 to 144
    points, elements = strip("S4", 400.0, 40.0, 40, 4)
    flat = np.column_stack([points, np.zeros(len(points))])
    mesh = mesh_of("S4", flat, elements)
    inside = mesh.centres[:, 0] < 144.0
    fibres = on_shells(fabric, mesh, distance=1000.0)
    np.testing.assert_array_equal(fibres.covered, inside)
    for values in (fibres.warp, fibres.weft, fibres.shear, fibres.density):
        assert np.isnan(values[~inside]).all() and np.isfinite(values[inside]).all()
    lifted = mesh_of("S4", flat + np.array([0.0, 0.0, 5.5]), elements)
    assert not on_shells(fabric, lifted).covered.any()
    np.testing.assert_array_equal(on_shells(fabric, lifted, distance=5.6).covered, inside)
    # Steep walls that stand on the fabric.
    for degrees, seen in ((44.0, True), (46.0, False)):
        slope = np.radians(degrees)
        turn = Placement((slope, 0.0, 0.0))
        steep = on_shells(fabric, mesh, placement=turn, distance=100.0)
        assert steep.covered.any() == seen
    front, back = (on_shells(fabric, mesh, side=side).covered for side in ("front", "back"))
    np.testing.assert_array_equal(front, inside)
    assert not back.any()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a run that ended in uniform shear."""
    path = tmp_path_factory.mktemp("run")
    write_setup(path, NET)
    write_step(path, 1, sheared(GAMMA)[0], {})
    return path


@pytest.fixture(scope="module")
def unsheared(tmp_path_factory):
    path = tmp_path_factory.mktemp("run at rest")
    write_setup(path, NET)
    write_step(path, 1, at_rest(NET), {})
    return path


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


def strains(folder: Path, name: str) -> np.ndarray:
    """ε_x, ε_y and γ_xy that CalculiX finds in a deck."""
    ccx = shutil.which("ccx")
    if ccx is None:
        if (ROOT / ".venv" / "setup-stamp").exists():
            pytest.fail("there is no ccx: make setup installs calculix-ccx")
        pytest.skip("there is no ccx")
    done = subprocess.run([ccx, name], cwd=folder, capture_output=True, text=True, timeout=100)
    assert "Job finished" in done.stdout and "*ERROR" not in done.stdout, done.stdout[-3000:]
    assert "WARNING" not in done.stdout, done.stdout
    text = (folder / f"{name}.dat").read_text().splitlines()
    u = {int(w[0]): np.array(w[1:], float) for w in map(str.split, text) if len(w) == 4}
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


MESSY = """*Heading
** a part with two kinds of elements, a set by numbers, one by sets, and an included file
*NODE, nset=all, input=nodes of the part.inc
*Element, type=S4R, elset=Skin
1, 1, 2, 5,
4
2, 2,3,6,5
*ELEMENT, TYPE=S3, ELSET=\"the rim\"
 7, 4,5,8
 8,
 5,6,8
*ELEMENT, TYPE=T3D2, ELSET=BARS
20, 1, 2
*ELSET, ELSET=EVERY, GENERATE
1, 2, 1
*Elset, elset=EVERY
the RIM,
*INCLUDE, INPUT=material.inc
*Shell Section, elset=EVERY, material=UD
0.7
*SOLID SECTION, ELSET=BARS, MATERIAL=UD
1.
*STEP
*STATIC
*BOUNDARY
1, 1, 6
*CLOAD
8, 1, 1.
*END STEP
"""


@pytest.fixture
def messy(tmp_path):
    path = tmp_path / "messy.inp"
    path.write_text(MESSY)
    nodes = [(0, 0), (90, 0), (180, 0), (0, 90), (90, 90), (180, 90), (999, 999), (90, 180)]
    lines = [f"{k}, {x}, {y}" for k, (x, y) in enumerate(nodes, start=1)]
    (tmp_path / "nodes of the part.inc").write_text("\n".join(lines) + "\n")
    (tmp_path / "material.inc").write_text(MATERIAL)
    return path


def test_a_deck_keeps_what_is_not_of_the_fabric(unsheared, messy, capsys):
    """One of four elements is covered; the others keep the section that they had."""
    mesh = read_deck(messy)
    np.testing.assert_array_equal(mesh.numbers, [1, 2, 7, 8])
    assert mesh.types == ["S4R", "S4R", "S3", "S3"]
    np.testing.assert_array_equal(mesh.sizes, [4, 4, 3, 3])
    np.testing.assert_allclose(mesh.areas, [8100.0, 8100.0, 4050.0, 4050.0])
    out = messy.with_name("mapped.inp")
    options = ["--material", "UD", "--thickness", 0.25, "--plies", "bisector", "--out", out]
    assert command("map", unsheared, messy, *options) == 0
    assert capsys.readouterr().err == ""
    assert command("map", unsheared, messy, *options, "--offset", 90, 0, 0) == 0
    error = capsys.readouterr().err
    assert error.startswith("3 of 4 elements (75.0%, 66.7% of the area) are not covered")
    text = out.read_text()
    again = read_deck(out)
    np.testing.assert_array_equal(again.points, mesh.points)
    np.testing.assert_array_equal(again.nodes, mesh.nodes)
    new, old = again.deck.sections
    assert (new.name, new.elements) == ("FABRIC_1", {1})
    assert (old.name, old.elements) == ("EVERY_UNCOVERED", {2, 7, 8})
    for kept in ("*ELEMENT, TYPE=T3D2, ELSET=BARS", "*SOLID SECTION", "*CLOAD", "** a part"):
        assert kept in text
    assert "INCLUDE" not in text and "INPUT" not in text.upper()
    # Mapped once more, to other elements: no name is used twice.
    twice = messy.with_name("twice.inp")
    options[-1] = twice
    assert command("map", unsheared, out, *options, "--offset", -144, 0, 0) == 0
    third = read_deck(twice)
    names = [section.name for section in third.deck.sections]
    assert sorted(names) == ["FABRIC2_1"] and third.deck.sections[0].elements == {1, 2, 7, 8}


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


def pv_mesh(mesh: ShellMesh) -> pv.UnstructuredGrid:
    kinds = {3: 5, 4: 9, 6: 22, 8: 23}
    size = int(mesh.sizes[0])
    cells = np.insert(mesh.nodes[:, :size], 0, size, axis=1).ravel()
    return pv.UnstructuredGrid(cells, np.full(len(mesh.nodes), kinds[size]), mesh.points)


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


def decoded(path):
    """Arrays of a .vtu by their names: base64 of blocks packed by zlib, read without VTK."""
    root = ET.parse(path).getroot()
    assert root.get("header_type") == "UInt32" and root.get("compressor") == "vtkZLibDataCompressor"
    types = {"Float64": "<f8", "Float32": "<f4", "Int64": "<i8", "UInt8": "u1"}
    found = {}
    for array in root.iter("DataArray"):
        text = "".join(array.text.split())
        (blocks,) = struct.unpack("<I", base64.b64decode(text[:8])[:4])
        head = 4 * (3 + blocks)
        cut = -(-head // 3) * 4
        sizes = struct.unpack(f"<{3 + blocks}I", base64.b64decode(text[:cut])[:head])[3:]
        packed, raw, start = base64.b64decode(text[cut:]), b"", 0
        for size in sizes:
            raw += zlib.decompress(packed[start : start + size])
            start += size
        width = int(array.get("NumberOfComponents") or 1)
        values = np.frombuffer(raw, types[array.get("type")])
        found[array.get("Name")] = values.reshape(-1, width) if width > 1 else values
    return found


def test_table_and_vtk_hold_the_same(folder, tmp_path, capsys):
    """Weight and density of the fibres give the fraction, 600 / (1000 · 2.5 · 0.5) = 0.48."""
    mesh = flat_mesh("S8R", side=150.0)  # beyond the fabric
    part = tmp_path / "part.vtu"
    pv_mesh(mesh).save(part)
    outs = [tmp_path / "a.csv", tmp_path / "a.vtu"]
    options = ["--areal-weight", 600, "--fibre-density", 2.5, "--thickness", 0.5]
    options += ["--constant", "thickness", "--warp-share", 0.6]
    files = [word for out in outs for word in ("--out", out)]
    assert command("map", folder, part, *options, *files) == 0
    printed = capsys.readouterr()
    assert printed.out.split() == [str(out) for out in outs]
    table = pd.read_csv(outs[0])
    covered = table["covered"] == 1
    assert 0 < (~covered).sum() < covered.sum()
    assert printed.err.startswith(f"{(~covered).sum()} of {len(mesh.numbers)} elements")
    assert table[["warp_x", "shear_deg", "thickness_mm"]][~covered].isna().all(axis=None)
    fraction = table["volume_fraction"][covered]
    np.testing.assert_allclose(fraction, 0.48 / np.cos(GAMMA), rtol=1e-8)
    np.testing.assert_allclose(table["volume_fraction_warp"][covered], 0.6 * fraction, rtol=1e-8)
    np.testing.assert_allclose(table["shear_deg"][covered], 40.0, rtol=1e-8)
    arrays = decoded(outs[1])
    np.testing.assert_allclose(arrays["Points"], mesh.points, atol=1e-12)
    np.testing.assert_array_equal(arrays["connectivity"].reshape(-1, 8), mesh.nodes)
    np.testing.assert_array_equal(arrays["types"], 23)
    for name in ("shear_deg", "thickness_mm", "volume_fraction_weft", "distance_mm"):
        np.testing.assert_allclose(arrays[name], table[name], rtol=1e-8, atol=1e-9)
    warp = table[["warp_x", "warp_y", "warp_z"]]
    np.testing.assert_allclose(arrays["warp"], warp, atol=1e-8)
    try:
        import meshio
    except ImportError:
        return
    read = meshio.read(outs[1])
    np.testing.assert_allclose(read.cell_data["weft"][0], arrays["weft"])


def test_meshes_of_several_kinds_are_read(unsheared, tmp_path):
    """STL and a mix of cells with lines among them, which are no shells."""
    corners = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
    pv.PolyData(corners, faces=[3, 0, 1, 2, 3, 0, 2, 3]).save(tmp_path / "a.stl")
    cells = [2, 0, 1, 4, 0, 1, 2, 3, 3, 0, 1, 2]
    pv.UnstructuredGrid(cells, [3, 9, 5], corners).save(tmp_path / "b.vtk")
    for name, areas in (("a.stl", [50.0, 50.0]), ("b.vtk", [100.0, 50.0])):
        out = tmp_path / "out.vtu"
        assert command("map", unsheared, tmp_path / name, "--out", out) == 0
        made = pv.read(out)
        np.testing.assert_allclose(made.compute_cell_sizes()["Area"], areas)
        assert made["covered"].all()
        np.testing.assert_array_equal(made["element"], [1, 2])


GOOD = ["map", "{run}", "{dir}/part.inp"]
OUT = ["--out", "{dir}/out.csv"]
DECK = ["--out", "{dir}/out.inp"]
BAD = {
    "no mesh": (
        ["map", "{run}", "{dir}/none.vtu", *OUT],
        "none.vtu: no such file, allowed is a mesh",
    ),
    "no deck": (
        ["map", "{run}", "{dir}/none.inp", *OUT],
        "none.inp: no such file, allowed is a deck",
    ),
    "format": (["map", "{run}", "{dir}/part.xyz", *OUT], "part.xyz: "),
    "broken": (["map", "{run}", "{dir}/broken.vtu", *OUT], "broken.vtu: "),
    "lines": (["map", "{run}", "{dir}/lines.vtk", *OUT], "lines.vtk: no shell elements, allowed"),
    "solids": (["map", "{run}", "{dir}/solids.inp", *OUT], "solids.inp: no shell elements"),
    "no node": (["map", "{run}", "{dir}/lost.inp", *OUT], "line 3: element 7: there is no node 9"),
    "circle": (["map", "{run}", "{dir}/circle.inp", *OUT], "files that include one another"),
    "short": (["map", "{run}", "{dir}/short.inp", *OUT], "S3 have a number and 3 nodes"),
    "far": (
        [*GOOD, *OUT, "--offset", "0", "0", "700"],
        "the fabric covers no element, the nearest is 700",
    ),
    "ending": ([*GOOD, "--out", "{dir}/a.xyz"], "a.xyz: allowed is a file with the ending"),
    "itself": (
        [
            *GOOD,
            "--out",
            "{dir}/part.inp",
            "--material",
            "UD",
            "--thickness",
            "1",
            "--plies",
            "warp",
        ],
        "is the part's own mesh",
    ),
    "thin": (
        [*GOOD, *OUT, "--thickness", "-0.1"],
        "--thickness: -0.1, allowed is a number above 0",
    ),
    "nan": ([*GOOD, *OUT, "--thickness", "nan"], "--thickness: nan, allowed is a number above 0"),
    "full": (
        [*GOOD, *OUT, "--volume-fraction", "1.2"],
        "allowed is a number above 0 and at most 1",
    ),
    "heavy": (
        [*GOOD, *OUT, "--areal-weight", "900", "--fibre-density", "1", "--thickness", "0.5"],
        "more fibres than fit",
    ),
    "weight": (
        [*GOOD, *OUT, "--areal-weight", "900"],
        "--areal-weight: allowed is with --fibre-density",
    ),
    "all": (
        [
            *GOOD,
            *OUT,
            "--areal-weight",
            "300",
            "--fibre-density",
            "2",
            "--thickness",
            "0.5",
            "--volume-fraction",
            "0.3",
        ],
        "allowed is with one of",
    ),
    "no name": (
        [*GOOD, *DECK, "--thickness", "1"],
        "out.inp: a deck needs --material and --thickness",
    ),
    "a comma": (
        [*GOOD, *DECK, "--thickness", "1", "--material", "a,b"],
        "--material: 'a,b', allowed is",
    ),
    "plies in S3": (
        [*GOOD, *DECK, "--thickness", "1", "--material", "UD"],
        "not in S3: allowed is a mesh of second order, or one ply",
    ),
    "solver": (
        [*GOOD, *OUT, "--solver", "nastran"],
        "--solver: nastran, allowed is calculix or abaqus",
    ),
    "plies": ([*GOOD, *OUT, "--plies", "four"], "--plies: four, allowed is warp-weft"),
    "constant": ([*GOOD, *OUT, "--constant", "all"], "--constant: all, allowed is volume-fraction"),
    "side": ([*GOOD, *OUT, "--side", "left"], "--side: left, allowed is both, front or back"),
    "share": ([*GOOD, *OUT, "--warp-share", "1.5"], "--warp-share: 1.5, allowed is"),
    "distance": ([*GOOD, *OUT, "--max-distance", "0"], "--max-distance: 0, allowed is"),
    "angle": ([*GOOD, *OUT, "--max-angle", "120"], "--max-angle: 120, allowed is"),
    "no direction": ([*GOOD, *OUT, "--reference", "0", "0", "0"], "--reference: 0 0 0, allowed is"),
    "across": ([*GOOD, "--out", "{dir}/o.rad", "--reference", "0", "0", "1"], "across element 1"),
    "second order": (
        ["map", "{run}", "{dir}/six.inp", "--out", "{dir}/o.rad"],
        "no shells of second order",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_and_writes_nothing(unsheared, tmp_path, capfd, name):
    head = "*NODE\n1, 0., 0., 0.\n2, 9., 0., 0.\n3, 0., 9., 0.\n4, 0., 0., 9.\n"
    mesh = pv.UnstructuredGrid([2, 0, 1], [3], np.eye(3))
    mesh.save(tmp_path / "lines.vtk")
    files = {
        "part.inp": head + "*ELEMENT, TYPE=S3\n1, 1, 2, 3\n",
        "solids.inp": head + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n",
        "lost.inp": "*ELEMENT, TYPE=S3\n6, 1, 2, 3\n7, 1, 2, 9\n" + head,
        "short.inp": head + "*ELEMENT, TYPE=S3\n1, 1, 2\n",
        "circle.inp": "*INCLUDE, INPUT=circle.inp\n",
        "six.inp": head
        + "5, 4., 0.\n6, 4., 4.\n7, 0., 4.\n*ELEMENT, TYPE=S6\n1, 1, 2, 3, 5, 6, 7\n",
        "broken.vtu": "<VTKFile type='UnstructuredGrid'><Piece",
        "part.xyz": "1 2 3",
        "out.csv": "there before",
        "out.inp": "there before",
    }
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    arguments, expected = BAD[name]
    assert command(*(word.format(run=unsheared, dir=tmp_path) for word in arguments)) == 2
    printed = capfd.readouterr()
    assert expected in printed.err and len(printed.err.splitlines()) == 1, printed.err
    assert printed.out == ""
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
