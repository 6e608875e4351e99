"""A study as files: table.csv with every digit, table.md to read, work-precision.png to see."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from fenicsmech.accuracy.measurement import Measurement
from fenicsmech.accuracy.study import Study
from fenicsmech.report import (
    ErrorLevel,
    WorkSeries,
    atomic_write,
    format_table,
    pareto_front,
    plot_work_precision,
)

_DIGITS = 5  # of values
_LONGEST_NOTE = 60  # characters, in the table to read


def save_study(study: Study, folder: str | Path) -> None:
    """Writes table.csv, table.md and, if there is a reference, work-precision.png (call on one rank).

    Args:
        study: what was measured.
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
    """Headers and rows of the full table: one row per rung, None for what is not known."""
    unit = study.quantity.unit(study.scene.units)
    headers = (
        "rung",
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
        rung, elastic = m.rung, m.rung.model is not None
        rows.append(
            (
                rung.name,
                rung.model_name,
                rung.order if elastic else None,
                rung.factor if elastic else None,
                rung.quadrature,
                rung.tolerance if elastic else None,
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
    unit = study.quantity.unit(study.scene.units)
    headers = (
        "rung",
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
            m.rung.name,
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
            f"{what}, {study.quantity.configuration.name}; {study.ranks} process(es)",
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
    families: dict[tuple[str, str, bool], list[Measurement]] = {}
    for m in _judged(study):
        order = "" if m.rung.model is None else f"P{m.rung.order}"
        families.setdefault((m.rung.model_name, order, not m.rung.is_variant), []).append(m)
    series = [
        WorkSeries(
            model,
            order,
            [m.frame_seconds for m in family],
            [_magnitude(study, m) for m in family],
            [m.rung.name for m in family],
            joined=joined,
        )
        for (model, order, joined), family in families.items()
    ]
    names = {m.rung.model: m.rung.model_name for m in study.measurements}
    levels = [
        ErrorLevel(names[model], abs(study.relative(limit.value - study.reference.value)))
        for model, limit in study.limits.items()
        if model.dim == 2
    ]
    plot_work_precision(
        path,
        series,
        floor=study.uncertainty,
        levels=levels,
        ylabel="error: |modelling| + |discretisation| + |algebraic|",
        title=f"{study.scene.mechanism.name}: {study.quantity.name}",
    )


def front_of(study: Study) -> list[Measurement]:
    """The rungs that no other beats in time without being less accurate; errors the reference cannot tell are equal."""
    judged = _judged(study)
    floor = study.uncertainty or 0.0
    errors = [max(_magnitude(study, m), floor) for m in judged]
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
    names = {m.rung.model: m.rung.model_name for m in study.measurements}
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
