"""Half of the links stands for the whole: the same equilibria as in space on the mirrored mesh, from half the unknowns.

The mesh of the whole is the mirror image of the half beside it wherever its depth is an even number of layers.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.effects import Contact, Cylinder, Gravity, JointCompliance, JointSpring, Mass, Pressure, Prestrain
from fenicsmech.mechanism import Effect, Force

from ..design.refusal import refused
from .demo_scenes import describe

PLASTIC = fm.Material("plastic", 2000.0, 0.35, density=1e-9)
RUBBER = fm.Material("rubber", 5.0, 0.45, density=2e-8)
MESHES = Path(__file__).parents[2] / "meshes"
WHOLE, HALF = "3d", "3d-symmetric"
SHARES = (0.1, 0.4, 1.4)  # of the buckling load in the plane


def arch(effects: Callable[[fm.Mechanism], list[Effect]] = lambda mechanism: [], **options) -> tuple[fm.Scene, Force]:
    """A bowed link between hinges, one of them on a slide that is pushed; 8 mm deep."""
    mechanism = fm.Mechanism("arch")
    ground, slide = mechanism.rigid("ground", fixed=True), mechanism.rigid("slide")
    shape = fm.strip([(0, 0), (20, 9), (40, 0)], thickness=3.0, depth=8.0)
    bow = mechanism.flexible("bow", shape, options.get("material", PLASTIC))
    mechanism.revolute(ground, bow, at=(0, 0), interface_radius=2.5)
    mechanism.revolute(bow, slide, at=(40, 0), interface_radius=2.5)
    mechanism.prismatic(ground, slide, at=(40, 0), axis=(1, 0))
    mechanism.output(on=bow, at=(20.2, 8.7), direction=(0.6, 0.8))
    push = mechanism.force(on=slide, at=(40, 0), direction=(-1, 0))
    return fm.Scene(mechanism, effects=effects(mechanism)), push


def pushed_arch() -> tuple[fm.Scene, Force]:
    """The arch under a force on itself."""
    scene, _ = arch()
    (bow,) = scene.mechanism.flexible_links
    return scene, scene.mechanism.force(on=bow, at=(15, 8), direction=(0.6, -0.8))


def four_bar() -> tuple[fm.Scene, Force]:
    """Two flexible links of different depth and material, driven by a motor, and a rigid coupler."""
    mechanism = fm.Mechanism("four-bar")
    ground, coupler = mechanism.rigid("ground", fixed=True), mechanism.rigid("coupler")
    left = mechanism.flexible("left", fm.strip([(0, 0), (-4, 15), (0, 30)], thickness=3.0, depth=12.0), PLASTIC)
    corners = [(37, -3), (43, -3), (44, 33), (36, 33)]
    right = mechanism.flexible("right", fm.polygon(corners, depth=24.0), RUBBER)
    shaft = mechanism.revolute(ground, left, at=(0, 0), interface_radius=2.0)
    mechanism.revolute(left, coupler, at=(0, 30), interface_radius=2.0)
    mechanism.weld(ground, right, at=(40, 0), region=fm.Rectangle(4, 4))
    mechanism.revolute(right, coupler, at=(40, 30), interface_radius=2.0)
    mechanism.motor(shaft)
    return fm.Scene(mechanism), mechanism.force(on=coupler, at=(20, 35), direction=(1, 0.3))


def simulate(scene: fm.Scene, space: str, **fidelity) -> fm.Simulation:
    return fm.Simulation(scene, space=space, **{"size": 2.0, "comm": MPI.COMM_SELF, **fidelity})


def assert_alike(whole: fm.Frame, half: fm.Frame, *, digits: float = 1e-9) -> None:
    """All that is read from a frame; reactions out of the plane are redundant in space."""
    assert half.displacement == pytest.approx(whole.displacement, rel=digits)
    assert half.strain_energy == pytest.approx(whole.strain_energy, rel=digits)
    assert half.max_stress == pytest.approx(whole.max_stress, rel=10 * digits)
    assert (half.unstable_modes, half.stable_under_control) == (whole.unstable_modes, whole.stable_under_control)
    assert [*half.outputs.values()] == pytest.approx([*whole.outputs.values()], rel=digits)
    largest = max(np.abs(reaction.force).max() for reaction in whole.reactions.values())
    for name, reaction in whole.reactions.items():
        assert half.reactions[name].force == pytest.approx(reaction.force[:2], abs=10 * digits * largest), name
        assert half.reactions[name].moment == pytest.approx(reaction.moment[2:], abs=100 * digits * largest), name
    torque = max(map(abs, whole.motors.values()), default=0.0)
    assert [*half.motors.values()] == pytest.approx([*whole.motors.values()], abs=10 * digits * torque)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("build", "order", "size", "forces", "position"),
    [
        (arch, 1, 2.0, [15.0, -15.0], 0.0),
        (arch, 2, 2.0, [15.0, 60.0], 0.0),
        (pushed_arch, 2, 2.0, [30.0, 90.0], 0.0),
        (four_bar, 2, 3.0, [0.5, 1.0], 0.1),
        (lambda: describe("claw"), 1, 2.125, [5.0, 10.0], -0.1),
    ],
    ids=["arch P1", "arch P2", "force on the arch", "four-bar", "claw"],
)
def test_half_and_mirrored_mesh_give_the_same_frames(build, order, size, forces, position):
    curves, estimates = [], []
    for space in (WHOLE, HALF):
        scene, push = build()
        simulation = simulate(scene, space, order=order, size=size)
        configuration = scene.configuration("turned", dict.fromkeys(scene.mechanism.motors, position))
        curves.append(simulation.load_displacement(push, forces=forces, configuration=configuration))
        estimates.append(curves[-1].error_estimates())
    for whole, half in zip(*(curve.frames for curve in curves), strict=True):
        assert_alike(whole, half)
    assert estimates[1] == pytest.approx(estimates[0], rel=1e-4)  # projections are solved to 1e-8


EFFECTS = {
    "gravity": lambda bow, slide, hinge: [Gravity((30.0, -9810.0), {slide: Mass(1e-6, (42, 1))})],
    "contact": lambda bow, slide, hinge: [Contact(bow, Cylinder((20.0, 16.0), 6.0))],
    "contact at points": lambda bow, slide, hinge: [
        Contact(slide, Cylinder((38.0, -3.0), 4.0), stiffness=2.0, points=[(39, 0)])
    ],
    "pressure from one side": lambda bow, slide, hinge: [
        Pressure(bow, 0.01, where=lambda x: x[:, 1] > 7.0, about=(20, 0))
    ],
    "spring": lambda bow, slide, hinge: [JointSpring(hinge, 20.0, rest=0.1)],
    "compliance": lambda bow, slide, hinge: [JointCompliance(hinge, 0.5)],
    "shrinking along the link": lambda bow, slide, hinge: [Prestrain(bow, 0.97, along=(1, 0))],
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", EFFECTS)
def test_effects_act_on_the_half_as_on_the_whole(name):
    def effects(mechanism: fm.Mechanism) -> list[Effect]:
        (bow,) = mechanism.flexible_links
        return EFFECTS[name](bow, mechanism.rigid_links[1], mechanism.joints[0])

    frames = []
    for space in (WHOLE, HALF):
        scene, push = arch(effects, material=RUBBER)
        (frame,) = simulate(scene, space, order=2, size=2.0).load_displacement(push, forces=[0.05]).frames
        frames.append(frame)
    assert_alike(*frames, digits=1e-8)
    scene, push = arch(material=RUBBER)
    (without,) = simulate(scene, HALF, order=2, size=2.0).load_displacement(push, forces=[0.05]).frames
    assert abs(without.displacement - frames[1].displacement) > 1e-3 * abs(without.displacement)


@pytest.mark.parametrize("order", [1, 2])
def test_unknowns_are_those_above_the_mid_plane_and_in_it(order):
    whole, half = (simulate(arch()[0], space, order=order).model for space in (WHOLE, HALF))
    heights = half.elastic.u.function_space.tabulate_dof_coordinates()[half.interfaces.body < 0, 2]
    above, within = np.sum(heights > 1e-9), np.sum(np.abs(heights) < 1e-9)
    assert half.flexible_dofs == 3 * above + 2 * within
    assert whole.flexible_dofs == 3 * (2 * above + within)
    assert half.rigid_dofs * 7 == whole.rigid_dofs * 3
    assert half.flexible_dofs < 0.6 * whole.flexible_dofs


def test_layers_of_odd_number_change_the_curve_by_less_than_finer_elements_would():
    # 20 mm deep of 3 mm elements: three layers in the whole, twice two in the halves
    values = []
    for space in (WHOLE, HALF):
        scene, push = describe("truss")
        simulation = simulate(scene, space, size=3.0)
        curve = simulation.load_displacement(push, forces=[0.05, 0.1])
        values.append((curve.displacements, curve.error_estimates()))
    (whole, estimate), (half, _) = values
    assert np.all(np.abs(half - whole) < np.abs(estimate))


def column(space: str, *, depth: float) -> tuple[fm.Simulation, Force, float]:
    """A straight link between hinges, 4 mm thick, pushed by a slide; its buckling load in the plane, about."""
    mechanism = fm.Mechanism("column")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    strut = mechanism.flexible("strut", fm.strip([(0, 0), (80, 0)], thickness=4.0, depth=depth), PLASTIC)
    mechanism.revolute(base, strut, at=(0, 0), interface_radius=2.0)
    mechanism.revolute(strut, head, at=(80, 0), interface_radius=2.0)
    mechanism.prismatic(base, head, at=(80, 0), axis=(1, 0))
    push = mechanism.force(on=head, at=(80, 0), direction=(-1, 0))
    euler = pi**2 * PLASTIC.law.E * depth * 4.0**3 / 12.0 / 80.0**2
    return simulate(fm.Scene(mechanism), space, size=4.0), push, euler


def test_buckling_in_the_plane_is_seen_and_buckling_out_of_it_is_not():
    unstable = {}
    for space, depth, shares in (
        (WHOLE, 8.0, SHARES),
        (HALF, 8.0, SHARES),
        (WHOLE, 1.0, SHARES[:2]),
        (HALF, 1.0, SHARES),
    ):
        simulation, push, euler = column(space, depth=depth)
        curve = simulation.load_displacement(push, forces=[share * euler for share in shares])
        unstable[depth, space] = [frame.unstable_modes for frame in curve.frames]
    assert unstable[8.0, WHOLE] == unstable[8.0, HALF] == [0, 0, 1]
    # hinges clamp it out of the plane, where it buckles under 4 (depth / thickness)² = 1/4 of Euler's load
    assert unstable[1.0, HALF] == [0, 0, 1]
    assert unstable[1.0, WHOLE] == [0, 1]
    simulation, push, euler = column(HALF, depth=1.0)
    curve = simulation.load_displacement(push, forces=[0.4 * euler])
    (hint,) = (hint for hint in curve.explain().left_out if hint.what == "bending out of the plane")
    assert hint.matters


@pytest.mark.parallel
@pytest.mark.parametrize("build", [pushed_arch, four_bar], ids=["force on the arch", "four-bar"])
def test_half_links_are_the_same_on_any_number_of_ranks(build):
    curves = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        scene, push = build()
        curves.append(simulate(scene, HALF, comm=comm, size=3.0).load_displacement(push, forces=[3.0, 6.0]))
    for alone, together in zip(*(curve.frames for curve in curves), strict=True):
        assert together.displacement == pytest.approx(alone.displacement, rel=1e-9)
        assert together.strain_energy == pytest.approx(alone.strain_energy, rel=1e-9)
        assert together.max_stress == pytest.approx(alone.max_stress, rel=1e-8)
        assert together.unstable_modes == alone.unstable_modes


def test_scenes_that_leave_the_plane_are_refused():
    def simulated(change: Callable[[fm.Mechanism], object], effects: Callable[[fm.Mechanism], list] = lambda m: []):
        scene, _ = arch()
        change(scene.mechanism)
        return fm.Simulation(fm.Scene(scene.mechanism, effects=effects(scene.mechanism)), space=HALF, size=3.0)

    def hang(kind: str, **options):
        return lambda m: getattr(m, kind)(m.rigid_links[1], m.rigid("weight"), at=(50, 0), **options)

    refused(lambda: simulated(hang("spherical")), part="spherical", problem="planar model", remedy="space='3d'")
    refused(lambda: simulated(hang("universal", axis=(0, 0, 1))), part="universal", problem="planar", remedy="3d")
    refused(lambda: simulated(hang("revolute", axis=(0, 0.6, 0.8))), part="revolute", problem="normal", remedy="3d")
    refused(lambda: simulated(hang("prismatic", axis=(0, 0, 1))), part="prismatic", problem="leaves", remedy="3d")
    pull = {"at": (40, 0), "direction": (0.6, 0, 0.8), "name": "pull"}
    refused(
        lambda: simulated(lambda m: m.force(on=m.rigid_links[1], **pull)),
        part="'pull'",
        problem="leaves the plane",
        remedy="space='3d'",
    )
    refused(
        lambda: simulated(lambda m: None, lambda m: [Gravity((0, 0, -9810.0))]),
        part="gravity",
        problem="leaves the plane",
        remedy="space",
    )


def from_file(shape) -> tuple[fm.Scene, Force]:
    """A link 60 mm long between hinges, one of them on a slide that is pushed."""
    mechanism = fm.Mechanism("from a file")
    base, slide = mechanism.rigid("base", fixed=True), mechanism.rigid("slide")
    link = mechanism.flexible("link", shape, PLASTIC)
    mechanism.revolute(base, link, at=(0, 0), interface_radius=3.0)
    mechanism.revolute(link, slide, at=(60, 0), interface_radius=3.0)
    mechanism.prismatic(base, slide, at=(60, 0), axis=(1, 0))
    return fm.Scene(mechanism), mechanism.force(on=slide, at=(60, 0), direction=(-1, 0))


def test_half_of_a_step_part_moves_as_the_whole_does_but_for_the_mesh():
    values = []
    for space in (WHOLE, HALF):
        scene, push = from_file(fm.step_file(MESHES / "curved_link.step", depth=10.0))
        simulation = simulate(scene, space, size=3.0)
        curve = simulation.load_displacement(push, forces=[5.0])
        values.append((curve.displacements[0], curve.error_estimates()[0], simulation.model.flexible_dofs))
    (whole, error, size), (half, _, half_size) = values
    assert abs(half - whole) < abs(error)
    assert half_size < 0.75 * size


def test_mesh_files_are_refused():
    scene, _ = from_file(fm.gmsh_mesh(MESHES / "strip3d.msh", depth=10.0))
    refused(lambda: simulate(scene, HALF), part="'link'", problem="symmetry of a mesh file", remedy="space='3d'")


@pytest.mark.parametrize(("about", "problem"), [((20, 0, 1), "not on the mid-plane"), (None, "is open")])
def test_pressure_on_an_open_part_needs_a_point_on_the_mid_plane(about, problem):
    scene, push = arch()
    (bow,) = scene.mechanism.flexible_links
    effect = Pressure(bow, 0.01, where=lambda x: x[:, 1] > 7.0, about=about)
    simulation = simulate(fm.Scene(scene.mechanism, effects=[effect]), HALF)
    refused(lambda: simulation.load_displacement(push, forces=[1.0]), part="'bow'", problem=problem, remedy="about=")
