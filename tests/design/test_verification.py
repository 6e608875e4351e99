"""Designs in their exported parts: the same numbers as of a scene drawn with the files, and of finer meshes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech import model

from .mechanisms import PLASTIC, bow, truss
from .refusal import refused

WANTED = ((0.1, 2.0), (0.4, 3.2))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Where ``verified`` writes its files."""
    return tmp_path_factory.mktemp("parts")


@pytest.fixture(scope="module")
def verified(folder) -> tuple[fm.DesignProblem, fm.DesignResult, fm.DesignResult]:
    """A design of the truss finger on coarse elements, before and after its verification in files."""
    problem = truss(*WANTED).problem()
    result = problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=3))
    return problem, result, problem.verify(result, folder)


def parts(result: fm.DesignResult) -> np.ndarray:
    """Value, estimate and error of each target in the part, (targets, 3)."""
    found = [target.part for target in result.targets]
    assert all(found)
    return np.array([[own.value, own.finer_elements_add, own.error] for own in found])


def test_parts_have_the_values_of_a_scene_drawn_with_the_files(verified, folder):
    *_, result = verified
    assert [path.name for path in folder.iterdir()] == ["diagonal.step"]
    finger = fm.Mechanism("truss finger")
    base = finger.rigid("base", fixed=True)
    left, right, tip = (finger.rigid(name) for name in ("left", "right", "tip"))
    diagonal = finger.flexible("part", fm.step_file(folder / "diagonal.step", depth=20.0), fm.SMOOTH_SIL_950)
    for a, b, at in ((base, left, (0, 0)), (base, right, (40, 0)), (left, tip, (0, 60)), (right, tip, (40, 60))):
        finger.revolute(a, b, at=at)
    finger.revolute(base, diagonal, at=(0, 0), interface_radius=3.0)
    finger.revolute(diagonal, tip, at=(40, 60), interface_radius=3.0)
    push = finger.force(on=tip, at=(20, 70), direction=(1, 0))
    again = fm.Simulation(fm.Scene(finger), space="plane-stress", size=1.5)
    curve = again.load_displacement(push, forces=[0.1, 0.4])
    assert parts(result)[:, 0] == pytest.approx(curve.displacements, rel=1e-8)
    assert parts(result)[:, 1] == pytest.approx(curve.error_estimates(), rel=1e-6)


@pytest.mark.thorough
def test_errors_in_the_part_are_those_of_still_finer_elements(verified):
    problem, result, half = verified
    assert [target.part for target in result.targets] == [None, None]
    quarter = problem.verify(result, finer=4.0)
    assert np.sum(parts(half)[:, :2], axis=1) == pytest.approx(np.sum(parts(quarter)[:, :2], axis=1), rel=1e-3)
    wanted = np.array([displacement for _, displacement in WANTED])
    assert parts(half)[:, 2] == pytest.approx(np.sum(parts(half)[:, :2], axis=1) / wanted - 1.0)
    assert half.worst_part_error == pytest.approx(np.abs(parts(half)[:, 2]).max())
    assert result.worst_part_error is None


def test_results_print_both_numbers_and_keep_them_in_files(verified, tmp_path):
    _, result, half = verified
    assert "in the part" in str(half) and "in the part" not in str(result)
    assert half.part_fidelity == "plane-stress, elements of 1.5 mm"
    half.save(tmp_path / "design.json")
    assert fm.DesignResult.load(tmp_path / "design.json") == half
    data = json.loads((tmp_path / "design.json").read_text())
    assert data["targets"][0]["part"]["value"] == half.targets[0].part.value


def test_other_shapes_bend_as_if_drawn_in_these_shapes():
    def link(thickness: float):
        rig = fm.Mechanism("cantilever")
        wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
        strip = rig.flexible("strip", fm.strip([(0, 0), (60, 0)], thickness=thickness, depth=5.0), fm.ONYX)
        rig.weld(wall, strip, at=(0, 0), region=fm.Rectangle(6, 9))
        rig.weld(strip, hand, at=(60, 0), region=fm.Rectangle(6, 9))
        push = rig.force(on=hand, at=(60, 0), direction=(0, 1))
        return fm.Simulation(fm.Scene(rig), space="plane-stress", size=1.5), strip, push

    def moved(sim, push) -> float:
        return float(sim.load_displacement(push, forces=[1.0]).displacements[0])

    sim, strip, push = link(3.0)
    thicker, same, drawn_push = link(4.0)
    other = sim.with_shapes({strip: same.shape})
    assert moved(other, push) == pytest.approx(moved(thicker, drawn_push), rel=1e-12)
    assert moved(sim, push) / moved(other, push) == pytest.approx((4.0 / 3.0) ** 3, rel=0.02)


def test_other_shapes_are_refused(verified):
    problem, result, _ = verified
    sim, (diagonal,) = problem.simulation, problem.simulation.scene.mechanism.flexible_links
    refused(lambda: sim.with_shapes({diagonal: 3.0}), part="truss finger", problem="3.0", remedy="{link: shape")
    refused(lambda: problem.verify(result, finer=0.0), part="refinement", problem="0", remedy="greater than zero")
    other = truss((0.1, 1.0)).problem()
    refused(lambda: other.verify(result), part="truss finger", problem="other targets", remedy="this problem")


@pytest.fixture(scope="module")
def bow_in_part(tmp_path_factory) -> tuple[fm.DesignProblem, fm.DesignResult, Path]:
    """A designed arch, loaded at a point of its own, whose height two outputs and a target tell too; and its file."""
    folder = tmp_path_factory.mktemp("bow")
    case = bow(10.0)
    mechanism, ((arch,), (target,)) = case.scene.mechanism, (case.scene.mechanism.flexible_links, case.targets)
    for k, region in enumerate((None, fm.Disc(2.0))):
        mechanism.output(on=arch, at=(40, 12), direction=(0, 1), region=region, name=f"height {k}")
    point = fm.Displacement(arch, at=(30, 14))
    targets = [target, *(fm.Target(fm.Displacement(own), target.sample, equals=-0.1) for own in mechanism.outputs)]
    targets.append(fm.Target(point, target.sample, equals=(0.1, -0.2)))
    targets.append(fm.Target(fm.Magnitude(point), target.sample, equals=0.3))
    problem = fm.DesignProblem(case.simulate(), case.designs, targets=targets)
    result = problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=1))
    return problem, problem.verify(result, folder), folder / "arch.step"


def test_forces_at_points_of_the_link_act_where_the_design_moves_these(bow_in_part):
    problem, result, file = bow_in_part
    drawn = problem.simulation
    (push,), (height, _) = drawn.scene.mechanism.forces, drawn.scene.mechanism.outputs
    moved = [drawn.with_design(result).path(part, [fm.DRAWN])[0] for part in (push, height)]
    assert np.linalg.norm(np.array(moved) - ((25, 13), (40, 12)), axis=1).max() > 0.5  # otherwise nothing is tested
    rig = fm.Mechanism("bow")
    base = rig.rigid("base", fixed=True)
    arch = rig.flexible("part", fm.step_file(file, depth=8.0), PLASTIC)
    for at in ((0, 0), (60, 0)):
        rig.revolute(base, arch, at=at, interface_radius=3.0)
    force = rig.force(on=arch, at=moved[0], direction=(0.6, -0.8))
    there = rig.output(on=arch, at=moved[1], direction=(0, 1))
    again = fm.Simulation(fm.Scene(rig), space="plane-stress", size=1.5)
    curve = again.load_displacement(force, forces=[10.0])
    found = [target.part.value for target in result.targets[:2]]
    assert found == pytest.approx([curve.displacements[0], curve.frames[0].outputs[there]], rel=1e-8)


def test_points_and_regions_of_designed_links_move_in_the_part_as_in_the_design(bow_in_part):
    _, result, _ = bow_in_part
    for target in result.targets:
        part = np.add(target.part.value, target.part.finer_elements_add)
        assert part == pytest.approx(np.array(target.corrected), rel=0.01)


def test_points_placed_elsewhere_are_where_paths_and_curves_have_them():
    (case, other), place = (bow(10.0), bow(10.0)), (40.0, 12.0)
    (push,), mechanism = case.scene.mechanism.forces, other.scene.mechanism
    drawn = mechanism.force(on=mechanism.flexible_links[0], at=place, direction=push.direction, name="there")
    placed = {push.material: fm.PlacedPoint(np.array([place]), np.ones(1))}
    sim = case.simulate().with_shapes({}, placed=placed)
    assert sim.path(push, [fm.DRAWN])[0] == pytest.approx(place, abs=1e-12)
    found, wanted = (s.load_displacement(p, forces=[5.0]) for s, p in ((sim, push), (other.simulate(), drawn)))
    assert found.displacements == pytest.approx(wanted.displacements, rel=1e-9)


def test_places_of_what_is_no_point_of_a_flexible_link_are_refused_by_name():
    case = bow(10.0)
    (push,), sim = case.scene.mechanism.forces, case.simulate()
    base = next(link for link in case.scene.mechanism.links if not isinstance(link, fm.FlexibleLink))
    place = fm.PlacedPoint(np.array([(40.0, 12.0)]), np.ones(1))
    for wrong in ({push: place}, {(base, (0.0, 0.0), None): place}, {push.material: (40.0, 12.0)}):
        with pytest.raises(fm.DescriptionError, match="Give {force.material: PlacedPoint") as caught:
            sim.with_shapes({}, placed=wrong)
        (key, value), said = next(iter(wrong.items())), str(caught.value)
        assert repr(key) in said and repr(value) in said


@pytest.mark.parametrize("region", [fm.Disc(2.0), pytest.param(fm.Face(), marks=pytest.mark.thorough)], ids=str)
def test_forces_on_regions_of_designed_links_act_on_these_in_the_part(region):
    mechanism = fm.Mechanism("bow")
    base = mechanism.rigid("base", fixed=True)
    line = [(-10, 0), (0, 0), (20, 0), (40, 0), (60, 0), (70, 0)]
    strip = mechanism.flexible("strip", fm.strip(line, thickness=4.0, depth=8.0), PLASTIC)
    for at in ((0, 0), (60, 0)):
        mechanism.revolute(base, strip, at=at, interface_radius=1.5)
    height = 2.0 if isinstance(region, fm.Face) else 1.0
    push = mechanism.force(on=strip, at=(25, height), direction=(0.6, -0.8), region=region)
    target = fm.Target(push, force=10.0, displacement=0.5)
    scene, design = fm.Scene(mechanism), fm.SplineDesign(strip, 4)
    problem = fm.DesignProblem(fm.Simulation(scene, space="plane-stress", size=3.0), [design], targets=[target])
    result = problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=2))
    (found,) = problem.verify(result).targets
    assert abs(found.corrected / problem.simulation.load_displacement(push, forces=[10.0]).displacements[0] - 1) > 0.2
    assert found.part.value + found.part.finer_elements_add == pytest.approx(found.corrected, rel=0.01)


@pytest.mark.thorough
def test_forces_beside_the_mid_plane_twist_the_part_as_they_twist_the_design():
    mechanism = fm.Mechanism("twisted")
    base = mechanism.rigid("base", fixed=True)
    strip = mechanism.flexible("strip", fm.strip([(0, 0), (40, 0)], thickness=6.0, depth=6.0), PLASTIC)
    mechanism.weld(base, strip, at=(2, 0), region=fm.Rectangle(4, 8))
    push = mechanism.force(on=strip, at=(38, 0, 2), direction=(0, -1), region=fm.Disc(1.5))
    top, below = (mechanism.output(on=strip, at=(38, 0, z), direction=(0, 1), name=f"{z}") for z in (2, -2))
    sample = fm.Sample({push: 5.0})
    targets = [fm.Target(fm.Displacement(own), sample, equals=-1.0) for own in (top, below)]
    sim = fm.Simulation(fm.Scene(mechanism), space="3d", size=3.0, layers=2)
    problem = fm.DesignProblem(sim, [fm.SplineDesign(strip, 2)], targets=targets)
    result = problem.verify(problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=1), surrogate=None))
    assert result.part_fidelity.startswith("3d,")
    for target in result.targets:
        part = target.part.value + target.part.finer_elements_add
        assert part == pytest.approx(target.corrected, rel=0.02)


@pytest.mark.thorough
def test_vectors_have_all_their_components_in_the_part():
    mechanism = fm.Mechanism("cantilever")
    base = mechanism.rigid("base", fixed=True)
    strip = mechanism.flexible("strip", fm.strip([(0, 0), (40, 0)], thickness=6.0, depth=6.0), PLASTIC)
    mechanism.weld(base, strip, at=(2, 0), region=fm.Rectangle(4, 8))
    push = mechanism.force(on=strip, at=(38, 0), direction=(0, -1), region=fm.Disc(1.5))
    target = fm.Target(fm.Displacement(strip, at=(30, 0)), fm.Sample({push: 5.0}), equals=(0.0, -1.0, 0.0))
    sim = fm.Simulation(fm.Scene(mechanism), space="3d", size=6.0, layers=1)
    problem = fm.DesignProblem(sim, [fm.SplineDesign(strip, 1)], targets=[target])
    result = problem.verify(problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=1), surrogate=None))
    (found,) = result.targets
    assert result.part_fidelity.startswith("3d,")
    part = np.add(found.part.value, found.part.finer_elements_add)
    assert part == pytest.approx(np.array(found.corrected), rel=0.05, abs=0.01 * abs(found.corrected[1]))


def test_effects_on_a_part_of_the_drawn_boundary_are_refused():
    case = bow(10.0)
    (arch,) = case.scene.mechanism.flexible_links
    scene = fm.Scene(case.scene.mechanism, [fm.Pressure(arch, 0.01, where=lambda x: x[:, 0] < 100.0)])
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    problem = fm.DesignProblem(simulation, case.designs, targets=case.targets)
    result = problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=1))
    refused(lambda: problem.verify(result), part="bow", problem="predicate is one of drawn points", remedy="step_file")


def flexure(size: float, shape: fm.Shape | None = None) -> tuple[fm.Simulation, fm.FlexibleLink, fm.Force]:
    """A slanting leaf whose end is pushed across on a rail; it snaps, under more in larger elements of degree one."""
    rig = fm.Mechanism("flexure")
    ground, hub = rig.rigid("ground", fixed=True), rig.rigid("hub")
    shape = shape or fm.strip([(0, 0), (40, 6)], thickness=2.0, depth=5.0)
    leaf = rig.flexible("leaf", shape, fm.Material("plastic", 2000.0, 0.35))
    rig.weld(ground, leaf, at=(2, 0), region=fm.Rectangle(4, 6))
    rig.weld(leaf, hub, at=(38, 6), region=fm.Rectangle(4, 6))
    rig.prismatic(ground, hub, at=(40, 6), axis=(0, 1))
    push = rig.force(on=hub, at=(40, 6), direction=(0, -1))
    return fm.Simulation(fm.Scene(rig), space="plane-stress", order=1, size=size), leaf, push


@pytest.mark.thorough
def test_parts_that_elements_of_the_optimiser_do_not_carry_are_loaded_from_zero(tmp_path):
    def problem(size: float) -> fm.DesignProblem:
        sim, leaf, push = flexure(size)
        target = fm.Target(push, force=20.0, displacement=2.0)
        return fm.DesignProblem(sim, [fm.Number(fm.Depth(leaf), 4.5, 5.5)], targets=[target])

    result = problem(2.0).optimise(optimiser=fm.LevenbergMarquardt(iterations=1))
    softer = problem(1.0)
    assert softer.verify(result).worst_part_error is None  # not carried
    found = softer.verify(result, tmp_path, finer=0.5)
    again, _, push = flexure(2.0, fm.step_file(tmp_path / "leaf.step", depth=result.numbers[0].value))
    curve = again.load_displacement(push, forces=[20.0])
    assert parts(found)[:, 0] == pytest.approx(curve.displacements, rel=1e-8)


def test_parts_that_are_not_meshed_in_elements_of_the_optimiser_are_loaded_from_zero(verified, monkeypatch, caplog):
    problem, result, half = verified
    mesh_link = model.mesh_link

    def fine_only(name, shape, *, size, **options):
        if size == 3.0:
            raise fm.MeshingError(f"link {name!r}", "elements are too large", "Give smaller ones")
        return mesh_link(name, shape, size=size, **options)

    monkeypatch.setattr(model, "mesh_link", fine_only)
    with caplog.at_level("INFO", logger="fenicsmech"):
        found = problem.verify(result)
    assert "elements are too large" in caplog.text
    assert parts(found)[:, 0] == pytest.approx(parts(half)[:, 0], rel=1e-7)
