"""The report on a simulation or a design: a folder with pictures, curves, fields, designs and a summary.

=====================  ===========================================================================================
``mechanism.png``      the mechanism in its first and last equilibrium, one panel per configuration
``curve.png``          the curves; those of the drawn design and the targets beside them after an optimisation
``curve.csv``          displacement, force, stability, energy, stress and estimated error of every equilibrium
``deformed.xdmf``      displacements and stresses of every equilibrium, for ParaView
``links.png``          the links before and after an optimisation
``links/``             STEP and STL of every link that has changed
``design.json``        the design, for ``DesignResult.load``
``summary.json``       all figures
=====================  ===========================================================================================

With several configurations there is one CSV and one XDMF file for each.
"""

from __future__ import annotations

import resource
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from pathlib import Path
from statistics import median

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import on_one
from fenicsmech.design import DesignProblem, DesignResult
from fenicsmech.errors import DescriptionError
from fenicsmech.files import write_json
from fenicsmech.log import print_once
from fenicsmech.plot import PALETTE, CurveTarget, draw_configurations, draw_curve
from fenicsmech.simulation import Curve, Frame, Simulation


@dataclass(frozen=True)
class Report:
    """The contents of a report.

    Attributes:
        folder: of its files.
        summary: all figures, as in ``summary.json``.
    """

    folder: Path
    summary: dict

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
        start: the optimum of a cheaper simulation that the optimisation started from.
        pin_diameter: of the holes for pins in the exported links.
    """

    problem: DesignProblem
    result: DesignResult
    before: Sequence[Curve] = ()
    start: DesignResult | None = None
    pin_diameter: float | None = None


def write_report(
    folder: str | Path, simulation: Simulation, curves: Sequence[Curve], *, optimisation: Optimisation | None = None
) -> Report:
    """Writes the files listed above.

    Args:
        folder: created if it does not exist.
        simulation: of the curves, with the optimised shapes after an optimisation.
        curves: one per configuration, at least one of them with a loaded equilibrium.
        optimisation: the one that the simulation's shapes are of, if there was one.

    Returns:
        the figures.

    Raises:
        DescriptionError: there are no curves.
        OSError: the folder or a file cannot be written.
    """
    folder, name, comm = Path(folder), simulation.scene.mechanism.name, simulation.comm
    if not curves:
        raise DescriptionError(f"report on {name!r}", "there are no curves", "Give at least one")
    units = simulation.scene.units
    panels = [panel for curve in curves if (panel := curve.panel()) is not None]  # on rank 0
    paths = [_suffixed(curve, curves) for curve in curves]
    for curve, path in zip(curves, paths, strict=True):
        curve.write(folder / f"deformed{path}.xdmf")
        curve.write_csv(folder / f"curve{path}.csv", errors=True)
    if optimisation is not None:
        optimisation.problem.picture(folder / "links.png", optimisation.result)
        optimisation.problem.export(folder / "links", optimisation.result, pin_diameter=optimisation.pin_diameter)
        optimisation.result.save(folder / "design.json", comm=comm)
    summary = _summarise(simulation, curves, optimisation)

    def write() -> None:
        label = f"von Mises stress [{units.stress}]"
        draw_configurations(folder / "mechanism.png", panels, title=name, colour_label=label, unit=units.length)
        _plot(folder / "curve.png", name, curves, optimisation)
        write_json(folder / "summary.json", summary)

    on_one(comm, write)
    return Report(folder, summary)


def _suffixed(curve: Curve, curves: Sequence[Curve]) -> str:
    return f"-{curve.configuration.name.replace(' ', '-')}" if len(curves) > 1 else ""


def _plot(path: Path, name: str, curves: Sequence[Curve], optimisation: Optimisation | None) -> None:
    """The curves, with those of the drawn design and the targets if there was an optimisation."""
    colours = dict(zip([curve.configuration for curve in curves], PALETTE * len(curves), strict=False))
    before, targets = (optimisation.before, optimisation.problem.targets) if optimisation else ((), ())
    series = [curve.series("initial design", colour=colours[curve.configuration], faint=True) for curve in before]
    for curve in curves:
        label = "optimised" if optimisation is not None and len(curves) == 1 else curve.configuration.name
        series.append(curve.series(label, colour=colours[curve.configuration]))
    wanted = [CurveTarget(t.displacement, t.force, colours.get(t.configuration)) for t in targets]
    across, up = curves[0].axes
    title = name if optimisation else f"{name}: initial design"
    draw_curve(path, series, targets=wanted, xlabel=across.label, ylabel=up.label, title=title)


# -- figures ---------------------------------------------------------------------------------------------------------


def _summarise(sim: Simulation, curves: Sequence[Curve], optimisation: Optimisation | None) -> dict:
    result = None if optimisation is None else optimisation.result
    errors = np.concatenate([curve.error_estimates() for curve in curves])
    summary = {
        "mechanism": sim.scene.mechanism.name,
        "space": sim.fidelity.model.name,
        "order": sim.fidelity.order,
        "ranks": sim.comm.size,
        "units": {"length": sim.scene.units.length, "force": sim.scene.units.force, "stress": sim.scene.units.stress},
        "dofs": {"rigid": sim.model.rigid_dofs, "flexible": sim.model.flexible_dofs},
        "parameters": result and result.parameters,
        "targets": [],
        "frames": [
            frame | {"displacement_error": float(error)}  # the forces are prescribed
            for frame, error in zip(_frames(curves), errors, strict=True)
        ],
        "seconds": {
            "setup": sim.setup_seconds,
            "frame_median": median(frame.seconds for frame in _loaded(curves)),
            "optimise": None if optimisation is None else _seconds(optimisation),
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


def _seconds(optimisation: Optimisation) -> float:
    """The time of an optimisation, with that of the cheaper one before."""
    return optimisation.result.seconds + (optimisation.start.seconds if optimisation.start else 0.0)


def _summarise_design(optimisation: Optimisation) -> dict[str, object]:
    """The figures of an optimisation."""
    result = optimisation.result
    figures = {
        "targets": [
            {
                "configuration": target.configuration,
                "force": target.force,
                "wanted": target.wanted,
                "reached": target.reached,
                "reached_error": target.finer_elements_add,
                "relative_error": target.error,
            }
            for target in result.targets
        ],
        "worst_error": result.worst_error,
        "verified": result.verified,
        "curvature_ratio_max": max(link.bend for link in result.links),
        "active_bounds": result.active,
        "ended": result.reason,
        "optimise_phases": result.phases,
        "initial_frames": _frames(optimisation.before),
    }
    if optimisation.start is not None:
        start = optimisation.start
        figures["start"] = {
            "seconds": start.seconds,
            "iterations": start.iterations,
            "evaluations": start.evaluations,
            "reached": [target.reached for target in start.targets],
            "reached_here": [target.started for target in result.targets],
        }
    return figures


def _frames(curves: Sequence[Curve]) -> list[dict]:
    return [
        {
            "configuration": curve.configuration.name,
            "force": frame.force,
            "displacement": frame.displacement,
            "seconds": frame.seconds,
            "iterations": frame.iterations,
            "stable": frame.stable,
            "snapped_through": frame.snapped_through,
            "mobility": curve.freedom.mobility,
            "redundancy": curve.freedom.redundancy,
            "strain_energy": frame.strain_energy,
            "max_von_mises": frame.max_stress,
        }
        for curve in curves
        for frame in curve.frames
    ]


def _loaded(curves: Sequence[Curve]) -> list[Frame]:
    """Equilibria under load; those without take less time."""
    frames = [frame for curve in curves for frame in curve.frames]
    return [frame for frame in frames if frame.force != 0.0] or frames


# -- text ------------------------------------------------------------------------------------------------------------


def _text(summary: dict, folder: Path) -> str:
    """Equilibria, targets, size of the problem and times, for the console."""
    keys = ("configuration", "force", "displacement", "displacement_error", "stable", "iterations", "seconds")
    length, force = summary["units"]["length"], summary["units"]["force"]
    headers = ["configuration", f"force [{force}]", f"displacement [{length}]", f"finer elements add [{length}]"]
    headers += ["stable", "iterations", "seconds"]
    lines = [format_table(headers, [[frame[key] for key in keys] for frame in summary["frames"]])]
    if summary["parameters"] is not None:
        lines += _design_text(summary)
    lines += summary["remarks"]
    dofs, seconds = summary["dofs"], summary["seconds"]
    phases = ", ".join(f"{name} {value:.2f}" for name, value in seconds["phases"].items())
    lines += [
        f"{dofs['rigid']} rigid + {dofs['flexible']} flexible unknowns, {summary['ranks']} process(es)",
        f"seconds: {phases}",
        f"seconds per loaded equilibrium (median): {seconds['frame_median']:.3f}; "
        f"peak memory {summary['peak_memory_mb']:.0f} MB",
        f"files in {folder}",
    ]
    return "\n".join(lines)


def _design_text(summary: dict) -> list[str]:
    length, force = summary["units"]["length"], summary["units"]["force"]
    headers = ["configuration", f"force [{force}]", *(f"{name} [{length}]" for name in ("wanted", "reached"))]
    headers += [f"finer elements add [{length}]", "error [%]"]
    rows = [
        [t["configuration"], t["force"], t["wanted"], t["reached"], t["reached_error"], 100.0 * t["relative_error"]]
        for t in summary["targets"]
    ]
    start = summary.get("start")
    if start is not None:
        headers += [f"optimum of the start [{length}]", f"the same here [{length}]"]
        rows = [[*row, *pair] for row, *pair in zip(rows, start["reached"], start["reached_here"], strict=True)]
    (least, most), objective, error = summary["thickness"], summary["objective"], summary["objective_error"]
    finer = "" if error is None else f", to which finer elements add {error:.2g}"
    phases, seconds = summary["optimise_phases"], summary["seconds"]["optimise"]
    parts = ("weights", "handles", "equilibria", "gradients", "verification")
    return [
        format_table(headers, rows),
        f"{summary['parameters']} parameters, {summary['iterations']} iterations, {summary['evaluations']} "
        f"evaluations: objective {objective['initial']:.3g} -> {objective['final']:.3g}{finer} ({summary['ended']})",
        f"thickness {least:.2f} to {most:.2f} {length}, curvature ratio up to {summary['curvature_ratio_max']:.3f}, "
        f"aspect ratio of cells up to {summary['mesh_ratio_max']:.1f}; "
        f"active: {', '.join(summary['active_bounds']) or 'no bound'}",
        f"optimisation: {seconds:.1f} s" + (f", {start['seconds']:.1f} s of it for the start" if start else ""),
        "of the time: " + ", ".join(f"{name} {phases[name] / seconds:.0%}" for name in parts if name in phases),
    ]


def format_table(headers: Sequence[str], rows: Sequence[Sequence[object]], *, digits: int = 4) -> str:
    """``rows`` laid out under ``headers``; numbers are right-aligned, text left.

    Args:
        headers: (k,) column names.
        rows: each of k cells: numbers, text, flags, or None for unknown values.
        digits: significant digits of floats.

    Returns:
        the lines, joined, without a newline at the end.

    Raises:
        DescriptionError: a row has another number of cells.
    """
    for index, row in enumerate(rows):
        if len(row) != len(headers):
            raise DescriptionError(
                f"row {index} of the table", f"{len(row)} cells for {len(headers)} columns", "Give one cell per column"
            )
    cells = [[_cell(cell, digits) for cell in line] for line in (headers, *rows)]
    widths = [max(3, *(len(line[k]) for line in cells)) for k in range(len(headers))]
    right = [bool(rows) and all(_stands_right(row[k]) for row in rows) for k in range(len(headers))]
    rule = ["-" * (w - 1) + ":" if r else "-" * w for w, r in zip(widths, right, strict=True)]
    return "\n".join(_line(line, widths, right) for line in (cells[0], rule, *cells[1:]))


def _line(cells: Sequence[str], widths: Sequence[int], right: Sequence[bool]) -> str:
    padded = [c.rjust(w) if r else c.ljust(w) for c, w, r in zip(cells, widths, right, strict=True)]
    return "| " + " | ".join(padded) + " |"


def _stands_right(cell: object) -> bool:
    return cell is None or (isinstance(cell, Real) and not isinstance(cell, bool))


def _cell(cell: object, digits: int) -> str:
    if cell is None:
        return "–"
    if isinstance(cell, bool | np.bool_):
        return "yes" if cell else "no"
    if isinstance(cell, Integral):
        return str(int(cell))
    if isinstance(cell, Real):
        return f"{float(cell):.{digits}g}"
    return str(cell).replace("|", "\\|").replace("\n", " ")
