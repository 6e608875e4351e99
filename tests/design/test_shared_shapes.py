"""Links that share a shape: one set of parameters, exact images of one another, exact gradients (mm, N, MPa)."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import Correction, MeshQuality, ShapeBounds, StayClose
from fenicsmech.meshing import gmsh, gmsh_session

from ..oracles.dense import taylor_rates
from .mechanisms import Case, objective
from .refusal import refused

PLASTIC = fm.Material("plastic", 2000.0, 0.35)
EXACT = {"optimiser": fm.LevenbergMarquardt(tolerance=1e-18), "correction": Correction(estimates=False)}
LEG = np.array([(10.0, 0.0), (14.0, 15.0), (12.0, 30.0)])
Move = Callable[[np.ndarray], np.ndarray]


def mirrored(x: np.ndarray) -> np.ndarray:
    return x * (-1.0, 1.0)


def shifted(x: np.ndarray) -> np.ndarray:
    return x + (25.0, 0.0)


def turned(x: np.ndarray) -> np.ndarray:
    return np.column_stack([22.0 - x[:, 0], 30.0 - x[:, 1]]) + (16.0, 0.0)


def legs(
    *moves: Move, leg: np.ndarray = LEG, thickness: float = 2.0, radius: float = 2.0
) -> tuple[fm.Scene, list[fm.FlexibleLink], fm.Force]:
    """A table on a leg, curved by default, and its images, pushed sideways."""
    mechanism = fm.Mechanism("table")
    ground, table = mechanism.rigid("ground", fixed=True), mechanism.rigid("table")
    made = []
    for k, move in enumerate((lambda x: x, *moves)):
        points = move(leg)
        shape = fm.strip(points, thickness=thickness if k else 2.0, depth=5.0)
        made.append(mechanism.flexible(f"leg {k}", shape, PLASTIC))
        for end in (0, -1):
            low = points[end, 1] < 15.0
            mechanism.weld(ground if low else table, made[-1], at=points[end], interface_radius=radius if k else 2.0)
    push = mechanism.force(on=table, at=(0, 30), direction=(1, 0.2))
    return fm.Scene(mechanism), made, push


def case(move: Move, wanted: float = 0.25) -> Case:
    scene, (one, other), push = legs(move)
    how = {"mirrored" if move is mirrored else "same": other}
    return Case(scene, [fm.SplineDesign(one, 2, **how)], [fm.Target(push, force=1.0, displacement=wanted)])


def with_feet(own: Case, move: Move, way: tuple[float, float] = (1.0, 0.5)) -> Case:
    """``own`` whose first joint may be shifted too, and its image likewise."""
    feet = own.scene.mechanism.joints[0], own.scene.mechanism.joints[2]
    image = np.diff(move(np.array([(0.0, 0.0), way])), axis=0)[0]
    shift = fm.Number(fm.JointPosition(*feet, direction=[way, image.tolist()]), -4.0, 6.0)
    return Case(own.scene, [*own.designs, shift], own.targets)


def images(problem: fm.DesignProblem, design: fm.Design, move: Move) -> float:
    """Largest distance of the designed nodes of the second leg from the images of those of the first one."""
    elastic, mesh = problem.simulation.model.elastic, problem.simulation.model.mesh
    space, dim = elastic.shape.function_space, elastic.model.dim
    places = space.tabulate_dof_coordinates()[:, :dim] + (elastic.drawn_shape + design.field).reshape(-1, dim)
    cells = np.arange(space.mesh.topology.index_map(space.mesh.topology.dim).size_local)
    one, other = (
        places[np.unique(np.concatenate([space.dofmap.cell_dofs(cell) for cell in cells[mesh.link == link]]))]
        for link in (0, 1)
    )
    one = np.column_stack([move(one[:, :2]), one[:, 2:]])
    return float(np.linalg.norm(one[:, None] - other, axis=2).min(axis=1).max())


@pytest.mark.parametrize("move", [mirrored, shifted, turned])
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_links_that_share_a_shape_stay_exact_images(move, space):
    own = case(move)
    problem = own.problem(space=space, size=3.0)
    random = np.random.default_rng(3)
    p = problem.initial + 0.1 * random.standard_normal(len(problem.initial))
    design = problem.rest_shape(p)
    assert len(p) == 12  # of one link
    assert np.max(np.abs(design.field)) > 0.05
    assert images(problem, design, move) < 1e-12


@pytest.mark.parametrize(
    ("space", "size"), [("plane-stress", 3.0), pytest.param("3d", 4.0, marks=pytest.mark.thorough)]
)
def test_derivatives_of_quantities_by_shared_shapes_pass_taylor_tests(space, size):
    own = case(mirrored)
    (push,), (one, other) = own.scene.mechanism.forces, own.scene.mechanism.flexible_links
    sample, joint = fm.Sample({push: 3.0}), own.scene.mechanism.joints[-1]
    quantities = {
        fm.Displacement(push): 1.0,
        fm.Displacement(other, at=(-13.9, 15.0)): (1.0,) * (3 if space == "3d" else 2),
        fm.StrainEnergy(): 1.0,
        fm.Component(fm.JointForce(joint), (1.0, 0.5)): 1.0,
        fm.LinkVolume(other): 1.0,
        fm.CentrelineLength(one): 1.0,
        fm.CentrelineLength(other): 1.0,
    }
    targets = [
        fm.Target(q, sample if q.of_state else None, equals=1.0 if v == 1.0 else v, scale=1.0)
        for q, v in quantities.items()
    ]
    whole, bench = objective(Case(own.scene, own.designs, targets), StayClose(), space=space, size=size)
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    slopes = whole.evaluate(p).jacobian @ direction
    known = {h: whole.evaluate(p + h * direction).residuals for h in (0.0, 4e-3, 2e-3, 1e-3)}
    for k, slope in enumerate(slopes):
        first = abs(known[4e-3][k] - known[0.0][k])
        if first <= 1e-9:
            assert abs(slope) * 4e-3 <= 1e-9
            continue
        rates = taylor_rates(lambda t, k=k: known[t[0]][k], [0.0], [1.0], [slope], (4e-3, 2e-3, 1e-3))
        assert np.max(rates.with_gradient) >= 1.95, targets[k].name


@pytest.mark.parametrize("move", [mirrored, shifted, turned])
def test_links_with_shifted_joints_that_share_a_shape_stay_exact_images(move):
    problem = with_feet(case(move), move).problem(size=3.0)
    p = problem.initial + 0.1 * np.random.default_rng(3).standard_normal(len(problem.initial))
    design = problem.rest_shape(p)
    assert len(p) == 13 and max(map(abs, design.numbers.values())) > 0.2
    assert images(problem, design, move) < 1e-12
    (kind,) = design.numbers
    assert type(kind).read(problem.simulation.scene, kind.words) == kind  # as results in files have it


@pytest.mark.parametrize(
    ("space", "size", "move"),
    [
        ("plane-stress", 3.0, mirrored),
        pytest.param("plane-stress", 3.0, turned, marks=pytest.mark.thorough),
        pytest.param("3d", 4.0, mirrored, marks=pytest.mark.thorough),
    ],
)
def test_gradients_by_shared_shapes_and_joints_agree_with_central_differences(move, space, size):
    regulariser = MeshQuality(limit=2.5, width=2.5) + ShapeBounds() + 1e-3 * StayClose()
    whole, bench = objective(with_feet(case(move), move), regulariser, space=space, size=size)
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    direction[:-1] *= 0.1
    here, step = whole.evaluate(p), 1e-3
    ahead, back = (whole.evaluate(p + h * direction) for h in (step, -step))
    assert here.gradient @ direction == pytest.approx((ahead.value - back.value) / (2 * step), rel=1e-5)
    assert here.jacobian @ direction == pytest.approx((ahead.residuals - back.residuals) / (2 * step), rel=1e-5)


@pytest.mark.parallel
@pytest.mark.thorough
def test_any_number_of_processes_finds_the_same_derivatives_by_shared_shapes():
    seen = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        whole, bench = objective(case(mirrored), MeshQuality(limit=2.5, width=2.5), comm=comm)
        here = whole.evaluate(bench.design(0.05, seed=5))
        seen.append((here.value, here.gradient))
    for one, together in zip(*seen, strict=True):
        assert together == pytest.approx(one, rel=1e-7, abs=1e-7 * np.abs(one).max())


def guided(*, half: bool) -> tuple[fm.Simulation, list[fm.SplineDesign], fm.Force]:
    """A slide that runs along y on two mirrored legs, or on one of them."""
    mechanism = fm.Mechanism("guided")
    ground, slide = mechanism.rigid("ground", fixed=True), mechanism.rigid("slide")
    mechanism.prismatic(ground, slide, at=(0, 30), axis=(0, 1))
    made = []
    for move in (lambda x: x, mirrored)[: 1 if half else 2]:
        points = move(LEG)
        made.append(mechanism.flexible(f"leg {len(made)}", fm.strip(points, thickness=2.0, depth=5.0), PLASTIC))
        mechanism.revolute(ground, made[-1], at=points[0], interface_radius=2.0)
        mechanism.weld(slide, made[-1], at=points[-1], interface_radius=2.0)
    push = mechanism.force(on=slide, at=(0, 30), direction=(0, -1))
    design = fm.SplineDesign(made[0], 2, mirrored=made[1:])
    return fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=3.0), [design], push


def test_a_symmetric_mechanism_has_the_optimum_of_its_half():
    # a well-conditioned optimum
    found, regulariser = [], ShapeBounds() + fm.NumberBounds() + 1e-2 * StayClose()
    for half, force in ((True, 1.0), (False, 2.0)):
        sim, designs, push = guided(half=half)
        drawn = sim.load_displacement(push, forces=[force, 2.0 * force]).displacements
        pairs = zip((1.0, 2.0), (1.2, 1.3), drawn, strict=True)
        targets = [fm.Target(push, force=f * force, displacement=factor * float(u)) for f, factor, u in pairs]
        feet = [joint for joint in sim.scene.mechanism.joints if joint.at[1] == 0.0]
        shift = fm.JointPosition(*feet, direction=[(1, 0), (-1, 0)][: len(feet)])
        designs = [*designs, fm.Number(shift, -2.0, 2.0)]
        found.append(fm.DesignProblem(sim, designs, targets=targets, regulariser=regulariser).optimise(**EXACT))
    one, both = found
    assert [n.value for n in both.numbers] == pytest.approx([n.value for n in one.numbers], abs=1e-7)
    assert all(abs(number.value) > 0.01 for number in one.numbers)
    assert both.links[0].mirrored == ("leg 1",)
    assert both.links[0].parameters == pytest.approx(one.links[0].parameters, abs=1e-8)
    assert both.objective[1] == pytest.approx(one.objective[1], rel=1e-8)


def test_two_links_apart_that_share_a_shape_have_the_optimum_of_one():
    found = []
    for count in (1, 2):
        mechanism = fm.Mechanism("apart")
        ground, links, targets = mechanism.rigid("ground", fixed=True), [], []
        for k, move in enumerate((lambda x: x, turned)[:count]):
            points, hand = move(LEG), mechanism.rigid(f"hand {k}")
            links.append(mechanism.flexible(f"leg {k}", fm.strip(points, thickness=2.0, depth=5.0), PLASTIC))
            mechanism.weld(ground, links[-1], at=points[0], interface_radius=2.0)
            mechanism.weld(hand, links[-1], at=points[-1], interface_radius=2.0)
            push = mechanism.force(on=hand, at=points[-1], direction=(1.0 - 2.0 * k, 0.0), name=f"push {k}")
            targets.append(fm.Target(push, force=1.0, displacement=1.5, weight=1.0 / count))
        sim = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=3.0)
        design = fm.SplineDesign(links[0], 2, same=links[1:])
        found.append(fm.DesignProblem(sim, [design], targets=targets).optimise(**EXACT))
    one, both = found
    assert both.links[0].parameters == pytest.approx(one.links[0].parameters, abs=1e-8)
    assert both.objective[1] == pytest.approx(one.objective[1], rel=1e-8)


@pytest.mark.thorough
def test_results_files_pictures_and_parts_have_all_links_of_a_shape(tmp_path):
    own = case(mirrored)
    problem = own.problem(size=3.0)
    result = problem.verify(problem.optimise(), tmp_path / "parts")
    assert result.parameters == 12 and [link.names for link in result.links] == [("leg 0", "leg 1")]
    assert abs(result.targets[0].part.error) < 0.01
    assert sorted(file.name for file in (tmp_path / "parts").iterdir()) == ["leg-0.step", "leg-1.step"]
    problem.picture(tmp_path / "links.png", result)
    result.save(tmp_path / "design.json")
    loaded = fm.DesignResult.load(tmp_path / "design.json")
    assert loaded == result
    (push,) = own.scene.mechanism.forces
    once, again = (
        problem.simulation.with_design(design).load_displacement(push, forces=[1.0]).displacements
        for design in (result, loaded)
    )
    assert again == pytest.approx(once, rel=1e-12)
    assert once == pytest.approx([result.targets[0].reached], rel=1e-6)


def test_exports_count_the_links_that_are_one_part(tmp_path):
    scene, made, push = legs(mirrored, shifted, turned)
    plain = scene.mechanism.flexible("brace", fm.strip([(0, 40), (40, 40)], thickness=2.0, depth=5.0), PLASTIC)
    for end in (0, 40):
        scene.mechanism.weld(scene.mechanism.links[1], plain, at=(end, 40), interface_radius=2.0)
    sim = fm.Simulation(scene, space="plane-stress", size=3.0)
    designs = [fm.SplineDesign(made[0], 2, mirrored=made[1], same=made[2:]), fm.Number(fm.Depth(plain), 2.0, 9.0)]
    problem = fm.DesignProblem(sim, designs, targets=[fm.Target(push, force=1.0, displacement=0.1)])
    problem.export(tmp_path, problem.initial)
    first, second = json.loads((tmp_path / "parts.json").read_text())["parts"]
    assert (first["file"], first["count"], first["material"]) == ("leg-0.step", 4, "plastic")
    assert sorted(first["links"]) == ["leg 0", "leg 1", "leg 2", "leg 3"]
    assert (second["file"], second["count"], second["depth"]) == ("brace.step", 1, 5.0)
    volumes = [_volume(tmp_path / f"leg-{k}.step") for k in range(4)]  # of solids that are one part
    assert volumes == pytest.approx([volumes[0]] * 4, rel=1e-6)


def test_links_of_a_shape_that_a_design_makes_of_two_materials_are_two_parts(tmp_path):
    own = case(mirrored)
    one, other = own.scene.mechanism.flexible_links
    stiffness = fm.Number(fm.LawParameter("E", other), 1000.0, 4000.0)
    problem = Case(own.scene, [*own.designs, stiffness], own.targets).problem()
    problem.export(tmp_path, np.append(problem.initial[:-1], 0.5))
    parts = json.loads((tmp_path / "parts.json").read_text())["parts"]
    assert [(part["links"], part["count"], part["law"]["E"]) for part in parts] == [
        ([one.name], 1, 2000.0),
        ([other.name], 1, 2500.0),
    ]


def _volume(file: Path) -> float:
    with gmsh_session("part"):
        (solid,) = gmsh.model.occ.importShapes(str(file))
        return gmsh.model.occ.getMass(*solid)


@pytest.mark.thorough
def test_imported_links_share_a_shape_up_to_their_meshes(tmp_path):
    own = case(mirrored)
    drawn = own.problem(size=3.0)
    drawn.export(tmp_path, drawn.initial)
    files = {
        link: fm.step_file(tmp_path / f"{link.name.replace(' ', '-')}.step", depth=5.0) for link in own.designs[0].links
    }
    imported = drawn.simulation.with_shapes(files)
    problem = fm.DesignProblem(imported, own.designs, targets=own.targets)
    p = problem.initial + 0.1 * np.random.default_rng(3).standard_normal(len(problem.initial))
    design = problem.rest_shape(p)
    assert np.max(np.abs(design.field)) > 0.05
    result = problem.optimise()
    assert result.worst_error < 0.01


def test_checkpoints_of_shapes_that_are_shared_in_another_way_are_refused(tmp_path):
    scene, (one, other), push = legs(shifted, leg=np.array([(10.0, 0.0), (10.0, 30.0)]))
    file, targets = tmp_path / "checkpoint.json", [fm.Target(push, force=1.0, displacement=0.1)]

    def problem(**how) -> fm.DesignProblem:
        return Case(scene, [fm.SplineDesign(one, 2, **how)], targets).problem(space="plane-stress", size=4.0)

    once = {"optimiser": fm.LevenbergMarquardt(iterations=1), "surrogate": None, "checkpoint": file}
    problem(same=other).optimise(**once)
    assert problem(same=other).optimise(**once, resume=True).iterations == 1
    with pytest.raises(fm.DescriptionError, match="another problem, with other links"):
        problem(mirrored=other).optimise(**once, resume=True)


def test_links_that_are_not_images_are_refused():
    def problem(scene, design, push) -> Callable[[], fm.DesignProblem]:
        sim = fm.Simulation(scene, space="plane-stress", size=3.0)
        targets = [fm.Target(push, force=1.0, displacement=1.0)]
        return lambda: fm.DesignProblem(sim, [*design], targets=targets)

    scene, (one, other), push = legs(mirrored)
    as_same = [fm.SplineDesign(one, 2, same=other)]
    refused(problem(scene, as_same, push), part="'leg 0'", problem="'leg 1'", remedy="same=… and mirrored=…")
    thick, (a, b), force = legs(mirrored, thickness=3.0)
    unlike = [fm.SplineDesign(a, 2, mirrored=b)]
    refused(problem(thick, unlike, force), part="'leg 0'", problem="up to 0.5 away", remedy="Draw both alike")
    wide, (c, d), force = legs(mirrored, radius=2.5)
    held = [fm.SplineDesign(c, 2, mirrored=d)]
    refused(problem(wide, held, force), part="'leg 0'", problem="no motion", remedy="same joints")
    twice = [fm.SplineDesign(one, 2, mirrored=other), fm.SplineDesign(other, 2)]
    refused(problem(scene, twice, push), part="'leg 1'", problem="twice", remedy="once")
    deep = [fm.SplineDesign(one, 2, mirrored=other), fm.Number(fm.Depth(one), 2.0, 8.0)]
    refused(problem(scene, deep, push), part="depth of 'leg 0'", problem="'leg 1' shares", remedy="all links")
    refused(lambda: fm.SplineDesign(one, 2, same=one), part="'leg 0'", problem="twice", remedy="once")
    refused(lambda: fm.SplineDesign(one, 2, same="leg 1"), part="'leg 0'", problem="not flexible", remedy="Name links")


def test_a_symmetric_mechanism_has_a_symmetric_mesh_and_keeps_its_symmetry():
    sim, _, push = guided(half=False)
    frame = sim.load_displacement(push, forces=[5.0]).frames[-1]
    forces = [reaction.force for reaction in frame.reactions.values()]
    left, right = forces[2], forces[-1]
    assert np.abs(left) == pytest.approx(np.abs(right), rel=1e-9)
