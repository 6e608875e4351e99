"""The report on a simulation or a design: a folder with pictures, curves, fields, designs and a summary.

=====================  ===========================================================================================
``mechanism.png``      the mechanism in its first and last equilibrium, one panel per configuration
``curve.png``          the curves; after an optimisation also those of the drawn design, and the targets
``curve.csv``          displacement, force, stability, energy, stress and estimated error of every equilibrium
``deformed.xdmf``      displacements and stresses of every equilibrium, for ParaView
``links.png``          the links before and after an optimisation
``links/``             STEP and STL of every link that has changed; ``parts.json`` counts the equal ones
``design.json``        the design, for ``DesignResult.load``
``checkpoint.json``    the last iterate of an optimisation by ``design_study``
``summary.json``       all figures
=====================  ===========================================================================================

With several configurations there is one CSV and one XDMF file for each.
"""

from __future__ import annotations

import math
import resource
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from numbers import Integral, Real
from pathlib import Path
from statistics import median

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import on_one
from fenicsmech.design import DesignProblem, DesignResult
from fenicsmech.equilibrium import Unknown
from fenicsmech.errors import DescriptionError, EquilibriumError, counted, point_text, with_error
from fenicsmech.estimates import AccuracyOptions
from fenicsmech.files import file_names, write_json
from fenicsmech.log import logger, print_once
from fenicsmech.mechanism import Force, ForceGroup, Mechanism
from fenicsmech.plot import PALETTE, CurveTarget, draw_configurations, plot_curve
from fenicsmech.simulation import Axis, Curve, Frame, Simulation, read_request
from fenicsmech.stress import allowables

_log = logger(__name__)


@dataclass(frozen=True)
class Report:
    """The contents of a report.

    Attributes:
        folder: of its files.
        summary: all figures, as in ``summary.json``.
        curves: those reported on, of the optimum after an optimisation.
    """

    folder: Path
    summary: dict
    curves: Sequence[Curve]

    def __str__(self) -> str:
        return _text(self.summary, self.folder)

    def show(self) -> None:
        """Prints the figures, on one process."""
        print_once(self)


@dataclass(frozen=True)
class Optimisation:
    """The optimisation that a report is about.

    Attributes:
        problem: the design problem.
        result: its optimum.
        before: curves of the drawn design.
        pin_diameter: of the holes for pins in the exported links.
    """

    problem: DesignProblem
    result: DesignResult
    before: Sequence[Curve] = ()
    pin_diameter: float | None = None


def write_report(
    folder: str | Path, simulation: Simulation, curves: Sequence[Curve], *, optimisation: Optimisation | None = None
) -> Report:
    """Writes the files listed above, the design first.

    Estimated errors are left out along curves of motors and, with a warning, where the KKT matrix of a frame is
    singular.

    Args:
        folder: created if it does not exist.
        simulation: of the curves, with the optimised shapes after an optimisation.
        curves: one per configuration, all of forces or all of motors of one kind.
        optimisation: the one that the simulation's shapes are of, if there was one.

    Returns:
        the figures.

    Raises:
        DescriptionError: there are no curves, or two of one configuration or of other axes.
        MeshingError: no solid can be made of a link, as where the holes for pins are too large; all else is written.
        OSError: the folder or a file cannot be written.
    """
    folder, name, comm = Path(folder), simulation.scene.mechanism.name, simulation.comm
    _check_curves(f"report on {name!r}", curves)
    if optimisation is not None:
        optimisation.result.save(folder / "design.json", comm=comm)
    units, errors = simulation.scene.units, [_errors(curve) for curve in curves]
    panels = [panel for curve in curves if (panel := curve.panel()) is not None]  # on rank 0
    names = file_names(curve.configuration.name for curve in curves)
    for curve, known, own in zip(curves, errors, names, strict=True):
        suffix = f"-{own}" if len(curves) > 1 else ""
        curve.write(folder / f"deformed{suffix}.xdmf")
        curve.write_csv(folder / f"curve{suffix}.csv", errors=known is not None)
    summary = _summarise(simulation, curves, errors, optimisation)

    def write() -> None:
        label = f"von Mises stress [{units.stress}]"
        draw_configurations(folder / "mechanism.png", panels, title=name, colour_label=label, unit=units.length)
        _plot(folder / "curve.png", name, curves, errors, optimisation)
        write_json(folder / "summary.json", summary)

    on_one(comm, write)
    if optimisation is not None:
        if optimisation.result.links:
            optimisation.problem.picture(folder / "links.png", optimisation.result)
        optimisation.problem.export(folder / "links", optimisation.result, pin_diameter=optimisation.pin_diameter)
    return Report(folder, summary, tuple(curves))


def design_study(
    folder: str | Path,
    problem: DesignProblem,
    curves: Sequence[Curve],
    *,
    resume: bool = False,
    pin_diameter: float | None = None,
) -> Report:
    """Optimises the links, verifies them in the exported parts, computes the curves of the optimum, and reports.

    Once it is found, ``design.json`` holds the design, whatever fails afterwards.

    Args:
        folder: of the files; created if it does not exist.
        problem: the design problem.
        curves: of the drawn design, by ``load_displacement``, one per configuration.
        resume: whether to continue an optimisation that was interrupted.
        pin_diameter: of the holes for pins in the exported links; there are none by default.

    Returns:
        the figures and the curves of the optimum.

    Raises:
        DescriptionError: there are no curves, two of one configuration or one of motors, a checkpoint in the folder
            belongs to another problem.
        EquilibriumError: the drawn design does not carry its loads, or the optimum not those of a curve.
        MeshingError: a part cannot be written or meshed.
        OSError: the folder or a file cannot be written.
    """
    folder, simulation = Path(folder), problem.simulation
    mechanism, comm = simulation.scene.mechanism, simulation.comm
    _check_curves(f"design study of {mechanism.name!r}", curves)
    again = [_again(mechanism, curve) for curve in curves]
    optimum = problem.optimise(checkpoint=folder / "checkpoint.json", resume=resume)
    optimum.save(folder / "design.json", comm=comm)
    result = problem.verify(optimum)
    result.save(folder / "design.json", comm=comm)
    designed = simulation.with_design(result)
    after = [compute(designed) for compute in again]
    found = Optimisation(problem, result, before=curves, pin_diameter=pin_diameter)
    return write_report(folder, designed, after, optimisation=found)


def _check_curves(where: str, curves: Sequence[Curve]) -> None:
    """Refuses curves that do not make one report."""
    if not curves:
        raise DescriptionError(where, "there are no curves", "Give at least one")
    names = [curve.configuration.name for curve in curves]
    for curve, name in zip(curves, names, strict=True):
        if names.count(name) > 1:
            raise DescriptionError(
                where,
                f"two curves are of configuration {curve.configuration.name!r}, by which their files are named",
                "Give one curve per configuration, or write a report on each",
            )
        if curve.axes != curves[0].axes:
            first, other = (f"{own.part.name!r} ({own.axes[0].label})" for own in (curves[0], curve))
            raise DescriptionError(
                where, f"the curves of {first} and {other} have no axes in common", "Write a report on each"
            )


def _again(mechanism: Mechanism, curve: Curve) -> Callable[[Simulation], Curve]:
    """Computes the curve with the same prescribed values in another simulation of the mechanism."""
    if not isinstance(part := curve.part, Force | ForceGroup):
        raise DescriptionError(
            f"design study of {mechanism.name!r}",
            f"the curve of {part.name!r} has no prescribed forces or displacements",
            "Give curves of load_displacement",
        )
    held, configuration, others = curve.unknown is Unknown.FORCE, curve.configuration, dict(curve.others)
    forces, displacements = (None, curve.displacements.tolist()) if held else (curve.forces.tolist(), None)
    given = {"forces": forces, "displacements": displacements}
    read_request(mechanism, part, **given, configuration=configuration, others=others)
    return lambda sim: sim.load_displacement(part, **given, configuration=configuration, others=others)


def _errors(curve: Curve) -> np.ndarray | None:
    """Estimated errors of the curve's values, (frames,); None where there are none."""
    if not isinstance(curve.part, Force | ForceGroup):
        return None
    try:
        return curve.errors_by_kind()[0]
    except EquilibriumError as failure:
        _log.warning("no errors are estimated of the curve of %r: %s", curve.part.name, failure)
        return None


def _plot(
    path: Path,
    name: str,
    curves: Sequence[Curve],
    errors: Sequence[np.ndarray | None],
    optimisation: Optimisation | None,
) -> None:
    """The curves, with those of the drawn design and the targets if there was an optimisation."""
    before, targets = (optimisation.before, optimisation.problem.targets) if optimisation else ((), ())
    configurations = dict.fromkeys(curve.configuration for curve in (*curves, *before))
    colours = dict(zip(configurations, PALETTE * len(configurations), strict=False))
    series = [curve.series("initial design", colour=colours[curve.configuration], faint=True) for curve in before]
    for curve, known in zip(curves, errors, strict=True):
        label = "optimised" if optimisation is not None and len(curves) == 1 else curve.configuration.name
        own = curve.series(label, colour=colours[curve.configuration])
        if known is not None:
            own = replace(own, corrected=_in_finer_elements(curve, known))
        series.append(own)
    points, parts = [point for target in targets if (point := target.on_curve)], [curve.part for curve in curves]
    wanted = [CurveTarget(u, magnitude, colours.get(place)) for force, magnitude, u, place in points if force in parts]
    across, up = curves[0].axes
    title = name if optimisation else f"{name}: initial design"
    labels = {"xlabel": across.label, "ylabel": up.label, "title": title}
    plot_curve(path, series, targets=wanted, comm=MPI.COMM_SELF, **labels)


def _in_finer_elements(curve: Curve, errors: np.ndarray) -> np.ndarray:
    """Displacements and forces with those of their estimated ``errors`` added that are small enough, (frames, 2)."""
    added, points = AccuracyOptions().corrections(errors, curve.values), [curve.displacements, curve.forces]
    points[curve.unknown is Unknown.FORCE] = curve.values + added
    return np.column_stack(points)


# -- figures ---------------------------------------------------------------------------------------------------------


def _summarise(
    sim: Simulation, curves: Sequence[Curve], errors: Sequence[np.ndarray | None], optimisation: Optimisation | None
) -> dict:
    result = None if optimisation is None else optimisation.result
    estimated = [
        error
        for curve, known in zip(curves, errors, strict=True)
        for error in ([None] * len(curve.frames) if known is None else known.tolist())
    ]
    summary = {
        "mechanism": sim.scene.mechanism.name,
        "space": sim.fidelity.model.name,
        "order": sim.fidelity.order,
        "ranks": sim.comm.size,
        "units": {"length": sim.scene.units.length, "force": sim.scene.units.force, "stress": sim.scene.units.stress},
        "dofs": {"rigid": sim.model.rigid_dofs, "flexible": sim.model.flexible_dofs},
        "parameters": result and result.parameters,
        "targets": [],
        "axes": {name: asdict(axis) for name, axis in zip(("displacement", "force"), curves[0].axes, strict=True)},
        "frames": [f | {f"{f['unknown']}_error": e} for f, e in zip(_frames(curves), estimated, strict=True)],
        "seconds": {
            "setup": sim.setup_seconds,
            "frame_median": median(frame.seconds for frame in _loaded(curves)),
            "optimise": None if optimisation is None else optimisation.result.seconds,
            "phases": sim.clock.seconds,
        },
        "iterations": sum(frame.iterations for frame in _loaded(curves)) if result is None else result.iterations,
        "evaluations": result and result.evaluations,
        "objective": dict(zip(("initial", "final"), result.objective if result else (None, None), strict=True)),
        "objective_error": result and result.objective_error,
        "thickness": result and result.thickness,
        "mesh_ratio_max": sim.mesh_ratio_max,
        "remarks": [remark for curve in curves for remark in curve.remarks],
        "peak_memory_mb": sim.comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, op=MPI.MAX) / 1024.0,
    }
    return summary if optimisation is None else summary | _summarise_design(optimisation)


def _summarise_design(optimisation: Optimisation) -> dict[str, object]:
    """The figures of an optimisation."""
    result = optimisation.result
    return {
        "targets": [
            {
                "target": target.name,
                "configuration": target.configuration or None,  # links at rest have none
                "force": target.force,
                "unit": target.unit,
                "relation": target.relation,
                "wanted": target.wanted,
                "reached": target.reached,
                "reached_error": target.finer_elements_add,
                "corrected": target.corrected,
                "relative_error": target.error,
                "met": target.met,
                "part": target.part and asdict(target.part) | {"met": target.part.met},
            }
            for target in result.targets
        ],
        "worst_error": result.worst_error,
        "part_fidelity": result.part_fidelity,
        "worst_part_error": result.worst_part_error,
        "verified": result.verified,
        "numbers": [asdict(number) for number in result.numbers],
        "curvature_ratio_max": max((link.bend for link in result.links), default=0.0),
        "active_bounds": result.active,
        "ended": result.reason,
        "optimise_phases": result.phases,
        "surrogate": result.surrogate,
        "corrections": result.corrections,
        "initial_frames": _frames(optimisation.before),
    }


def _frames(curves: Sequence[Curve]) -> list[dict]:
    return [
        {
            "configuration": curve.configuration.name,
            "force": frame.force,
            "displacement": frame.displacement,
            "unknown": "force" if curve.unknown is Unknown.FORCE else "displacement",
            "seconds": frame.seconds,
            "iterations": frame.iterations,
            "stable": frame.stable,
            "snapped_through": frame.snapped_through,
            "mobility": curve.freedom.mobility,
            "redundancy": curve.freedom.redundancy,
            "strain_energy": frame.strain_energy,
            "max_von_mises": frame.max_stress,
            "peak": asdict(frame.peak),
            "safety": _safety(frame),
        }
        for curve in curves
        for frame in curve.frames
    ]


def _safety(frame: Frame) -> dict[str, object] | None:
    """The factor of safety; None where no material has an allowable."""
    if not allowables(frame.stresses.materials):
        return None
    safety = frame.safety
    return {
        "factor": safety.factor if math.isfinite(safety.factor) else None,  # unloaded
        "error": safety.error,
        "link": safety.link,
        "place": safety.place,
        "allowable": asdict(safety.least.allowable),
        "unknown": safety.unknown,
        "text": str(safety),
    }


def _loaded(curves: Sequence[Curve]) -> list[Frame]:
    """Equilibria under load; those without take less time."""
    frames = [frame for curve in curves for frame in curve.frames]
    return [frame for frame in frames if frame.force != 0.0] or frames


# -- text ------------------------------------------------------------------------------------------------------------


def _text(summary: dict, folder: Path) -> str:
    """Equilibria, targets, size of the problem and times, for the console."""
    axes = {name: Axis(**own) for name, own in summary["axes"].items()}
    added = ", ".join(axes[unknown].unit for unknown in dict.fromkeys(frame["unknown"] for frame in summary["frames"]))
    headers = ["configuration", axes["force"].label, axes["displacement"].label, f"finer elements add [{added}]"]
    headers += ["stable", "iterations", "seconds"]
    rows = [
        [
            *(frame["configuration"], frame["force"], frame["displacement"], frame[f"{frame['unknown']}_error"]),
            *(frame["stable"], frame["iterations"], frame["seconds"]),
        ]
        for frame in summary["frames"]
    ]
    lines = [format_table(headers, rows)]
    if summary["parameters"] is not None:
        lines += _design_text(summary)
    lines += summary["remarks"] + _stress_text(summary) + _safety_text(summary)
    dofs, seconds = summary["dofs"], summary["seconds"]
    phases = ", ".join(f"{name} {value:.2f}" for name, value in seconds["phases"].items())
    lines += [
        f"{dofs['rigid']} rigid + {dofs['flexible']} flexible unknowns, "
        f"{counted(summary['ranks'], 'process', 'processes')}",
        f"seconds: {phases}",
        f"seconds per loaded equilibrium (median): {seconds['frame_median']:.3f}; "
        f"peak memory {summary['peak_memory_mb']:.0f} MB",
        f"files in {folder}",
    ]
    return "\n".join(lines)


def _stress_text(summary: dict) -> list[str]:
    """The largest stress of all equilibria, a line; none where nothing is loaded."""
    frame = max(summary["frames"], key=lambda frame: frame["max_von_mises"])
    peak, unit = frame["peak"], summary["units"]["stress"]
    if not peak["value"]:
        return []
    value = with_error(peak["value"], peak["error"])
    above = f"; near {', '.join(peak['left_out'])} elements show more" if peak["left_out"] else ""
    where = f"{frame['configuration']} at {frame['force']:.4g}"
    return [f"{where}: largest stress {value} {unit} in {peak['link']!r} at {point_text(peak['place'])}{above}"]


def _safety_text(summary: dict) -> list[str]:
    """The least factor of safety of all equilibria, a line; none where it is not known or nothing is loaded."""
    known = [frame for frame in summary["frames"] if frame["safety"] and frame["safety"]["factor"] is not None]
    if not known:
        return []
    least = min(known, key=lambda frame: frame["safety"]["factor"])
    return [f"{least['configuration']} at {least['force']:.4g}: {least['safety']['text']}"]


def _design_text(summary: dict) -> list[str]:
    length = summary["units"]["length"]
    headers = ["target", "unit", "relation", "wanted", "reached", "finer elements add", "error [%]", "met"]
    rows = [
        [
            *(t["target"], t["unit"], t["relation"], t["wanted"], t["reached"], t["reached_error"]),
            *(100.0 * t["relative_error"], t["met"]),
        ]
        for t in summary["targets"]
    ]
    if summary["part_fidelity"]:
        headers += ["in the part", "finer elements add", "error there [%]"]
        parts = [t["part"] or dict.fromkeys(("value", "finer_elements_add", "error")) for t in summary["targets"]]
        rows = [
            [*row, own["value"], own["finer_elements_add"], own["error"] and 100.0 * own["error"]]
            for row, own in zip(rows, parts, strict=True)
        ]
    thickness, objective, error = summary["thickness"], summary["objective"], summary["objective_error"]
    numbers = [[own["name"], own["unit"], own["value"], own["drawn"], *own["bounds"]] for own in summary["numbers"]]
    phases, seconds = summary["optimise_phases"], summary["seconds"]["optimise"]
    phase_names = ("weights", "handles", "equilibria", "gradients", "verification")
    return [
        format_table(headers, rows),
        *([f"parts: {summary['part_fidelity']}"] if summary["part_fidelity"] else []),
        f"{counted(summary['parameters'], 'parameter')}, {counted(summary['iterations'], 'iteration')}, "
        f"{counted(summary['evaluations'], 'evaluation')}: "
        f"objective {objective['initial']:.3g} -> {objective['final']:.3g} "
        f"(corrections contribute {error:.2g}; {summary['ended']})",
        f"corrections changed by {', '.join(f'{change:.2%}' for change in summary['corrections'])} in as many rounds"
        + (f" of a surrogate in {summary['surrogate']}" if summary["surrogate"] else ""),
        *([format_table(["number", "unit", "value", "drawn", "least", "largest"], numbers)] if numbers else []),
        (f"thickness {thickness[0]:.2f} to {thickness[1]:.2f} {length}, " if thickness else "")
        + f"curvature ratio up to {summary['curvature_ratio_max']:.3f}, "
        f"aspect ratio of cells up to {summary['mesh_ratio_max']:.1f}; "
        f"active: {', '.join(summary['active_bounds']) or 'no bound'}",
        f"optimisation: {seconds:.1f} s",
        "of the time: " + ", ".join(f"{name} {phases[name] / seconds:.0%}" for name in phase_names if name in phases),
    ]


def format_table(headers: Sequence[str], rows: Sequence[Sequence[object]], *, digits: int = 4) -> str:
    """``rows`` of numbers, text, flags or None for unknown values, laid out in Markdown under ``headers``.

    Numbers are right-aligned, floats have ``digits`` significant digits. There is no newline at the end.
    """
    for index, row in enumerate(rows):
        if len(row) != len(headers):
            problem = f"{counted(len(row), 'cell')} for {counted(len(headers), 'column')}"
            raise DescriptionError(f"row {index} of the table", problem, "Give one cell per column")
    columns = []
    for k, header in enumerate(headers):
        column = [_cell(cell, digits) for cell in (header, *(row[k] for row in rows))]
        width = max(3, *map(len, column))
        if rows and all(row[k] is None or (isinstance(row[k], Real) and not isinstance(row[k], bool)) for row in rows):
            column = [cell.rjust(width) for cell in (column[0], "-" * (width - 1) + ":", *column[1:])]
        else:
            column = [cell.ljust(width) for cell in (column[0], "-" * width, *column[1:])]
        columns.append(column)
    return "\n".join(f"| {' | '.join(line)} |" for line in zip(*columns, strict=True))


def _cell(cell: object, digits: int) -> str:
    if cell is None:
        return "–"
    if isinstance(cell, bool | np.bool_):
        return "yes" if cell else "no"
    if isinstance(cell, Integral):
        return str(int(cell))
    if isinstance(cell, Real):
        return f"{float(cell):.{digits}g}"
    if isinstance(cell, tuple | list):
        return f"({', '.join(_cell(own, digits) for own in cell)})"
    return str(cell).replace("|", "\\|").replace("\n", " ")
