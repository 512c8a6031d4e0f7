"""Sections and their laws: at zero strain, pulled, bent, sheared, and in a beam.

Most is asked of the laws without a mesh: on plain numbers UFL evaluates them as they are written
down. Derivatives there are complex steps, Im f(e + i h v)/h, exact to round-off.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.optimize import brentq, fsolve
from solve import Statics, orders, set_loads, taylor_remainders

from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.fabric.section import CoupledSection, RectangularSection
from fabric_fenicsx.mechanics.neo_hookean import neo_hookean_section
from fabric_fenicsx.mechanics.section_laws import LINEAR, PACKED, coupled_section
from fabric_fenicsx.solving.model import Model, Support

A, B, C1 = 3.0, 2.0, 10.0
COMPRESSIBILITIES = (0.0, 0.02, 1.0)


def rectangle(d, **changes):
    """The test rectangle with C1 D1 = d."""
    return RectangularSection(
        **{"width": A, "height": B, "density": 1e-9, "C1": C1} | changes, D1=d / C1
    )


def numbers(vector):
    """Components of a UFL vector of plain numbers; one of zeros alone has no operands."""
    return np.array([complex(c) for c in vector.ufl_operands] or [0j] * 6)


def law_of(section, **options):
    """Forces and energy on numbers, of the section's Neo-Hookean law."""
    d = section.compressibility
    law = neo_hookean_section(d if d > 0.0 else None, **options)
    fields = SimpleNamespace(stiffness=[float(c) for c in section.stiffness()])

    def forces(e):
        return numbers(law.forces(fields, list(e)))

    def energy(e):
        return complex(law.energy(fields, list(e)))

    return forces, energy


def complex_step(f, e):
    """Derivatives of f with respect to the six strains."""
    h = 1e-30
    e = np.asarray(e, dtype=complex)
    return np.array([np.imag(f(e + 1j * h * v)) / h for v in np.eye(6)]).T


def strains(seed, size=0.1):
    """Random strains, curvatures such that the edges strain by about ``size`` too."""
    return size * np.random.default_rng(seed).normal(size=6) / [1, 1, 1, A, A, A]


# Sections ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["width", "height", "density", "C1", "shear_correction"])
def test_rectangle_wants_positive_numbers(name):
    with pytest.raises(ValueError, match=f"section: {name} is 0.0; it must be positive"):
        rectangle(0.0, **{name: 0.0})


def test_rectangle_wants_no_negative_compressibility():
    with pytest.raises(ValueError, match=r"D1 is -0\.1; it must not be negative"):
        rectangle(-1.0)


def spd(rng):
    L = rng.normal(size=(6, 6))
    scale = np.array([1e6, 1e5, 1e5, 1e2, 1e2, 1e3]) ** 0.5
    return (L @ L.T + np.eye(6)) * np.outer(scale, scale)


def test_coupled_section_keeps_its_matrix():
    C = spd(np.random.default_rng(1))
    section = CoupledSection(tuple(map(tuple, C)), (1.0, 2.0, 3.0, 4.0))
    np.testing.assert_allclose(section.stiffness(), C, rtol=1e-14)
    np.testing.assert_array_equal(section.mass(), [1.0, 2.0, 3.0, 4.0])


def test_coupled_section_without_coupling_is_a_diagonal():
    section = CoupledSection(tuple(map(tuple, np.diag(np.arange(1.0, 7.0)))))
    np.testing.assert_array_equal(section.stiffness(), np.arange(1.0, 7.0))


def changed(C, entries):
    C = C.copy()
    for place, value in entries.items():
        C[place] = value
    return C


GOOD = np.diag([1e6, 1e5, 1e5, 1e2, 1e2, 1e3])
BAD = {
    "shape": (GOOD[:5], r"the shape \(5, 6\); it must be \(6, 6\)"),
    "not finite": (changed(GOOD, {(0, 0): np.nan}), "not finite"),
    "diagonal": (changed(GOOD, {(3, 3): -1.0}), "not positive definite: it has -1.0"),
    "symmetry": (changed(GOOD, {(3, 4): 1.0}), r"not symmetric: entry \(4, 5\) is 1.0"),
    "definite": (
        changed(GOOD, {(3, 4): 101.0, (4, 3): 101.0}),
        "not positive definite: scaled to a unit diagonal its smallest eigenvalue is -0.01",
    ),
}


@pytest.mark.parametrize(("matrix", "message"), BAD.values(), ids=BAD)
def test_coupled_section_checks_its_matrix(matrix, message):
    with pytest.raises(ValueError, match=message):
        CoupledSection(tuple(map(tuple, matrix)))


def test_coupled_section_sees_asymmetry_of_small_entries():
    # 1e-3 of the root of its diagonals, though 1e-8 of the largest stiffness.
    with pytest.raises(ValueError, match="not symmetric"):
        CoupledSection(tuple(map(tuple, changed(GOOD, {(3, 5): 0.3, (5, 3): 0.6}))))


def test_ragged_matrix():
    with pytest.raises(ValueError, match="section: its numbers make no array"):
        CoupledSection(((1.0,), (1.0, 2.0)))


@pytest.mark.parametrize(
    ("masses", "message"), [((1.0, 1.0, 1.0), r"\(3,\); it must be \(4,\)"), ((1, 1, -1, 1), "-1")]
)
def test_coupled_section_checks_its_masses(masses, message):
    with pytest.raises(ValueError, match=message):
        CoupledSection(tuple(map(tuple, GOOD)), masses)


# The linear laws --------------------------------------------------------------------------------


def test_coupled_law_is_the_matrix():
    C, e = spd(np.random.default_rng(2)), strains(3)
    law = coupled_section([float(C[i, j]) for i, j in PACKED])
    found = numbers(law.forces(None, list(e))).real
    np.testing.assert_allclose(found, C @ e, rtol=1e-13)


# The Neo-Hookean law ----------------------------------------------------------------------------


@pytest.mark.parametrize("d", COMPRESSIBILITIES)
def test_stiffness_at_zero_strain(d):
    """E = 6 C1/(1 + d/3), G = 2 C1: from the bulk modulus 2/D1; d = 0 is 6 C1 and 2 C1."""
    section = rectangle(d)
    forces, _ = law_of(section)
    E, G = 6.0 * C1 / (1.0 + d / 3.0), 2.0 * C1
    # Torsion constant of a rectangle 3 by 2 by Saint-Venant's series (Timoshenko & Goodier).
    n = np.arange(1, 40, 2)
    J = A * B**3 * (1 / 3 - 64 / np.pi**5 * B / A * np.sum(np.tanh(n * np.pi * A / 2 / B) / n**5))
    shear = 5.0 / 6.0 * G * A * B
    exact = [E * A * B, shear, shear, G * J, E * A * B**3 / 12.0, E * B * A**3 / 12.0]
    found = complex_step(forces, np.zeros(6))
    # The section's torsion constant is one term of that series: 0.5 %.
    tolerance = np.array([1e-13, 1e-13, 1e-13, 5e-3, 1e-13, 1e-13])
    assert (np.abs(np.diag(found) / exact - 1.0) < tolerance).all(), f"{found}"
    np.testing.assert_allclose(np.diag(found), section.stiffness(), rtol=1e-13)
    np.testing.assert_allclose(found - np.diag(np.diag(found)), 0.0, atol=1e-11)
    np.testing.assert_allclose(forces(np.zeros(6)).real, 0.0, atol=1e-12)


@pytest.mark.parametrize("stretch", [0.5, 0.9, 1.0 + 1e-9, 1.1, 2.0])
def test_uniaxial_is_exact(stretch):
    """N = 2 C1 A (λ − λ⁻²) for the incompressible solid."""
    forces, energy = law_of(rectangle(0.0))
    e = [stretch - 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    exact = 2.0 * C1 * A * B * (stretch - stretch**-2)
    # λ − λ⁻² has the round-off of 1.
    np.testing.assert_allclose(
        forces(e), [exact, 0, 0, 0, 0, 0], rtol=1e-13, atol=1e-13 * C1 * A * B
    )
    W = C1 * A * B * (stretch**2 + 2.0 / stretch - 3.0)
    assert energy(e) == pytest.approx(W, rel=1e-12, abs=1e-13)


def lateral(lam, d):
    """(J, m) of a compressible Neo-Hookean bar pulled to λ, from its lateral stress alone."""

    def stress(m):
        J = lam * m * m
        I1 = lam**2 + 2.0 * m**2
        return 2.0 * J ** (-2.0 / 3.0) * (m - I1 / 3.0 / m) + 2.0 / d * (J - 1.0) * lam * m

    m = brentq(stress, 0.3, 2.0, xtol=1e-15)
    return lam * m * m, m


@pytest.mark.parametrize("d", [1e-4, 0.02, 1.0])
@pytest.mark.parametrize("stretch", [0.7, 0.95, 1.2, 1.5])
def test_compressible_bar(d, stretch):
    """N = A ∂W/∂λ with the lateral stretch that is free of stress, found by its own root."""
    forces, energy = law_of(rectangle(d))
    J, m = lateral(stretch, d)
    I1 = stretch**2 + 2.0 * m**2
    first = J ** (-2.0 / 3.0) * (2.0 * stretch - 2.0 / 3.0 * I1 / stretch)
    N = A * B * C1 * (first + 2.0 / d * (J - 1.0) * m * m)
    W = A * B * C1 * (J ** (-2.0 / 3.0) * I1 - 3.0 + (J - 1.0) ** 2 / d)
    e = [stretch - 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    # The reference divides the root's round-off by d: 1e-15/1e-4.
    assert forces(e)[0].real == pytest.approx(N, rel=1e-10)
    assert energy(e).real == pytest.approx(W, rel=1e-10, abs=1e-12 * N**2)


def test_lateral_contraction_is_that_of_poisson():
    """Small strain: m − 1 = −ν ε; E, G and ν fit together, E = 2 G (1 + ν)."""
    for d in (0.02, 1.0):
        section = rectangle(d)
        nu = (3.0 - 2.0 * d) / (6.0 + 2.0 * d)
        assert section.youngs_modulus == pytest.approx(2.0 * section.shear_modulus * (1.0 + nu))
        assert (lateral(1.0 + 1e-5, d)[1] - 1.0) / 1e-5 == pytest.approx(-nu, rel=1e-4)


@pytest.mark.parametrize("d", COMPRESSIBILITIES)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_forces_are_the_gradient_of_the_energy(d, seed):
    forces, energy = law_of(rectangle(d))
    e = strains(seed)
    np.testing.assert_allclose(complex_step(energy, e), forces(e).real, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("d", COMPRESSIBILITIES)
def test_energy_by_taylor(d):
    """W(e + ε v) − W(e) − ε s·v falls with ε²."""
    forces, energy = law_of(rectangle(d))
    e, v = strains(4), strains(5, 1.0)
    left = [
        abs((energy(e + eps * v) - energy(e)).real - eps * forces(e).real @ v)
        for eps in 0.02 / 2.0 ** np.arange(4)
    ]
    assert (np.abs(orders(left) - 2.0) < 0.1).all(), f"orders {orders(left)}"


@pytest.mark.parametrize("d", COMPRESSIBILITIES)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_section_tangent_is_symmetric(d, seed):
    forces, _ = law_of(rectangle(d))
    C = complex_step(forces, strains(seed))
    np.testing.assert_allclose(C, C.T, atol=1e-7 * np.abs(C).max())
    # Couplings that the linear law does not have.
    assert abs(C[0, 4]) > 0.01 * np.sqrt(C[0, 0] * C[4, 4])


def test_three_halley_steps_are_enough():
    """Symmetry holds only where the lateral stress vanishes: how far it does at what strain."""
    for size, bound in ((0.05, 1e-13), (0.1, 1e-10), (0.15, 1e-5)):
        forces, _ = law_of(rectangle(1.0))
        asymmetry = [
            np.abs(C - C.T).max() / np.abs(C).max()
            for C in (complex_step(forces, strains(seed, size)) for seed in range(10))
        ]
        assert max(asymmetry) < bound, f"strain {size}: {max(asymmetry)}"


def test_compressible_tends_to_incompressible():
    """The difference is of first order in D1."""
    e = strains(6)
    exact, W = (f(e) for f in law_of(rectangle(0.0)))
    found = [law_of(rectangle(d)) for d in (0.04, 0.02, 0.01)]
    forces = [np.abs(f(e) - exact).max() for f, _ in found]
    energies = [abs(w(e) - W) for _, w in found]
    np.testing.assert_allclose(orders(forces), 1.0, atol=0.05)
    np.testing.assert_allclose(orders(energies), 1.0, atol=0.05)


def test_at_d_zero_both_laws_are_the_same():
    section, e = rectangle(0.0), strains(7)
    fields = SimpleNamespace(stiffness=[float(c) for c in section.stiffness()])
    law = neo_hookean_section(0.0)
    found = numbers(law.forces(fields, list(e)))
    np.testing.assert_allclose(found, law_of(section)[0](e), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("d", COMPRESSIBILITIES)
def test_mirrored_strains_give_mirrored_forces(d):
    """The rectangle's symmetries: no force knows left from right, or front from back."""
    forces, _ = law_of(rectangle(d))
    e = strains(8)
    # Mirrored along d2, along d3, and both (half a turn about the tow).
    for mirror in ([1, -1, 1, -1, 1, -1], [1, 1, -1, -1, -1, 1], [1, -1, -1, 1, -1, -1]):
        np.testing.assert_allclose(forces(mirror * e), mirror * forces(e), rtol=1e-12, atol=1e-13)


# Bending ----------------------------------------------------------------------------------------


def bent(curvature, gamma=0.0):
    """(N, M2) of the incompressible strip bent about d2, by adaptive quadrature."""

    def stress(z):
        lam = 1.0 + gamma + curvature * z
        return 2.0 * C1 * A * (lam - lam**-2)

    ends = (-B / 2.0, B / 2.0)
    return quad(stress, *ends)[0], quad(lambda z: z * stress(z), *ends)[0]


@pytest.mark.parametrize("points", [2, 3, 4, 6])
@pytest.mark.parametrize("edge", [0.05, 0.1, 0.3])
def test_bending_by_gauss_points(edge, points):
    """Against scipy. n Gauss points integrate z λ⁻² up to the term ε^(2n−1).

    λ⁻² = Σ (−1)^k (k + 1) ε^k: the first term not integrated exactly in M is 2n ε^(2n) over
    the leading 3 ε²/3; the error of Gauss's rule in ∫ t^(2n) is the integral of the square of the
    Legendre polynomial divided by its leading coefficient, 2/(2n + 1)/k_n².
    """
    forces, _ = law_of(rectangle(0.0), points=points)
    exact = bent(2.0 * edge / B)
    found = forces([0.0, 0.0, 0.0, 0.0, 2.0 * edge / B, 0.0]).real[[0, 4]]
    leading = np.polynomial.legendre.leg2poly([0] * points + [1])[-1]
    missed = 2.0 / (2 * points + 1) / leading**2
    first = 2 * points * missed / 2.0 * edge ** (2 * points - 2)
    error = abs(found[1] / exact[1] - 1.0)
    # Later terms add to the first: at an edge strain of 0.3 by less than its triple.
    assert 0.3 * first < error + 1e-14 and error < 3.0 * first + 1e-13, f"{error}, {first}"


def test_bending_about_both_axes_stretched():
    forces, _ = law_of(rectangle(0.0), points=8)
    e = np.array([0.1, 0.0, 0.0, 0.0, 0.15, -0.1])

    def integral(factor):
        def f(z, y):
            lam = 1.0 + e[0] + e[4] * z - e[5] * y
            return 2.0 * C1 * (lam - lam**-2) * factor(y, z)

        return dblquad(f, -A / 2, A / 2, -B / 2, B / 2, epsabs=1e-11)[0]

    exact = [integral(lambda y, z: 1.0), integral(lambda y, z: z), integral(lambda y, z: -y)]
    np.testing.assert_allclose(forces(e).real[[0, 4, 5]], exact, rtol=1e-9)


def test_bending_stiffens_and_shifts_the_neutral_axis():
    """Compression is the stiffer side: pure bending draws the middle line out.

    To second order, with N = 0: 3 Γ1 = 3 K² b²/12, so Γ1 = K² b²/12.
    """
    K = 0.02
    shift = brentq(lambda g: bent(K, g)[0], 0.0, 0.1, xtol=1e-15)
    assert shift == pytest.approx(K**2 * B**2 / 12.0, rel=1e-3)
    forces, _ = law_of(rectangle(0.0))
    assert abs(forces([shift, 0, 0, 0, K, 0])[0]) < 1e-7


# In a beam --------------------------------------------------------------------------------------

CLAMPED = (0, 1, 2, 3, 4, 5)


def beam_model(section, law, cells=8, length=40.0, **options):
    net = single_tow(np.linspace(0.0, length, cells + 1)[:, None] * [1.0, 0, 0], (0, 0, 1))
    return Model(
        net, section, section_law=law, supports=[Support(np.array([0]), CLAMPED)], **options
    )


@pytest.mark.parametrize("d", [0.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_strip_in_pure_bending(d):
    """An end moment: the cells' strains are those at which the section's law is in balance."""
    cells = 8
    section = rectangle(d)
    model = beam_model(section, "neo_hookean", cells)
    # To an edge strain of about 0.13: half a circle.
    moment = 0.13 * section.stiffness()[4]
    statics = Statics(model, force_tolerance=1e-9)
    statics.run(4, lambda part: set_loads(model, cells, [0, 0, 0, 0, part * moment, 0]))
    iterations = [o.iterations for o in statics.outcomes]
    assert max(iterations) <= 7, f"{iterations}"
    found = model.disc.cell_values(model.fields.strain_n)
    if d == 0.0:
        # Here the Gauss points leave 4e-5 of the moment, see POINTS.
        gamma, K = fsolve(lambda x: np.subtract(bent(x[1], x[0]), (0.0, moment)), [0.0, 0.1])
        np.testing.assert_allclose(found[:, 4], K, rtol=1e-4)
        np.testing.assert_allclose(found[:, 0], gamma, rtol=5e-4)
    forces, _ = law_of(section)
    for e in found:
        # A cell turns by 0.65 rad: its curvature's conjugate is M (1 + tan⁶ 0.16), by 2e-5 off M.
        np.testing.assert_allclose(forces(e).real, [0, 0, 0, 0, moment, 0], atol=5e-5 * moment)


def test_bar_pulled_to_twice_its_length():
    section = rectangle(0.0)
    model = beam_model(section, "neo_hookean", 4)
    force = 2.0 * C1 * A * B * (2.0 - 0.25)
    statics = Statics(model, force_tolerance=1e-9)
    statics.run(4, lambda part: set_loads(model, 4, [part * force, 0, 0, 0, 0, 0]))
    np.testing.assert_allclose(statics.displacements[-1], [40.0, 0.0, 0.0], rtol=1e-9, atol=1e-9)


def laminate(section):
    """The section with every coupling that a positive matrix of these diagonals may have."""
    root = np.sqrt(section.stiffness())
    C = np.outer(root, root) * (np.eye(6) + 0.1 * np.cos(np.add.outer(range(6), range(6))))
    return CoupledSection(tuple(map(tuple, C)), tuple(section.mass()))


@pytest.mark.parametrize("kind", ["coupled", "incompressible", "compressible"])
def test_beam_tangent_and_energy_by_taylor(kind):
    """The beam's tangent is the derivative of its residual, with viscosity, for every law."""
    rng = np.random.default_rng(5)
    section = rectangle(1.0 if kind == "compressible" else 0.0)
    law = "neo_hookean" if "compressible" in kind else "linear"
    given = section if law == "neo_hookean" else laminate(section)
    cells = 4
    net = single_tow(np.linspace(0.0, 8.0, cells + 1)[:, None] * [1.0, 0, 0], (0, 0, 1))
    model = Model(net, given, section_law=law, viscosity=0.3)
    model.set_time(0.0, 1.0)
    system, disc = model.system, model.disc
    x, y, v, F = (disc.vector() for _ in range(4))
    x.array[:] = 0.1 * rng.normal(size=x.local_size)
    v.array[:] = rng.normal(size=x.local_size)
    found = orders(taylor_remainders(model, x, v, largest=4e-3))
    assert (np.abs(found - 2.0) < 0.1).all(), f"orders {found}"
    # Without viscosity the residual is the gradient of the energy.
    model.relaxation.value = 0.0
    system.set_increment(x)
    system.residual(F)
    work, W = F.array_r @ v.array_r, system.energies()["tows"]
    left = []
    for eps in 4e-3 / 2.0 ** np.arange(4):
        y.array[:] = x.array_r + eps * v.array_r
        system.set_increment(y)
        left.append(abs(system.energies()["tows"] - W - eps * work))
    assert (np.abs(orders(left) - 2.0) < 0.1).all(), f"orders {orders(left)}"


@pytest.mark.mpi
def test_thin_tow_hardly_knows_the_difference():
    """The paper's tow in bending: its edge strains by b K/2, so both laws agree to that squared.

    And Newton needs as many steps.
    """
    tow = RectangularSection(width=4.57, height=0.04, density=7e-9, C1=6e4)
    ends, steps = [], []
    for law in ("linear", "neo_hookean"):
        cells = 24
        model = beam_model(tow, law, cells, length=72.0)
        statics = Statics(model, force_tolerance=1e-8)
        load = np.array([0, 0, -4.0 * tow.stiffness()[4] / 72.0**2, 0, 0, 0])
        statics.run(4, lambda part, m=model, f=load: set_loads(m, 24, part * f))
        ends.append(statics.displacements[-1])
        steps.append([outcome.iterations for outcome in statics.outcomes])
    # Largest curvature P L/B = 4/72: an edge strain of 1.1e-3.
    np.testing.assert_allclose(ends[0], ends[1], atol=3e-6 * 72.0)
    assert ends[0][2] < -40.0
    assert sum(steps[1]) <= sum(steps[0]) + 2, f"{steps}"


def test_law_and_section_must_fit():
    section = rectangle(0.0)
    with pytest.raises(ValueError, match="needs rectangular sections"):
        beam_model(laminate(section), "neo_hookean")
    with pytest.raises(ValueError, match="unknown section law 'rubber'"):
        beam_model(section, "rubber")


def test_diagonal_sections_keep_the_plain_law():
    section = rectangle(0.0)
    diagonal = CoupledSection(tuple(map(tuple, np.diag(section.stiffness()))))
    assert beam_model(section, "linear").elastic is LINEAR
    assert beam_model(diagonal, "linear").elastic is LINEAR
    assert beam_model((section, laminate(section)), "linear").elastic is not LINEAR
