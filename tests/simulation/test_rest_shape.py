"""Simulations whose links have another rest shape than drawn: pins, curves, frames and files follow it."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.multibody import assemble
from fenicsmech.simulation import gather, rest_vertices

PLASTIC = fm.Material("plastic", 2000.0, 0.35)


def crane(space: str, *, order: int = 1, comm: MPI.Comm = MPI.COMM_WORLD):
    """A driven hub with a beam clamped to it and a loaded hand at the beam's end."""
    mechanism = fm.Mechanism("crane")
    base, hub, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hub"), mechanism.rigid("hand")
    shape = fm.strip([(0, 0), (40, 0)], thickness=4.0, depth=6.0)
    beam = mechanism.flexible("beam", shape, PLASTIC)
    motor = mechanism.motor(mechanism.revolute(base, hub, at=(0, 0)))
    for link, x in ((hub, 0.0), (hand, 40.0)):
        mechanism.weld(link, beam, at=(x, 0), region=fm.Rectangle(4.0, 5.0))
    push = mechanism.force(on=hand, at=(40, 0), direction=(0, 1))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space=space, order=order, size=4.0, comm=comm)
    return simulation, push, scene.configuration("turned", {motor: 2.4})


def wave(simulation: fm.Simulation, amplitude: float) -> np.ndarray:
    """A change of the rest shape that leaves what is clamped rigid, on this rank."""
    field = simulation.model.elastic.shape
    x = field.function_space.tabulate_dof_coordinates()[:, : simulation.linkage.dim]
    along = np.clip((x[:, 0] - 2.0) / 36.0, 0.0, 1.0)
    change = np.zeros_like(x)
    change[:, 1] = amplitude * (along + np.sin(np.pi * along) ** 2)
    return change.ravel()


def thicker(simulation: fm.Simulation, factor: float) -> np.ndarray:
    """The change of the rest shape that makes the beam ``factor`` times as thick, on this rank."""
    x = simulation.model.elastic.shape.function_space.tabulate_dof_coordinates()[:, : simulation.linkage.dim]
    return (x * np.array([0.0, factor - 1.0, 0.0])[: simulation.linkage.dim]).ravel()


each_space = pytest.mark.parametrize("space", ["plane-stress", "3d"])


@pytest.mark.parallel
@each_space
def test_a_reshaped_mechanism_assembles_without_energy(space):
    simulation, _, turned = crane(space)
    model, assembly = simulation.model, assemble(simulation.linkage, turned)
    motors = simulation.linkage.joints.motor_values(turned.position)
    model.reshape(wave(simulation, 5.0))
    model.load(model.assembled_state(assembly.poses, motors))
    stored = model.elastic.energy()
    assert abs(stored) < 1e-18 * PLASTIC.law.E * 40.0**3


@pytest.mark.parallel
@each_space
def test_carrying_an_assembled_mechanism_to_another_shape_assembles_it_there(space):
    simulation, _, turned = crane(space)
    model, assembly = simulation.model, assemble(simulation.linkage, turned)
    motors = simulation.linkage.joints.motor_values(turned.position)
    model.reshape(wave(simulation, 2.0))
    carried = model.carry(model.assembled_state(assembly.poses, motors), wave(simulation, -5.0))
    assert np.array_equal(model.elastic.design, wave(simulation, -5.0))
    expected = model.assembled_state(assembly.poses, motors)
    assert carried.u == pytest.approx(expected.u, abs=1e-11)


@pytest.mark.parallel
@each_space
def test_stiffness_grows_with_the_third_power_of_the_designed_thickness(space):
    simulation, push, _ = crane(space, order=2)
    (drawn,) = simulation.load_displacement(push, forces=[0.1]).displacements
    simulation.model.reshape(thicker(simulation, 1.1))
    (reshaped,) = simulation.load_displacement(push, forces=[0.1]).displacements
    assert drawn / reshaped == pytest.approx(1.1**3, rel=0.01)
    simulation.model.reshape(thicker(simulation, 1.0))
    assert simulation.load_displacement(push, forces=[0.1]).displacements == pytest.approx([drawn], rel=1e-10)


def test_another_shape_for_a_while_is_taken_back_even_after_an_error():
    simulation, _, _ = crane("plane-stress", comm=MPI.COMM_SELF)
    model = simulation.model
    first, second = wave(simulation, 2.0), wave(simulation, -1.0)
    model.reshape(first)
    nodes = model.interfaces.offsets
    with pytest.raises(RuntimeError), model.shaped(second):
        assert np.array_equal(model.elastic.design, second)
        assert not all(np.allclose(model.interfaces.offsets[body], nodes[body]) for body in nodes)
        raise RuntimeError
    assert np.array_equal(model.elastic.design, first)
    assert all(np.array_equal(model.interfaces.offsets[body], nodes[body]) for body in nodes)


@pytest.mark.parallel
@each_space
def test_frames_keep_the_shape_they_were_computed_with(space):
    simulation, push, turned = crane(space)
    simulation.model.reshape(wave(simulation, 2.0))
    curve = simulation.load_displacement(push, forces=[2.0], configuration=turned)
    before = curve.stress_field(curve.frames[0]), gather(simulation.model, curve.frames[0])
    simulation.model.reshape(wave(simulation, -3.0))
    after = curve.stress_field(curve.frames[0]), gather(simulation.model, curve.frames[0])
    assert np.array_equal(simulation.model.elastic.design, wave(simulation, -3.0))
    if simulation.comm.rank == 0:
        stress, expected = after[0].stress, before[0].stress
        assert stress == pytest.approx(expected, rel=1e-12, abs=1e-12 * np.abs(expected).max())
        assert after[1].rest == pytest.approx(before[1].rest, abs=1e-14)
        assert after[1].displacement == pytest.approx(before[1].displacement, abs=1e-14)
    else:
        assert before == after == (None, None)


@pytest.mark.parallel
def test_files_show_a_frame_in_its_own_shape_and_leave_the_mesh_alone(shared_tmp_path):
    simulation, push, _ = crane("plane-stress")
    simulation.model.reshape(wave(simulation, 2.0))
    curve = simulation.load_displacement(push, forces=[2.0])
    simulation.model.reshape(wave(simulation, -3.0))
    geometry = simulation.model.mesh.mesh.geometry.x
    drawn = geometry.copy()
    curve.write(shared_tmp_path / "crane.xdmf")
    assert np.array_equal(geometry, drawn)
    simulation.comm.barrier()
    with simulation.model.shaped(curve.frames[0].design):
        rest = rest_vertices(simulation.model)
    if rest is not None:
        # HDF5 holds plain doubles: the highest vertex of the frame's shape stands among them, and no vertex of others
        heavy = (shared_tmp_path / "crane.h5").read_bytes()
        assert rest[:, 1].max().tobytes() in heavy
    shown = rest_vertices(simulation.model)
    if shown is not None:
        assert shown[:, 1].min().tobytes() not in heavy


@pytest.mark.parallel
def test_mesh_ratio_is_that_of_the_present_shape():
    simulation, _, _ = crane("plane-stress")
    drawn = simulation.mesh_ratio_max
    simulation.model.reshape(thicker(simulation, 0.6))
    assert abs(simulation.mesh_ratio_max - drawn) > 0.1 * drawn
    simulation.model.reshape(thicker(simulation, 1.0))
    assert simulation.mesh_ratio_max == pytest.approx(drawn, rel=1e-12)


@pytest.mark.parallel
def test_the_same_scene_on_other_processes_has_its_drawn_shape_and_the_same_fidelity():
    simulation, push, turned = crane("plane-stress")
    curve = simulation.load_displacement(push, forces=[2.0], configuration=turned)
    simulation.model.reshape(wave(simulation, 2.0))
    alone = simulation.on(MPI.COMM_SELF)
    assert (alone.scene, alone.fidelity) == (simulation.scene, simulation.fidelity)
    assert alone.comm.size == 1
    again = alone.load_displacement(push, forces=[2.0], configuration=turned)
    assert again.displacements == pytest.approx(curve.displacements, rel=1e-9)


@pytest.mark.parallel
@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_simulation_of_another_design_leaves_the_first_one_as_it_is(space):
    simulation, push, turned = crane(space)
    request = {"forces": [2.0], "configuration": turned}
    drawn = simulation.load_displacement(push, **request)
    other = simulation.with_design(wave(simulation, 2.0))
    curve = other.load_displacement(push, **request)
    assert not simulation.model.elastic.design.any()
    assert simulation.load_displacement(push, **request).displacements == pytest.approx(drawn.displacements, rel=1e-8)
    assert abs(curve.displacements[0] / drawn.displacements[0] - 1.0) > 1e-3
    with simulation.model.shaped(wave(simulation, 2.0)):
        assert simulation.load_displacement(push, **request).displacements == pytest.approx(curve.displacements)
    # both curves are asked about their own design
    assert drawn.error_estimates() == pytest.approx(drawn.error_estimates())
    assert curve.error_estimates() != pytest.approx(drawn.error_estimates(), rel=1e-3)
    assert "another design" in repr(other) and "another design" not in repr(simulation)


def test_design_of_another_mesh_is_refused():
    simulation, _, _ = crane("plane-stress")
    with pytest.raises(fm.DescriptionError, match="design field"):
        simulation.with_design(np.zeros(3))


@pytest.mark.parallel
@each_space
def test_paths_of_points_on_flexible_links_start_at_the_designed_shape(space):
    simulation, _, turned = crane(space)
    (beam,) = simulation.scene.mechanism.flexible_links
    end = simulation.scene.mechanism.output(on=beam, at=(40, 0), direction=(0, 1), name="end")
    raised = simulation.with_design(wave(simulation, 5.0))
    cos, sin = np.cos(2.4), np.sin(2.4)
    for own, height in ((raised, 5.0), (simulation, 0.0)):
        place = own.path(end, [fm.DRAWN, turned])[:, :2]
        assert place == pytest.approx(
            np.array([(40.0, height), (40.0 * cos - height * sin, 40.0 * sin + height * cos)]), abs=1e-9
        )


@pytest.mark.parallel
@each_space
@pytest.mark.parametrize("height", [0.0, 5.0])
def test_arrows_of_forces_on_flexible_links_are_where_their_points_have_moved(space, height):
    simulation, *_ = crane(space)
    mechanism = simulation.scene.mechanism
    (beam,) = mechanism.flexible_links
    press = mechanism.force(on=beam, at=(40, 0), direction=(0, -1), name="press")
    across, up = (mechanism.output(on=beam, at=(40, 0), direction=way, name=f"{way}") for way in ((1, 0), (0, 1)))
    designed = simulation.with_design(wave(simulation, height))
    curve = designed.load_displacement(press, forces=[0.0, 50.0])
    panel, end = curve.panel(), curve.frames[-1]
    assert end.outputs[up] < -2.0
    assert (panel is None) == (MPI.COMM_WORLD.rank > 0)
    if panel is not None:
        (arrow,) = panel.arrows
        place = (40.0 + end.outputs[across], height + end.outputs[up])
        assert arrow.at == pytest.approx(np.array(place), abs=1e-9)
        assert arrow.vector == pytest.approx(np.array([0.0, -50.0]))
