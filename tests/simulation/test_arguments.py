"""Requests that a simulation cannot fulfil are refused by name, before anything is meshed."""

import math
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.elasticity import Quadrature

from .demo_scenes import describe

MESHES = Path(__file__).parents[2] / "meshes"


def simulate(scene: fm.Scene, **options) -> fm.Simulation:
    return fm.Simulation(scene, **{"space": "plane-stress", "size": 5.0, "comm": MPI.COMM_SELF, **options})


@pytest.fixture
def truss():
    """A simulation of the truss finger, the force on its tip and a second one."""
    scene, push = describe("truss")
    second = scene.mechanism.force(on=push.on, at=(0, 60), direction=(0, 1), name="second")
    return simulate(scene), push, second


def refused(part: str, action, *, simulation: fm.Simulation | None = None) -> None:
    with pytest.raises(fm.DescriptionError) as caught:
        action()
    assert part in caught.value.part
    assert caught.value.remedy
    assert simulation is None or "mesh" not in simulation.clock.seconds  # nothing was meshed


@pytest.mark.parametrize("space", ["2d", "plane stress", "", 3])
def test_unknown_space(space):
    scene, _ = describe("truss")
    refused("space", lambda: simulate(scene, space=space))


@pytest.mark.parametrize("order", [0, 4, -1, 1.5, 2.0, "2"])
def test_order_that_is_not_1_2_or_3(order):
    scene, _ = describe("truss")
    refused("order", lambda: simulate(scene, order=order))


@pytest.mark.parametrize(
    "beside", [{"space": "3d"}, {"order": 2}, {"layers": 2}, {"segments": 8}, {"quadrature": Quadrature(4)}]
)
def test_accuracy_and_what_it_is_to_choose(beside):
    scene, _ = describe("truss")
    (name,) = beside
    refused(f"accuracy and {name}", lambda: fm.Simulation(scene, accuracy=0.01, comm=MPI.COMM_SELF, **beside))


def test_following_before_the_accuracy_has_chosen_anything():
    scene, push = describe("truss")
    simulation = fm.Simulation(scene, accuracy=0.01, comm=MPI.COMM_SELF)
    refused("curve of", lambda: simulation.follow(push, until=fm.Until(force=1.0)), simulation=simulation)


@pytest.mark.parametrize(
    "derive",
    [
        lambda simulation, link: simulation.with_design(np.zeros(1)),
        lambda simulation, link: simulation.with_material(link.material, fm.ONYX),
        lambda simulation, link: simulation.with_shapes({link: link.shape}),
        lambda simulation, link: simulation.on(MPI.COMM_SELF),
    ],
    ids=["design", "material", "shapes", "processes"],
)
def test_simulation_derived_before_the_accuracy_has_chosen_anything(derive):
    scene, _ = describe("truss")
    simulation = fm.Simulation(scene, accuracy=0.01, comm=MPI.COMM_SELF)
    (link,) = scene.mechanism.flexible_links
    refused("simulation of", lambda: derive(simulation, link), simulation=simulation)


def test_scene_that_is_not_one():
    scene, _ = describe("truss")
    refused("simulation", lambda: simulate(scene.mechanism))


@pytest.mark.parametrize("option", [{"quadrature": 4}, {"solver": "newton"}, {"predictor": "tangent"}])
def test_options_of_another_kind(option):
    scene, _ = describe("truss")
    (name,) = option
    refused(name, lambda: simulate(scene, **option))


@pytest.mark.parametrize(
    ("name", "space", "option"),
    [("truss", "plane-stress", "layers"), ("mesh", "3d", "layers"), ("mesh", "3d", "segments")],
)
def test_options_that_would_change_nothing(name, space, option):
    scene, _ = describe("truss")
    if name == "mesh":
        mechanism = fm.Mechanism("read")
        shape = fm.gmsh_mesh(MESHES / "strip3d.msh", depth=10.0)
        bar = mechanism.flexible("bar", shape, fm.ONYX)
        mechanism.revolute(mechanism.rigid("base", fixed=True), bar, at=(0, 0), interface_radius=3.0)
        scene = fm.Scene(mechanism)
    simulate(scene, space=space)
    refused(option, lambda: simulate(scene, space=space, **{option: 9}))


@pytest.mark.parametrize("formulation", ["mixed", 0.49, fm.MixedFormulation])
def test_formulation_that_is_not_one(formulation):
    scene, _ = describe("truss")
    refused("formulation", lambda: simulate(scene, formulation=formulation))


@pytest.mark.parametrize("above", [-0.1, 0.5, math.nan])
def test_mixed_formulation_without_a_sensible_limit(above):
    refused("mixed formulation", lambda: fm.MixedFormulation(above=above))


@pytest.mark.parametrize("size", [0.0, -2.0, math.nan, math.inf, "fine"])
def test_element_size_that_is_not_a_positive_number(size):
    scene, _ = describe("truss")
    refused("'diagonal'", lambda: simulate(scene, size=size))
    (diagonal,) = scene.mechanism.flexible_links
    refused("'diagonal'", lambda: simulate(scene, size={diagonal: size}))


def test_sizes_per_link_that_leave_one_out():
    scene, _ = describe("claw")
    crank, *others = scene.mechanism.flexible_links
    simulate(scene, size={crank: 3.0, **{link: 5.0 for link in others}})
    refused("'crank'", lambda: simulate(scene, size={link: 5.0 for link in others}))


@pytest.mark.parametrize("given", [{"space": "plane-stress"}, {"accuracy": 0.01, "space": None}])
def test_sizes_of_links_that_do_not_exist(given):
    scene, _ = describe("truss")
    rigid, sizes = scene.mechanism.rigid_links[0], dict.fromkeys(scene.mechanism.flexible_links, 5.0)
    for stranger in ("diagonal", rigid):
        refused("size", lambda stranger=stranger: simulate(scene, **given, size={**sizes, stranger: 5.0}))


def test_neither_or_both_of_forces_and_displacements(truss):
    simulation, push, _ = truss
    refused("'push on tip'", lambda: simulation.load_displacement(push), simulation=simulation)
    refused(
        "'push on tip'",
        lambda: simulation.load_displacement(push, forces=[0.1], displacements=[1.0]),
        simulation=simulation,
    )


@pytest.mark.parametrize("kind", ["forces", "displacements"])
@pytest.mark.parametrize("samples", [[0.0, math.nan], [math.inf], ["much"], [None]])
def test_samples_that_are_not_finite_numbers(truss, kind, samples):
    simulation, push, _ = truss
    refused("'push on tip'", lambda: simulation.load_displacement(push, **{kind: samples}), simulation=simulation)


@pytest.mark.parametrize("kind", ["forces", "displacements"])
def test_no_samples(truss, kind):
    simulation, push, _ = truss
    refused("'push on tip'", lambda: simulation.load_displacement(push, **{kind: []}), simulation=simulation)


def test_force_of_another_mechanism(truss):
    simulation, push, _ = truss
    _, foreign = describe("claw")
    refused(repr(foreign.name), lambda: simulation.load_displacement(foreign, forces=[0.1]), simulation=simulation)
    refused(
        repr(foreign.name),
        lambda: simulation.load_displacement(push, forces=[0.1], others={foreign: 1.0}),
        simulation=simulation,
    )


def test_other_force_without_a_finite_magnitude(truss):
    simulation, push, second = truss
    for magnitude in (math.nan, math.inf, "much"):
        refused(
            "'second'",
            lambda magnitude=magnitude: simulation.load_displacement(push, forces=[0.1], others={second: magnitude}),
            simulation=simulation,
        )


def test_force_that_is_to_change_and_to_be_constant(truss):
    simulation, push, _ = truss
    refused(
        "'push on tip'",
        lambda: simulation.load_displacement(push, forces=[0.1], others={push: 1.0}),
        simulation=simulation,
    )


def test_configuration_of_another_mechanism(truss):
    simulation, push, _ = truss
    scene, _ = describe("claw")
    turned = scene.configuration("turned", {scene.mechanism.motors[0]: 0.5})
    refused(
        "'turned'",
        lambda: simulation.load_displacement(push, forces=[0.1], configuration=turned),
        simulation=simulation,
    )


def test_force_and_output_beside_their_link():
    scene, _ = describe("truss")
    (diagonal,) = scene.mechanism.flexible_links
    beside = scene.mechanism.force(on=diagonal, at=(30, 10), direction=(1, 0), name="beside")
    with pytest.raises(fm.FenicsmechError, match="'beside'.*not on"):
        simulate(scene).load_displacement(beside, forces=[0.1])


def test_force_on_the_ground():
    scene, push = describe("truss")
    (ground,) = (link for link in scene.mechanism.rigid_links if link.fixed)
    scene.mechanism.force(on=ground, at=(5, 0), direction=(1, 0), name="grounded")
    refused("'grounded'", lambda: simulate(scene))


def test_mechanism_that_cannot_be_assembled():
    mechanism = fm.Mechanism("stuck")
    base, crank, bar = (mechanism.rigid(name, fixed=name == "base") for name in ("base", "crank", "bar"))
    strip = mechanism.flexible("strip", fm.strip([(40, 0), (40, 50)], thickness=3.0, depth=5.0), fm.ONYX)
    shaft = mechanism.revolute(base, crank, at=(0, 0))
    mechanism.revolute(crank, bar, at=(0, 10))
    mechanism.revolute(bar, strip, at=(40, 50), interface_radius=2.0)
    mechanism.weld(base, strip, at=(40, 0), interface_radius=2.0)
    mechanism.weld(base, bar, at=(20, 30))
    motor = mechanism.motor(shaft)
    push = mechanism.force(on=bar, at=(20, 30), direction=(1, 0))
    stuck = fm.Scene(mechanism)
    half_turn = stuck.configuration("half a turn", {motor: math.pi})
    with pytest.raises(fm.AssemblyError, match="'half a turn'.*does not close"):
        simulate(stuck).load_displacement(push, forces=[1.0], configuration=half_turn)


def test_effect_that_does_not_exist():
    scene, _ = describe("truss")
    refused("scene", lambda: fm.Scene(scene.mechanism, effects=["gravity"]))
    refused("scene", lambda: fm.Scene("truss"))


def test_mechanism_of_rigid_links_only():
    mechanism = fm.Mechanism("stiff")
    mechanism.revolute(mechanism.rigid("ground", fixed=True), mechanism.rigid("bar"), at=(0, 0))
    refused("'stiff'", lambda: simulate(fm.Scene(mechanism)))


def test_mechanism_that_changed_after_the_simulation_was_made(truss):
    simulation, push, _ = truss
    simulation.scene.mechanism.rigid("late")
    refused("'truss finger'", lambda: simulation.load_displacement(push, forces=[0.1]), simulation=simulation)


def test_forces_and_outputs_added_later_act_as_those_described_first(truss):
    simulation, push, _ = truss
    late = simulation.scene.mechanism.force(on=push.on, at=push.at, direction=push.direction, name="late")
    along = simulation.scene.mechanism.output(on=push.on, at=push.at, direction=push.direction, name="along")
    curve = simulation.load_displacement(late, forces=[0.1])
    assert curve.displacements == pytest.approx(simulation.load_displacement(push, forces=[0.1]).displacements)
    assert curve.frames[0].outputs[along] == pytest.approx(curve.displacements[0])


@pytest.mark.parametrize("kind", ["force", "output"])
def test_forces_and_outputs_added_later_that_leave_the_plane(truss, kind):
    simulation, push, _ = truss
    add = getattr(simulation.scene.mechanism, kind)
    late = add(on=push.on, at=push.at, direction=(1, 0, 1), name="late")
    part = late if kind == "force" else push
    refused("'late'", lambda: simulation.load_displacement(part, forces=[0.1]), simulation=simulation)
    refused("'late'", lambda: simulation.follow(part, until=fm.Until(force=0.1)), simulation=simulation)


def test_force_on_the_ground_added_later(truss):
    simulation, _, _ = truss
    (ground,) = (link for link in simulation.scene.mechanism.rigid_links if link.fixed)
    late = simulation.scene.mechanism.force(on=ground, at=(5, 0), direction=(1, 0), name="grounded")
    for values in ({"forces": [0.1]}, {"displacements": [0.1]}):
        refused("'grounded'", lambda values=values: simulation.load_displacement(late, **values), simulation=simulation)


def test_force_configuration_and_samples_of_the_wrong_kind(truss):
    simulation, push, _ = truss
    refused("'push on tip'", lambda: simulation.load_displacement("push on tip", forces=[0.1]), simulation=simulation)
    refused("'open'", lambda: simulation.load_displacement(push, forces=[0.1], configuration="open"))
    for samples in (2.0, "12"):
        refused("'push on tip'", lambda samples=samples: simulation.load_displacement(push, forces=samples))


def test_field_file_of_another_kind_is_refused_and_leaves_nothing(truss, tmp_path):
    simulation, push, _ = truss
    curve = simulation.load_displacement(push, forces=[0.1])
    refused("x.vtu", lambda: curve.write(tmp_path / "x.vtu"))
    assert not list(tmp_path.iterdir())


def test_path_of_a_point_stops_where_motors_strain_the_links():
    scene, push = describe("truss")
    shaft = next(joint for joint in scene.mechanism.joints if joint.at == (0.0, 0.0))
    motor = scene.mechanism.motor(shaft)
    turned = scene.configuration("turned", {motor: -0.05})
    with pytest.raises(fm.AssemblyError, match="'turned'.*strain"):
        simulate(scene).path(push, [turned])
