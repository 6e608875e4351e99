"""The files a demo leaves and the figures it prints."""

from __future__ import annotations

import resource
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from time import perf_counter

import numpy as np
from common import Demo
from mpi4py import MPI

import fenicsmech as fm
from benchmarks.table import format_table
from fenicsmech.files import write_json
from fenicsmech.plot import PALETTE, CurveTarget, plot_curve


@dataclass(frozen=True)
class Outcome:
    """What a demo found.

    Attributes:
        demo: the run.
        sim: the simulation, in the shape of ``curves``.
        curves: of the final design; of the drawn one if nothing was optimised.
        targets: what is wanted.
        before: curves of the drawn design.
        problem, result: the optimisation, None if there was none.
        coarse: the plane-stress optimum that a 3D optimisation started from.
        pin: diameter of pin holes in exported links.
    """

    demo: Demo
    sim: fm.Simulation
    curves: Sequence[fm.Curve]
    targets: Sequence[fm.Target]
    before: Sequence[fm.Curve] = ()
    problem: fm.DesignProblem | None = None
    result: fm.DesignResult | None = None
    coarse: fm.DesignResult | None = None
    pin: float | None = None


def leave(outcome: Outcome) -> None:
    """Leaves pictures, curves, fields, designs and summary in the demo's folder, prints what was found (collective)."""
    demo, curves, result, folder = outcome.demo, outcome.curves, outcome.result, outcome.demo.folder
    curves[0].picture(folder / "mechanism.png", beside=curves[1:])
    for curve in curves:
        curve.write(folder / f"deformed{_suffix(curve, curves)}.xdmf")
        curve.write_csv(folder / f"curve{_suffix(curve, curves)}.csv", errors=True)
    if result is not None:
        outcome.problem.picture(folder / "links.png", result)
        outcome.problem.export(folder / "links", result, pin_diameter=outcome.pin)
    errors = [curve.error_estimates() for curve in curves]
    summary = summarise(outcome, errors)
    if not demo.leads:
        return
    _plot(outcome)
    if result is not None:
        result.save(folder / "design.json")
    write_json(folder / "summary.json", summary)
    tell(outcome, summary)


def summarise(outcome: Outcome, errors: Sequence[np.ndarray]) -> dict:
    """The summary of a run, with the error estimates of its curves (collective)."""
    demo, sim, curves, result = outcome.demo, outcome.sim, outcome.curves, outcome.result
    peak = sim.comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, op=MPI.MAX) / 1024.0
    summary = {
        "demo": demo.name,
        "space": demo.options.space,
        "order": demo.options.order,
        "ranks": sim.comm.size,
        "dofs": {"rigid": sim.model.rigid_dofs, "flexible": sim.model.flexible_dofs},
        "parameters": result and result.parameters,
        "targets": _targets(outcome),
        "frames": [
            frame | {"displacement_error": float(error)}  # the forces are prescribed
            for frame, error in zip(_frames(curves), np.concatenate(errors), strict=True)
        ],
        "seconds": _seconds(outcome),
        "iterations": sum(frame.iterations for frame in _loaded(curves)) if result is None else result.iterations,
        "evaluations": result and result.evaluations,
        "objective": dict(zip(("initial", "final"), result.objective if result else (None, None), strict=True)),
        "objective_error": result and result.objective_error,
        "thickness": result and result.thickness,
        "mesh_ratio_max": sim.mesh_ratio_max,
        "remarks": [remark for curve in curves for remark in curve.remarks],
        "peak_memory_mb": peak,
    }
    if result is not None:
        summary |= _design(outcome)
    if outcome.coarse is not None:
        summary["plane_stress"] = _plane_stress(outcome)
    return summary


def _targets(outcome: Outcome) -> list[dict]:
    """What is wanted, beside what was reached if there was an optimisation."""
    reached = [(None, None)] * len(outcome.targets)
    if outcome.result is not None:
        reached = [(target.reached, target.finer_elements_add) for target in outcome.result.targets]
    return [
        {
            "configuration": t.configuration.name,
            "force": t.force,
            "wanted": t.displacement,
            "reached": there,
            "reached_error": error,
        }
        for t, (there, error) in zip(outcome.targets, reached, strict=True)
    ]


def _seconds(outcome: Outcome) -> dict:
    sim, result, coarse = outcome.sim, outcome.result, outcome.coarse
    return {
        "setup": sim.setup_seconds,
        "frame_median": median(frame.seconds for frame in _loaded(outcome.curves)),
        "optimize": result and result.seconds + (coarse.seconds if coarse else 0.0),
        "phases": sim.clock.seconds,
    }


def _design(outcome: Outcome) -> dict:
    """What the summary of an optimisation has beside that of a simulation."""
    result = outcome.result
    return {
        "worst_error": result.worst_error,
        "verified": result.verified,
        "curvature_ratio_max": max(link.bend for link in result.links),
        "active_bounds": result.active,
        "ended": result.reason,
        "optimize_phases": result.phases,
        "initial_frames": _frames(outcome.before),
    }


def _plane_stress(outcome: Outcome) -> dict:
    """The optimisation in plane stress that the one in space started from."""
    coarse = outcome.coarse
    return {
        "seconds": coarse.seconds,
        "iterations": coarse.iterations,
        "evaluations": coarse.evaluations,
        "reached": [target.reached for target in coarse.targets],
        "reached_in_3d": [target.started for target in outcome.result.targets],
    }


def tell(outcome: Outcome, summary: dict) -> None:
    """Prints the frames, the targets, the size of the problem, and where the time went."""
    demo, sim, result = outcome.demo, outcome.sim, outcome.result
    keys = ("configuration", "force", "displacement", "displacement_error", "stable", "iterations", "seconds")
    rows = [tuple(frame[key] for key in keys) for frame in summary["frames"]]
    headers = ("configuration", "force [N]", "displacement [mm]", "finer elements add [mm]", "stable", "iterations")
    demo.say(format_table((*headers, "seconds"), rows))
    if result is not None:
        _tell_design(outcome, summary)
    dofs = summary["dofs"]
    for remark in summary["remarks"]:
        demo.say(remark)
    demo.say(f"DOFs: {dofs['rigid']} rigid + {dofs['flexible']} flexible, {sim.comm.size} process(es)")
    phases = ", ".join(f"{name} {value:.2f}" for name, value in sim.clock.seconds.items())
    demo.say(f"seconds: {phases}; in all {perf_counter() - demo.started:.1f}")
    seconds, peak = summary["seconds"]["frame_median"], summary["peak_memory_mb"]
    demo.say(f"frame_median: {seconds:.3f} s, peak memory {peak:.0f} MB")
    demo.say(f"files in {demo.folder}")


def _tell_design(outcome: Outcome, summary: dict) -> None:
    result, coarse, say = outcome.result, outcome.coarse, outcome.demo.say
    headers = ("configuration", "force [N]", "wanted [mm]", "reached [mm]", "finer elements add [mm]", "error [%]")
    columns = [
        (t.configuration, t.force, t.wanted, t.reached, t.finer_elements_add, 100.0 * t.error) for t in result.targets
    ]
    if coarse is not None:
        headers += ("plane-stress optimum [mm]", "simulated in 3D [mm]")
        columns = [
            (*row, flat.reached, t.started)
            for row, flat, t in zip(columns, coarse.targets, result.targets, strict=True)
        ]
    say(format_table(headers, columns))
    least, most = result.thickness
    finer = "" if result.objective_error is None else f", to which finer elements add {result.objective_error:.2g}"
    say(
        f"{result.parameters} parameters, {result.iterations} iterations, {result.evaluations} evaluations: "
        f"objective {result.objective[0]:.3g} -> {result.objective[1]:.3g}{finer} ({result.reason})"
    )
    say(
        f"thickness {least:.2f} to {most:.2f} mm, curvature ratio up to {summary['curvature_ratio_max']:.3f}, "
        f"aspect ratio of cells up to {result.mesh_ratio_max:.1f}; "
        f"held back by: {', '.join(result.active) or 'no bound'}"
    )
    phases, shares = result.phases, ("weights", "handles", "equilibria", "gradients", "verification")
    say("of the time: " + ", ".join(f"{name} {phases[name] / result.seconds:.0%}" for name in shares))
    if coarse is not None:
        say(f"optimize: {coarse.seconds:.1f} s in plane stress + {result.seconds:.1f} s in 3D")
    else:
        say(f"optimize: {result.seconds:.1f} s")


def _plot(outcome: Outcome) -> None:
    """The curves, with those of the drawn design and the targets if there was an optimisation."""
    curves = outcome.curves
    colours = dict(zip([curve.configuration for curve in curves], PALETTE, strict=False))
    several, optimised = len(curves) > 1, outcome.result is not None
    series = [
        curve.series("initial design", colour=colours[curve.configuration], faint=True) for curve in outcome.before
    ] + [
        curve.series(
            curve.configuration.name if several or not optimised else "optimised", colour=colours[curve.configuration]
        )
        for curve in curves
    ]
    targets = [CurveTarget(t.displacement, t.force, colours[t.configuration]) for t in outcome.targets]
    name = outcome.sim.scene.mechanism.name
    plot_curve(
        outcome.demo.folder / "curve.png",
        series,
        targets=targets if optimised else (),
        title=name if optimised else f"{name}: initial design",
    )


def _frames(curves: Sequence[fm.Curve]) -> list[dict]:
    return [
        {
            "configuration": curve.configuration.name,
            "force": frame.force,
            "displacement": frame.displacement,
            "seconds": frame.seconds,
            "iterations": frame.iterations,
            "stable": frame.stable,
            "jumped": frame.jumped,
            "mobility": curve.freedom.mobility,
            "redundancy": curve.freedom.redundancy,
            "strain_energy": frame.strain_energy,
            "max_von_mises": frame.max_stress,
        }
        for curve in curves
        for frame in curve.frames
    ]


def _loaded(curves: Sequence[fm.Curve]) -> list[fm.Frame]:
    """Frames under load: those without cost less than a frame does."""
    return [frame for curve in curves for frame in curve.frames if frame.force != 0.0]


def _suffix(curve: fm.Curve, curves: Sequence[fm.Curve]) -> str:
    return f"-{curve.configuration.name.replace(' ', '-')}" if len(curves) > 1 else ""
