"""The beam oracle against closed forms: elastica, end moment, buckling, thin arches, rigid arms."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_bvp
from scipy.optimize import brentq
from scipy.special import ellipeinc, ellipk, ellipkinc

from . import beam, centreline

INEXTENSIBLE = beam.Section(axial=np.inf, shear=np.inf, bending=1.0)
RECTANGLE = beam.Section.rectangle(young=1770.0, poisson=0.42, thickness=2.0, depth=10.0)


def cantilever(section, end, *, length=1.0, **options):
    line = centreline.straight((0.0, 0.0), (length, 0.0))
    return beam.solve(beam.Beam(line, section), beam.CLAMPED, end, **options)


@pytest.mark.parametrize(
    "load, x, w",
    [
        (10.0 / 9.0, 0.93263, 0.32860),
        (10.0 / 3.0, 0.71871, 0.62897),
        (50.0 / 9.0, 0.58506, 0.73211),
        (10.0, 0.44500, 0.81061),
    ],
)
def test_dead_tip_load_gives_the_published_elastica(load, x, w):
    stiff = beam.Section(axial=1e12, shear=1e12, bending=1.0)
    solution = cantilever(stiff, beam.End(force_y=load))
    assert solution.position[-1] == pytest.approx([x, w], abs=6e-6)


@pytest.mark.parametrize("tip_angle", [0.1, 0.8, 1.4])
def test_dead_tip_load_gives_the_elliptic_integrals(tip_angle):
    # p² = (1 + sin φ) / 2, sin δ = 1 / (p √2), √(PL²/EI) = K(p) − F(p, δ)
    m = 0.5 * (1.0 + np.sin(tip_angle))
    delta = np.arcsin(1.0 / np.sqrt(2.0 * m))
    root = ellipk(m) - ellipkinc(delta, m)
    complete = ellipeinc(0.5 * np.pi, m)
    solution = cantilever(INEXTENSIBLE, beam.End(force_y=root**2))
    expected = [np.sqrt(2.0 * np.sin(tip_angle)) / root, 1.0 - 2.0 * (complete - ellipeinc(delta, m)) / root]
    assert solution.position[-1] == pytest.approx(expected, abs=1e-11)
    assert solution.end.rotation == pytest.approx(tip_angle, abs=1e-11)


@pytest.mark.parametrize("turn", [0.5, np.pi, 4.0 * np.pi])
def test_end_moment_bends_a_straight_beam_into_a_circle(turn):
    length = 3.0
    solution = cantilever(RECTANGLE, beam.End(moment=RECTANGLE.bending * turn / length), length=length)
    expected = [length * (np.sin(turn) / turn - 1.0), length / turn * (1.0 - np.cos(turn))]
    assert solution.end.displacement == pytest.approx(expected, abs=1e-10)
    assert solution.end.rotation == pytest.approx(turn, abs=1e-10)


def test_small_transverse_load_gives_the_timoshenko_deflection():
    length, load = 20.0, 1e-7
    deflection = cantilever(RECTANGLE, beam.End(force_y=load), length=length).end.displacement[1]
    assert deflection == pytest.approx(
        load * (length**3 / (3.0 * RECTANGLE.bending) + length / RECTANGLE.shear), rel=1e-9
    )


def test_pull_along_the_axis_stretches_a_straight_beam():
    length, load = 20.0, 3000.0
    solution = cantilever(RECTANGLE, beam.End(force_x=load), length=length)
    assert solution.end.displacement == pytest.approx([load * length / RECTANGLE.axial, 0.0], abs=1e-10)


def column_moment(load, section, length, turn):
    """End moment that holds a pinned column of axial ``load`` at the end rotation ``turn`` of a half wave."""
    line = centreline.straight((0.0, 0.0), (length, 0.0))
    start = beam.End(x=0.0, y=0.0, rotation=turn)
    return beam.solve(beam.Beam(line, section), start, beam.End(y=0.0, force_x=-load)).start.moment


def test_pinned_column_loses_its_stiffness_at_the_euler_load():
    length = 2.0
    critical = brentq(column_moment, 0.5, 4.0, args=(INEXTENSIBLE, length, 1e-6), xtol=1e-12)
    assert critical == pytest.approx(np.pi**2 / length**2, rel=1e-10)


def test_compressible_shearable_column_buckles_at_the_load_of_reissner():
    # P (1 − P/EA + P/kGA) = π² EI / L²
    section = beam.Section(axial=20.0, shear=8.0, bending=1.0)
    length = 2.0
    critical = brentq(column_moment, 0.5, 3.0, args=(section, length, 1e-6), xtol=1e-12)
    balance = critical * (1.0 - critical / section.axial + critical / section.shear)
    assert balance == pytest.approx(np.pi**2 / length**2, rel=1e-10)


@pytest.mark.parametrize("turn", [0.3, 1.5])
def test_buckled_column_follows_the_elastica(turn):
    # P = 4 K(k)² EI / L², k = sin(α/2)
    length = 1.0
    exact = 4.0 * ellipk(np.sin(0.5 * turn) ** 2) ** 2
    load = brentq(column_moment, 0.9 * exact, 1.1 * exact, args=(INEXTENSIBLE, length, turn), xtol=1e-11)
    assert load == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("rigid", [(0.0, 0.0), (3.0, 5.0)])
def test_thin_arch_between_pins_has_the_compliance_of_castigliano(rigid):
    # ∂u/∂F = ∫ y²/EI + cos²φ/EA + sin²φ/kGA over the part that is not rigid, φ measured from the chord
    radius, opening, force = 30.0, 2.0, 1e-6
    line = centreline.arc(radius, -opening, heading=0.5 * opening)
    link = beam.pinned_pinned(beam.between_pins(line, RECTANGLE, rigid=rigid), force=force)

    def density(s):
        phi = 0.5 * opening - s / radius
        y = radius * (np.cos(phi) - np.cos(0.5 * opening))
        bent = y**2 / RECTANGLE.bending
        return bent + np.cos(phi) ** 2 / RECTANGLE.axial + np.sin(phi) ** 2 / RECTANGLE.shear

    compliance = quad(density, rigid[0], line.length - rigid[1], epsabs=0.0, epsrel=1e-12)[0]
    assert link.extension == pytest.approx(force * compliance, rel=1e-7)
    assert link.force == pytest.approx(force, rel=1e-12)


def test_rigid_arm_turns_with_the_end_of_the_beam():
    # end moment t: the tip of an arm of length r lies at (sin t / t, (1 − cos t) / t) L + r (cos t, sin t)
    length, arm, turn = 2.0, 0.7, 2.5
    line = centreline.straight((0.0, 0.0), (length, 0.0))
    arms = beam.Beam(line, INEXTENSIBLE, end_pin=(length + arm, 0.0))
    solution = beam.solve(arms, beam.CLAMPED, beam.End(moment=turn / length))
    tip = np.array([np.sin(turn), 1.0 - np.cos(turn)]) * length / turn + arm * np.array([np.cos(turn), np.sin(turn)])
    assert solution.end.displacement == pytest.approx(tip - [length + arm, 0.0], abs=1e-11)


def wavy():
    """A curved link that is neither symmetric nor of constant curvature."""
    return centreline.through([(0.0, 0.0), (18.0, 12.0), (40.0, 14.0), (60.0, 4.0), (80.0, 9.0)])


def test_force_is_the_derivative_of_the_energy():
    link = beam.between_pins(wavy(), RECTANGLE, rigid=(4.0, 3.0))
    middle, step = -6.0, 0.02
    energies = [beam.pinned_pinned(link, extension=middle + k * step).solution.energy for k in (-2, -1, 1, 2)]
    slope = (energies[0] - 8.0 * energies[1] + 8.0 * energies[2] - energies[3]) / (12.0 * step)
    assert beam.pinned_pinned(link, extension=middle).force == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize("extension", [-20.0, 1.5])
def test_force_and_extension_of_a_pinned_link_are_inverse(extension):
    link = beam.between_pins(wavy(), RECTANGLE, rigid=(3.0, 3.0))
    pulled = beam.pinned_pinned(link, extension=extension)
    assert pulled.force * extension > 0.0
    assert beam.pinned_pinned(link, force=pulled.force).extension == pytest.approx(extension, rel=1e-9)
    assert pulled.solution.start.moment == pytest.approx(0.0, abs=1e-9)
    assert pulled.solution.start.force == pytest.approx(-pulled.solution.end.force, rel=1e-12)


@pytest.mark.parametrize("extension", [-30.0, 1.5])
def test_twice_the_elements_change_nothing(extension):
    link = beam.between_pins(wavy(), RECTANGLE, rigid=(3.0, 3.0))
    coarse, fine = (beam.pinned_pinned(link, extension=extension, elements=n).force for n in (32, 64))
    assert coarse == pytest.approx(fine, rel=1e-9)


def test_other_units_change_nothing():
    points = np.array([(0.0, 0.0), (18.0, 12.0), (40.0, 14.0), (60.0, 4.0)])
    forces = []
    for metre in (1.0, 1e-3):  # mm and MPa, then m and Pa: forces in N in both
        section = beam.Section.rectangle(
            young=1770.0 / metre**2, poisson=0.42, thickness=2.0 * metre, depth=10.0 * metre
        )
        link = beam.between_pins(centreline.through(points * metre), section, rigid=(3.0 * metre, 3.0 * metre))
        forces.append(beam.pinned_pinned(link, extension=-10.0 * metre).force)
    assert forces[0] == pytest.approx(forces[1], rel=1e-10)


def test_prescribed_pins_carry_the_beam_rigidly_without_force():
    turn, shift = 2.0, np.array([5.0, -7.0])
    link = beam.between_pins(wavy(), RECTANGLE, rigid=(4.0, 3.0))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    start, end = (shift + (rotation - np.eye(2)) @ pin for pin in link.pins())
    solution = beam.solve(link, beam.End(*start, rotation=turn), beam.End(*end, rotation=turn))
    assert solution.end.force == pytest.approx([0.0, 0.0], abs=1e-9)
    assert solution.energy == pytest.approx(0.0, abs=1e-15)
    assert solution.rotation == pytest.approx(turn, abs=1e-12)


def test_a_general_solver_of_boundary_value_problems_agrees():
    # the same equations in (x, y, φ, M, H, V), straight from Reissner, by SciPy
    ea, ga, ei = 900.0, 400.0, 2.0
    line = centreline.arc(1.0, 1.5, heading=-0.4)
    load = np.array([1.3, -2.1])

    def rates(s, state):
        _, _, phi, moment, h, v = state
        normal, shear = h * np.cos(phi) + v * np.sin(phi), v * np.cos(phi) - h * np.sin(phi)
        dx = (1.0 + normal / ea) * np.cos(phi) - shear / ga * np.sin(phi)
        dy = (1.0 + normal / ea) * np.sin(phi) + shear / ga * np.cos(phi)
        return np.stack([dx, dy, 1.0 + moment / ei, dy * h - dx * v, 0.0 * h, 0.0 * v])

    def ends(a, b):
        return np.array([a[0], a[1], a[2] + 0.4, b[3] - 0.3, b[4] - load[0], b[5] - load[1]])

    s = np.linspace(0.0, line.length, 41)
    guess = np.vstack([line.position(s).T, line.angle(s), np.zeros((3, s.size))])
    reference = solve_bvp(rates, ends, s, guess, tol=1e-9, max_nodes=20000)
    solution = beam.solve(
        beam.Beam(line, beam.Section(ea, ga, ei)), beam.CLAMPED, beam.End(force_x=load[0], force_y=load[1], moment=0.3)
    )
    assert reference.success
    assert solution.position[-1] == pytest.approx(reference.y[:2, -1], abs=1e-8)
    assert solution.start.moment == pytest.approx(-reference.y[3, 0], abs=1e-8)


def test_solution_continues_from_another_one():
    line = centreline.straight((0.0, 0.0), (1.0, 0.0))
    rod = beam.Beam(line, INEXTENSIBLE)
    first = beam.solve(rod, beam.CLAMPED, beam.End(force_y=3.0))
    continued = beam.solve(rod, beam.CLAMPED, beam.End(force_y=10.0), initial=first)
    direct = beam.solve(rod, beam.CLAMPED, beam.End(force_y=10.0))
    assert continued.position == pytest.approx(direct.position, abs=1e-11)


def test_a_beam_that_nothing_holds_is_refused():
    with pytest.raises(RuntimeError, match="no equilibrium"):
        beam.solve(beam.Beam(wavy(), RECTANGLE), beam.FREE, beam.End(force_x=1.0))


def test_a_centreline_whose_angle_is_not_its_tangent_is_refused():
    wrong = centreline.from_function(lambda s: (s, 0.0, 0.1), 1.0)
    with pytest.raises(ValueError, match="angle integrates to"):
        beam.solve(beam.Beam(wrong, INEXTENSIBLE), beam.CLAMPED, beam.FREE)


def test_plane_strain_stiffens_the_section():
    plane = beam.Section.rectangle(young=10.0, poisson=0.3, thickness=2.0, depth=6.0)
    strain = beam.Section.rectangle(young=10.0, poisson=0.3, thickness=2.0, depth=6.0, plane_strain=True)
    assert (plane.axial, plane.bending) == pytest.approx((120.0, 40.0))
    assert plane.shear == pytest.approx(120.0 * 5.0 / 6.0 / 2.6)
    assert strain.bending == pytest.approx(plane.bending / 0.91)
    assert strain.shear == plane.shear
