"""A study as files: table.csv with every digit, table.md to read, work-precision.png to see."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from fenicsmech.errors import counted
from fenicsmech.files import atomic_write
from fenicsmech.report import format_table

from .measurement import Measurement
from .plot import ModellingError, WorkSeries, pareto_front, plot_work_precision
from .study import Study

_DIGITS = 5  # of values
_LONGEST_NOTE = 60  # characters, in the table to read


def save_study(study: Study, folder: str | Path) -> None:
    """Writes table.csv, table.md and, if there is a reference, work-precision.png (call on one rank).

    Args:
        study: the measurements.
        folder: made if missing.

    Raises:
        OSError: the folder or a file cannot be written.
    """
    folder = Path(folder)
    headers, rows = study_rows(study)
    with atomic_write(folder / "table.csv") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(headers)
        writer.writerows(rows)
    with atomic_write(folder / "table.md") as file:
        file.write(study_text(study) + "\n")
    if study.reference is not None:
        plot_study(folder / "work-precision.png", study)


def study_rows(study: Study) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """Headers and rows of the full table: one row per level, None for unknown values."""
    unit = study.scene.units.length
    headers = (
        "level",
        "model",
        "order",
        "size factor",
        "quadrature",
        "tolerance",
        "cells^(-1/dim)",
        "unknowns",
        "iterations",
        "setup [s]",
        "frame [s]",
        "curve [s]",
        "repeats",
        f"value [{unit}]",
        "modelling error [%]",
        "discretisation error [%]",
        "algebraic error [%]",
        "error [%]",
        "error without cancellation [%]",
        "on the front",
        "failure",
    )
    front = front_of(study)
    rows = []
    for m in study.measurements:
        level, elastic = m.level, m.level.model is not None
        rows.append(
            (
                level.name,
                level.model_name,
                level.order if elastic else None,
                level.factor if elastic else None,
                level.quadrature,
                level.tolerance if elastic else None,
                m.spacing,
                m.unknowns,
                m.iterations,
                m.setup_seconds,
                m.frame_seconds,
                m.curve_seconds,
                m.repeats,
                m.value,
                *_percentages(study, m),
                "yes" if m in front else "no",
                m.failure,
            )
        )
    return headers, rows


def study_text(study: Study) -> str:
    """The table to read, in Markdown, with the limits under it."""
    unit = study.scene.units.length
    headers = (
        "level",
        "unknowns",
        "setup [s]",
        "frame [s]",
        "curve [s]",
        f"value [{unit}]",
        "modelling [%]",
        "discretisation [%]",
        "algebraic [%]",
        "error [%]",
        "Pareto front",
    )
    front = front_of(study)
    rows = [
        (
            m.level.name,
            m.unknowns,
            _brief(m.setup_seconds),
            _brief(m.frame_seconds),
            _brief(m.curve_seconds),
            _brief(m.value, _DIGITS),
            *map(_brief, _percentages(study, m)[:4]),
            "**yes**" if m in front else _shortened(m.failure),
        )
        for m in study.measurements
    ]
    what = f"{study.scene.mechanism.name}: {study.quantity.name}, {study.quantity.load:g} {study.scene.units.force}"
    return "\n".join(
        [
            f"{what}, {study.quantity.configuration.name}; {counted(study.ranks, 'process', 'processes')}",
            "",
            format_table(headers, rows, digits=_DIGITS),
            "",
            format_table(
                ("limit of the model", f"value [{unit}]", "± [%]", "observed order", "meshes"),
                _limits(study),
                digits=_DIGITS,
            ),
        ]
    )


def plot_study(path: str | Path, study: Study) -> None:
    """Draws error without cancellation against seconds per frame.

    Raises:
        DescriptionError: the name does not end in .png.
    """
    sequences: dict[tuple[str, str, bool], list[Measurement]] = {}
    for m in _judged(study):
        order = "" if m.level.model is None else f"P{m.level.order}"
        sequences.setdefault((m.level.model_name, order, not m.level.is_variant), []).append(m)
    series = [
        WorkSeries(
            model,
            order,
            [m.frame_seconds for m in sequence],
            [_magnitude(study, m) for m in sequence],
            [m.level.name for m in sequence],
            joined=joined,
        )
        for (model, order, joined), sequence in sequences.items()
    ]
    names = {m.level.model: m.level.model_name for m in study.measurements}
    modelling = [
        ModellingError(names[model], abs(study.relative(limit.value - study.reference.value)))
        for model, limit in study.limits.items()
        if model.dim == 2
    ]
    plot_work_precision(
        path,
        series,
        uncertainty=study.uncertainty,
        modelling=modelling,
        ylabel="error: |modelling| + |discretisation| + |algebraic|",
        title=f"{study.scene.mechanism.name}: {study.quantity.name}",
    )


def front_of(study: Study) -> list[Measurement]:
    """The levels that no other beats in time at equal accuracy; errors within the uncertainty count as equal."""
    judged = _judged(study)
    least = study.uncertainty or 0.0
    errors = [max(_magnitude(study, m), least) for m in judged]
    return [judged[k] for k in pareto_front([m.frame_seconds for m in judged], errors)]


def _judged(study: Study) -> list[Measurement]:
    return [m for m in study.measurements if study.split(m) is not None]


def _magnitude(study: Study, measurement: Measurement) -> float:
    return study.relative(study.split(measurement).magnitude)


def _percentages(study: Study, measurement: Measurement) -> tuple[float | None, ...]:
    """Modelling, discretisation, algebraic, their sum, the sum of their magnitudes; in % of the reference."""
    split = study.split(measurement)
    if split is None:
        return (None,) * 5
    parts = (split.modelling, split.discretisation, split.algebraic, split.total, split.magnitude)
    return tuple(100.0 * study.relative(part) for part in parts)


def _limits(study: Study) -> Sequence[tuple[object, ...]]:
    names = {m.level.model: m.level.model_name for m in study.measurements}
    return [
        (
            names[model],
            _brief(limit.value, _DIGITS),
            _brief(100.0 * limit.uncertainty / abs(limit.value)),
            _brief(limit.order),
            limit.levels,
        )
        for model, limit in study.limits.items()
    ]


def _brief(value: float | None, digits: int = 2) -> float | None:
    """``value`` with few significant digits."""
    return None if value is None else float(f"{value:.{digits}g}")


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_NOTE else text[: _LONGEST_NOTE - 1] + "…"
