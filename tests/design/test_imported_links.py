"""Designs of links known by their outline: centreline and thickness are those of the CAD curves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design import MeshQuality, ParametricShape, ShapeBounds, StayClose, rest_meshes
from fenicsmech.export import write_step
from fenicsmech.mechanism import Centreline, Disc, Shape
from fenicsmech.meshing import InterfaceSite, LinkOutline, boundary_polygons, find_centreline, link_outline

from ..ranks import EACH_COMM
from .mechanisms import PLASTIC, Case, objective, truss
from .refusal import refused

CURVED = fm.step_file(Path(__file__).parents[2] / "meshes" / "curved_link.step", depth=10.0)
CURVED_PINS = ((0.0, 0.0), (60.0, 0.0))  # an arc of radius 50 about (30, −40), 3 thick, with eyes of radius 4

THICK, THIN, LENGTH = 6.0, 3.0, 60.0
WEDGE = fm.polygon([(0, -THICK / 2), (LENGTH, -THIN / 2), (LENGTH, THIN / 2), (0, THICK / 2)], depth=5.0)


def measured(shape: Shape, pins, *, radius: float = 1.0, ends=None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points along the centreline found, thickness there, and which of them are free of pins and eyes."""
    sites = [InterfaceSite(at, Disc(radius), name=f"pin {k}") for k, at in enumerate(pins)]
    outline = LinkOutline(link_outline("part", shape, dim=2), sites)
    curve = Centreline(find_centreline(outline, [radius] * len(pins), ends))
    s = np.linspace(0.0, curve.end, 400)
    points, tangents = curve.evaluate(s), curve.tangent(s)
    return points, outline.thickness(points, tangents, part="part"), ~outline.chords(points, tangents).fixed


@pytest.mark.parametrize("unit", [1.0, 1000.0], ids=["mm", "m"])
@pytest.mark.parametrize(
    ("pins", "ends", "span"),
    [
        ([(5, 0), (55, 0)], None, (5, 55)),
        ([(0, 0), (60, 0)], None, (0, 60)),
        ([(5, 0)], None, (5, 60)),
        ([(30, 0)], None, (0, 60)),
        ([(30, 0)], [(20, 0), (50, 0)], (20, 50)),
    ],
    ids=["between pins", "from edge to edge", "free end", "two free ends", "given ends"],
)
def test_a_wedge_is_as_thick_as_drawn_at_every_station(pins, ends, span, unit):
    def scaled(points):
        return None if points is None else [tuple(np.array(point) / unit) for point in points]

    corners = [WEDGE.start, *(line.end for line in WEDGE.segments[:-1])]
    shape = fm.polygon(scaled(corners), depth=5.0)
    points, thickness, free = (np.array(a) for a in measured(shape, scaled(pins), radius=1.0 / unit, ends=scaled(ends)))
    points, thickness = points * unit, thickness * unit
    assert sorted(points[[0, -1], 0]) == pytest.approx(span, abs=1e-6)
    assert np.abs(points[:, 1]).max() < 1e-6
    drawn = THICK + (THIN - THICK) * points[:, 0] / LENGTH
    assert free.mean() > 0.85
    assert thickness[free] == pytest.approx(drawn[free], rel=1e-6)


def test_a_ring_sector_is_as_thick_as_the_difference_of_its_radii_and_its_eyes_do_not_count():
    points, thickness, free = measured(CURVED, CURVED_PINS, radius=1.5)
    off = np.linalg.norm(points - (30.0, -40.0), axis=1) - 50.0
    assert np.abs(off).max() < 1e-4  # the spline between its stations; 3 thick
    assert points[[0, -1]] == pytest.approx(np.array(CURVED_PINS), abs=1e-9)
    assert thickness == pytest.approx(3.0, rel=1e-6)
    assert 0.8 < free.mean() < 1.0


def test_a_rounded_free_end_takes_the_thickness_next_to_it():
    shape = fm.outline((0, -2), [fm.Line((50, -2)), fm.Arc((52, 0), (50, 2)), fm.Line((0, 2))], depth=5.0)
    points, thickness, _ = measured(shape, [(1, 0)])
    assert points[-1] == pytest.approx([52.0, 0.0], abs=1e-6)
    round_there = points[:, 0] > 50.0
    assert thickness[~round_there] == pytest.approx(4.0, rel=1e-6)
    assert thickness[-1] > 0.5 * 4.0


def test_a_mesh_file_has_the_centreline_and_thickness_of_its_boundary():
    shape = fm.gmsh_mesh(Path(__file__).parents[2] / "meshes" / "strip2d.msh", depth=10.0)
    points, thickness, _ = measured(shape, CURVED_PINS, radius=3.0)
    assert np.abs(points[:, 1]).max() < 1e-6
    assert thickness == pytest.approx(3.0, rel=1e-6)


def arm(shape: Shape, *, radius: float = 3.0, **design) -> Case:
    """A link on two pins of a base and a slide, pushed along their line."""
    mechanism = fm.Mechanism("arm")
    base, slide = mechanism.rigid("base", fixed=True), mechanism.rigid("slide")
    link = mechanism.flexible("arm", shape, PLASTIC)
    mechanism.revolute(base, link, at=CURVED_PINS[0], interface_radius=radius)
    mechanism.revolute(link, slide, at=CURVED_PINS[1], interface_radius=radius)
    mechanism.prismatic(base, slide, at=CURVED_PINS[1], axis=(1, 0))
    push = mechanism.force(on=slide, at=CURVED_PINS[1], direction=(-1, 0), name="push")
    target = fm.Target(push, force=2.0, displacement=0.2)
    return Case(fm.Scene(mechanism), [fm.SplineDesign(link, 3, **design)], [target])


def test_thickness_of_a_step_part_does_not_depend_on_the_mesh_and_drawn_designs_are_the_part():
    case, found = arm(CURVED), []
    for size in (3.0, 1.5):
        simulation = case.simulate(size=size, order=1)
        rest = ParametricShape.of(simulation, case.designs)
        assert np.abs(rest.design(rest.initial, None).field).max() < 1e-9  # as imported, whatever handles would be best
        found.append(rest.links[0])
    assert np.array_equal(found[0].thickness, found[1].thickness)
    assert found[0].spline.initial == pytest.approx(found[1].spline.initial, abs=1e-12)
    assert found[0].thickness == pytest.approx(3.0, rel=1e-4)  # across the fitted spline, which is not quite an arc
    # the sides of spline and thickness are those of the part
    spline, t = found[0].spline, found[0].samples.t
    curve, slope = spline.evaluate(spline.initial, t)[:, :2], spline.derivative(spline.initial, t)[:, :2]
    normals = np.column_stack([-slope[:, 1], slope[:, 0]]) / np.linalg.norm(slope, axis=1, keepdims=True)
    for side in (-0.5, 0.5):
        edge = curve + side * found[0].thickness[:, None] * normals
        away = np.linalg.norm(edge - (30.0, -40.0), axis=1)
        assert np.minimum(abs(away - 48.5), abs(away - 51.5)).max() < 0.02 * 3.0


def test_default_bounds_are_relative_to_the_thickness_drawn_at_each_place():
    mechanism = fm.Mechanism("wedge")
    base = mechanism.rigid("base", fixed=True)
    wedge = mechanism.flexible("wedge", WEDGE, PLASTIC)
    for x in (5, 55):
        mechanism.revolute(base, wedge, at=(x, 0), interface_radius=1.0)
    case = Case(fm.Scene(mechanism), [fm.SplineDesign(wedge, 2)])
    rest = ParametricShape.of(case.simulate(order=1), case.designs)
    (link,) = rest.links
    least, most = link.bounds.thickness
    assert np.ptp(link.thickness) == pytest.approx((THICK - THIN) * 48.0 / LENGTH, rel=1e-2)
    assert least == pytest.approx(link.thickness / 3.0) and most == pytest.approx(3.0 * link.thickness)
    assert fm.SplineDesign(wedge, 2, thickness=(2.0, 8.0)).bounds(link.thickness).thickness == (2.0, 8.0)
    tight = fm.SplineDesign(wedge, 2, thickness=(4.0, 8.0))
    refused(lambda: tight.bounds(link.thickness), part="'wedge'", problem="drawn thickness", remedy="bounds")


def test_half_as_thick_designs_of_a_wedge_are_half_as_thick_everywhere():
    mechanism = fm.Mechanism("wedge")
    base = mechanism.rigid("base", fixed=True)
    wedge = mechanism.flexible("wedge", WEDGE, PLASTIC)
    mechanism.weld(base, wedge, at=(0, 0), region=fm.Rectangle(10.0, 8.0))
    case = Case(fm.Scene(mechanism), [fm.SplineDesign(wedge, 2)])
    simulation = case.simulate(size=1.5)
    rest = ParametricShape.of(simulation, case.designs)
    (link,) = rest.links
    spline = link.spline
    controls = spline.controls.copy()
    controls[:, 0, 2] = np.where(spline.is_joint, 1.0, 0.5)
    controls[:, 1, 2] = [-0.75, 0.0, 0.0]  # from the clamp on
    p = controls.ravel()[spline.entries]
    rest.place(p, None)
    (mesh,) = rest_meshes(simulation, [wedge])
    polygon = boundary_polygons("wedge", mesh)[0]
    sides = [np.array(sorted(map(tuple, polygon[half]))) for half in (polygon[:, 1] > 0.0, polygon[:, 1] < 0.0)]
    for x in (40.0, 50.0):  # more than two handles from where δ begins to be a half
        upper, lower = (np.interp(x, *side.T) for side in sides)
        drawn = THICK + (THIN - THICK) * x / LENGTH
        assert upper - lower == pytest.approx(0.5 * drawn, rel=0.03)


def test_a_wedge_with_one_joint_reaches_the_targets_of_its_free_end():
    mechanism = fm.Mechanism("wedge")
    base = mechanism.rigid("base", fixed=True)
    wedge = mechanism.flexible("wedge", WEDGE, PLASTIC)
    mechanism.weld(base, wedge, at=(0, 0), region=fm.Rectangle(10.0, 8.0))
    push = mechanism.force(on=wedge, at=(LENGTH, 0), direction=(0, -1), region=fm.Face(), name="push")
    targets = [fm.Target(push, force=force, displacement=wanted) for force, wanted in ((5.0, 4.0), (15.0, 11.0))]
    result = Case(fm.Scene(mechanism), [fm.SplineDesign(wedge, 2)], targets).problem().optimise()
    assert result.converged and result.worst_error < 0.01
    (link,) = result.links
    assert link.controls[-1][0][:2] == pytest.approx([LENGTH, 0.0], abs=1e-6)  # ends stay unless they may move
    assert THIN / 3.0 < link.thickness[0] < link.thickness[1] < 3.0 * THICK


def test_a_link_from_a_mesh_file_keeps_its_mesh_at_the_initial_design():
    case = arm(fm.gmsh_mesh(Path(__file__).parents[2] / "meshes" / "strip2d.msh", depth=10.0), radius=2.0)
    rest = ParametricShape.of(case.simulate(), case.designs)
    assert np.abs(rest.design(rest.initial, None).field).max() < 1e-9
    assert rest.links[0].thickness == pytest.approx(3.0, rel=1e-6)


@pytest.mark.thorough
def test_a_strip_from_a_step_file_has_the_same_optimum_as_the_strip(tmp_path):
    case = truss((0.1, 6.0), (0.4, 9.0))
    simulation = case.simulate(size=2.0)
    (diagonal,) = case.scene.mechanism.flexible_links
    (mesh,) = rest_meshes(simulation, [diagonal])
    write_step(tmp_path / "diagonal.step", mesh, depth=diagonal.shape.depth, name="diagonal")
    part = fm.step_file(tmp_path / "diagonal.step", depth=diagonal.shape.depth)
    other = simulation.with_shapes({diagonal: part})
    drawn = fm.DesignProblem(simulation, case.designs, targets=case.targets)
    imported = fm.DesignProblem(other, case.designs, targets=case.targets)
    assert imported.initial == pytest.approx(drawn.initial, abs=1e-3)
    push, forces = case.targets[0].quantity.part, [0.1, 0.2, 0.3, 0.4]
    curves = [
        own.with_design(problem.optimise()).load_displacement(push, forces=forces)
        for own, problem in ((simulation, drawn), (other, imported))
    ]
    assert curves[0].displacements[[0, -1]] == pytest.approx([6.0, 9.0], rel=5e-3)
    assert curves[1].displacements == pytest.approx(curves[0].displacements, rel=1e-3)


@pytest.mark.parametrize("comm", EACH_COMM)
def test_gradient_of_a_link_from_a_step_file_is_that_of_its_objective(comm):
    regulariser = MeshQuality(limit=2.5, width=2.5) + ShapeBounds() + 1e-3 * StayClose()
    whole, bench = objective(arm(CURVED), regulariser, comm=comm)
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    here = whole.evaluate(p)
    ahead, back = (whole.evaluate(p + h * direction) for h in (1e-3, -1e-3))
    assert here.gradient @ direction == pytest.approx((ahead.value - back.value) / 2e-3, rel=1e-5)


def test_ends_of_strips_and_joints_on_branches_are_refused():
    strip = arm(fm.strip(CURVED_PINS, thickness=3.0, depth=5.0), ends=CURVED_PINS)
    refused(lambda: strip.problem(), part="'arm'", problem="strip has a centreline", remedy="out")
    tee = fm.polygon([(0, 0), (60, 0), (60, 4), (32, 4), (32, 30), (28, 30), (28, 4), (0, 4)], depth=5.0)
    with pytest.raises(fm.DescriptionError, match="on a branch"):
        measured(tee, [(2, 2), (58, 2), (30, 28)])
    link = arm(CURVED).scene.mechanism.flexible_links[0]
    with pytest.raises(fm.DescriptionError, match="both given"):
        fm.SplineDesign(link, 2, centreline=CURVED_PINS, ends=CURVED_PINS)
    with pytest.raises(fm.DescriptionError, match="3 ends"):
        fm.SplineDesign(link, 2, ends=[(0, 0), (1, 1), (2, 2)])


@pytest.mark.thorough
def test_the_length_of_an_imported_link_is_that_of_its_arc_and_is_found_again_in_the_part():
    case = arm(CURVED)
    link, (push,) = case.designs[0].link, case.scene.mechanism.forces
    arc, length = 100.0 * np.arcsin(0.6), fm.CentrelineLength(case.designs[0].link)
    simulation = case.simulate(size=3.0)
    assert length.on(simulation.model).value() == pytest.approx(arc, rel=1e-4)
    targets = [fm.Target(push, force=2.0, displacement=0.2), fm.Target(length, equals=1.01 * arc)]
    problem = fm.DesignProblem(simulation, [fm.SplineDesign(link, 3)], targets=targets)
    result = problem.verify(problem.optimise())
    assert result.targets[1].reached == pytest.approx(1.01 * arc, rel=5e-3)
    assert result.targets[1].part.value == pytest.approx(result.targets[1].reached, rel=2e-3)


def test_derivatives_of_the_length_of_an_imported_link_agree_with_central_differences():
    base = arm(CURVED)
    case = Case(base.scene, base.designs, [fm.Target(fm.CentrelineLength(base.designs[0].link), equals=60.0)])
    whole, bench = objective(case, StayClose(), size=3.0)
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    slope = whole.evaluate(p).jacobian @ direction
    ahead, back = (whole.evaluate(p + h * direction).residuals for h in (1e-3, -1e-3))
    assert slope == pytest.approx((ahead - back) / 2e-3, rel=1e-5)
