"""Results do not depend on the number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..effects.levers import lever
from .demo_scenes import describe

pytestmark = pytest.mark.parallel

COMMS = (MPI.COMM_SELF, MPI.COMM_WORLD)


def assert_alike(alone: fm.Curve, together: fm.Curve, *, digits: float = 1e-9) -> None:
    for a, b in zip(alone.frames, together.frames, strict=True):
        scale = max(abs(a.displacement), 1e-12)
        assert b.displacement == pytest.approx(a.displacement, abs=digits * scale)
        assert b.force == pytest.approx(a.force, rel=digits, abs=1e-15)
        assert b.strain_energy == pytest.approx(a.strain_energy, rel=digits, abs=1e-15)
        assert b.max_stress == pytest.approx(a.max_stress, rel=10 * digits, abs=1e-12)
        assert (b.unstable_modes, b.stable_under_control) == (a.unstable_modes, a.stable_under_control)
        assert [*b.motors.values()] == pytest.approx([*a.motors.values()], rel=10 * digits, abs=1e-9)
        assert [*b.outputs.values()] == pytest.approx([*a.outputs.values()], rel=10 * digits, abs=1e-12)
        largest = max(np.abs(reaction.force).max() for reaction in a.reactions.values())
        for name, reaction in a.reactions.items():
            # across the plane of a loop of spatial hinges the forces are redundant, so that rounding may shift them
            in_plane = b.reactions[name].force[:2]
            assert in_plane == pytest.approx(reaction.force[:2], abs=10 * digits * max(largest, 1e-12)), name


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("plane-strain", marks=pytest.mark.thorough)])
def test_claw(space):
    curves = []
    for comm in COMMS:
        scene, grasp = describe("claw")
        finger = grasp.on
        scene.mechanism.output(on=finger, at=(28, 92), direction=(0, 1))
        simulation = fm.Simulation(scene, space=space, size=4.0, comm=comm)
        curves.append(simulation.load_displacement(grasp, forces=[0.0, 2.0, 5.0, 10.0]))
    assert_alike(*curves)


@pytest.mark.parametrize("space", [pytest.param("3d-symmetric", marks=pytest.mark.thorough), "3d"])
def test_truss_in_space(space):
    curves = []
    for comm in COMMS:
        scene, push = describe("truss")
        simulation = fm.Simulation(scene, space=space, size=5.0, comm=comm)
        curves.append(simulation.load_displacement(push, forces=[0.01, 0.02, 0.05]))
    assert_alike(*curves)


def test_klann_in_space_in_another_configuration_under_displacement_control():
    curves = []
    for comm in COMMS:
        scene, lift = describe("klann")
        (motor,) = scene.mechanism.motors
        simulation = fm.Simulation(scene, space="3d", order=1, size=6.0, comm=comm)
        configuration = scene.configuration("turned", {motor: -1.0})
        curves.append(simulation.load_displacement(lift, displacements=[1.0, 3.0], configuration=configuration))
    assert_alike(*curves)


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_force_and_output_on_points_of_a_flexible_link(space):
    curves = []
    for comm in COMMS:
        mechanism = fm.Mechanism("bow")
        base = mechanism.rigid("base", fixed=True)
        bow = mechanism.flexible("bow", fm.strip([(0, 0), (25, 20), (60, 0)], thickness=5.0, depth=8.0), fm.ONYX)
        mechanism.revolute(base, bow, at=(0, 0), interface_radius=3.0)
        mechanism.revolute(base, bow, at=(60, 0), interface_radius=3.0)
        push = mechanism.force(on=bow, at=(25.0, 20.0), direction=(0.6, -0.8))
        mechanism.output(on=bow, at=(40.0, 16.0), direction=(0, 1))
        order = 1 if space == "3d" else 2
        simulation = fm.Simulation(fm.Scene(mechanism), space=space, order=order, size=4.0, comm=comm)
        curves.append(simulation.load_displacement(push, forces=[20.0, 60.0]))
    assert_alike(*curves)


def test_force_beside_its_link_is_refused_on_all_ranks():
    mechanism = fm.Mechanism("off the link")
    base = mechanism.rigid("base", fixed=True)
    bar = mechanism.flexible("bar", fm.strip([(0, 0), (60, 0)], thickness=5.0, depth=8.0), fm.ONYX)
    mechanism.weld(base, bar, at=(0, 0), interface_radius=3.0)
    beside = mechanism.force(on=bar, at=(30, 10), direction=(0, 1), name="beside")
    with pytest.raises(fm.FenicsmechError, match="'beside'.*not on"):
        simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=4.0)
        simulation.load_displacement(beside, forces=[1.0])


def test_link_that_cannot_be_meshed_is_refused_on_all_ranks(shared_tmp_path):
    nonsense = shared_tmp_path / "nonsense.msh"
    if MPI.COMM_WORLD.rank == 0:
        nonsense.write_text("not a mesh")
    MPI.COMM_WORLD.Barrier()
    mechanism = fm.Mechanism("unreadable")
    base = mechanism.rigid("base", fixed=True)
    bar = mechanism.flexible("bar", fm.gmsh_mesh(nonsense, depth=5.0), fm.ONYX)
    mechanism.weld(base, bar, at=(0, 0), interface_radius=3.0)
    push = mechanism.force(on=bar, at=(30, 0), direction=(0, 1))
    with pytest.raises(fm.MeshingError, match="'bar'"):
        simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=4.0)
        simulation.load_displacement(push, forces=[1.0])


def test_failed_solve_raises_alike_on_all_ranks():
    case = lever(lambda hinge: [fm.JointSpring(hinge, 50.0)], comm=MPI.COMM_WORLD)
    with pytest.raises(fm.EquilibriumError) as caught:
        case.simulation.load_displacement(case.force, displacements=[1.0, 500.0])
    assert [frame.displacement for frame in caught.value.frames] == pytest.approx([1.0], rel=1e-9)
    assert len(set(MPI.COMM_WORLD.allgather(str(caught.value)))) == 1


def test_one_rank_decides_on_motions_and_ranks_of_constraints(monkeypatch):
    def curve(comm: MPI.Comm) -> fm.Curve:
        case = lever(lambda hinge: [fm.JointSpring(hinge, 50.0)], comm=comm)
        return case.simulation.load_displacement(case.force, forces=[0.5, 1.0])

    alone = curve(MPI.COMM_SELF)
    if MPI.COMM_WORLD.rank > 0:  # other kernels round otherwise, and may span null spaces by other vectors
        for name in ("svd", "eigh", "lstsq"):
            monkeypatch.delattr(np.linalg, name)
    together = curve(MPI.COMM_WORLD)
    assert together.freedom == alone.freedom and together.freedom.mobility == 1
    assert_alike(alone, together)
