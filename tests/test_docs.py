"""The code of README and of the guide runs as printed, and gives what mechanics expects."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
Names = dict[str, object]


def readme(names: Names, folder: Path) -> None:
    curve, result = names["curve"], names["result"]
    assert np.all(curve.stable)
    stiffness = np.diff(curve.forces) / np.diff(curve.displacements)
    assert np.all(np.diff(stiffness) > 0)
    assert result.worst_error < 0.01
    assert 1.5 <= result.thickness[0] <= result.thickness[1] <= 6.0
    files = {path.name for path in (*folder.iterdir(), *(folder / "links").iterdir())}
    assert {"curve.png", "optimised.png", "design.json", "diagonal.step", "diagonal.stl"} <= files


def getting_started(names: Names, folder: Path) -> None:
    curve = names["curve"]
    bending, L = 1770.0 * 10.0 * 3.0**3 / 12.0, 54.0  # EI; mm from the clamp to the pin
    assert curve.displacements[1] == pytest.approx(1.0 * L**3 / (3.0 * bending), rel=0.06)
    assert (folder / "cantilever.png").exists()


def describe(names: Names, folder: Path) -> None:
    assert {link.name for link in names["scene"].mechanism.links} == {"ground", "crank", "coupler", "follower"}
    assert names["in_metres"].law.E == pytest.approx(1e6 * names["pom"].law.E)
    assert names["fit"].relative_rms[0] < 0.05
    assert names["rubber"].law.E == pytest.approx(6.0 * names["fit"].values["C1"], rel=1e-3)
    assert (folder / "fit.png").exists()
    low, high = names["found"].intervals[names["guess"]]["E"]
    assert low < names["pla"].law.E < high < 1.1 * low


def simulate(names: Names, folder: Path) -> None:
    curve, held = names["curve"], names["held"]
    assert np.interp(2.0, curve.displacements, curve.forces) < held.forces[1]
    assert np.all(np.diff(held.forces) > 0)
    assert {"curve.png", "curve.csv", "finger.png", "finger.xdmf"} <= {path.name for path in folder.iterdir()}


def snap_through(names: Names, folder: Path) -> None:
    upper, lower = names["curve"].limit_points
    assert upper.frame.force > 0.0 > lower.frame.force
    assert (folder / "switch.png").exists()


def design(names: Names, folder: Path) -> None:
    assert names["result"].worst_error < 0.01
    reached = [target.reached for target in names["result"].targets]  # before what finer elements add
    assert names["after"].displacements == pytest.approx(reached, rel=1e-6)
    assert names["before"].displacements[0] < 5.0
    again = names["again"]
    assert again.worst_error < 0.01 and again.objective[0] < 1e-3  # the part is the design that met the targets


def accuracy(names: Names, folder: Path) -> None:
    bending, L, forces = 1770.0 * 10.0 * 3.0**3 / 12.0, 54.0, np.array([1.0, 2.0, 3.0])
    assert names["curve"].corrected == pytest.approx(forces * L**3 / (3.0 * bending), rel=0.06)


PAGES: dict[str, Callable[[Names, Path], None]] = {
    "README.md": readme,
    "docs/getting-started.md": getting_started,
    "docs/guide/describe.md": describe,
    "docs/guide/simulate.md": simulate,
    "docs/guide/snap-through.md": snap_through,
    "docs/guide/design.md": design,
    "docs/guide/accuracy.md": accuracy,
}


def code(page: str) -> str:
    return "\n".join(re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), flags=re.S))


LONG = ("README.md", "docs/guide/design.md")
MARKED = [pytest.param(page, marks=[pytest.mark.thorough] * (page in LONG)) for page in PAGES]


@pytest.mark.parametrize("page", MARKED)
def test_code_of_a_page_runs_and_is_right(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: Names = {}
    exec(compile(code(page), page, "exec"), names)  # the project's own file
    PAGES[page](names, tmp_path)


def test_every_page_with_code_is_run():
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    assert {str(page.relative_to(ROOT)) for page in pages if "```python" in page.read_text()} == set(PAGES)


def test_every_module_of_the_theory_stands_on_one_page():
    folders = (
        "laws",
        "equilibrium",
        "continuation",
        "elasticity",
        "effects",
        "joints",
        "multibody",
        "quantities",
        "stress",
        "estimates",
        "design",
    )
    files = [file for folder in folders for file in (ROOT / "fenicsmech" / folder).rglob("*.py")]
    files += [
        ROOT / "fenicsmech" / name
        for name in (
            "meshing/centreline.py",
            "meshing/images.py",
            "simulation/recomputed.py",
            "simulation/rest_start.py",
            "simulation/transfer.py",
        )
    ]
    modules = {".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files if file.stem != "__init__"}
    listed = [
        name
        for page in (ROOT / "docs" / "theory").glob("*.md")
        for name in re.findall(r"automodule:: (\S+)", page.read_text())
    ]
    assert sorted(listed) == sorted(modules)


def test_every_path_of_the_makefile_exists():
    text = re.sub(r"\\\n\s*", " ", (ROOT / "Makefile").read_text())
    for folder, names in re.findall(r"patsubst %,(tests/[\w/%.]+\.py),([\w ]+)\)", text):
        for name in names.split():
            assert (ROOT / folder.replace("%", name)).exists(), folder.replace("%", name)
    for path in re.findall(r"(?<![%\w])((?:tests|tools|demos)/[\w/-]+(?:\.py|\.sh|\.txt)?)(?=[\s\\])", text):
        assert (ROOT / path).exists(), path


PAGES_OF_TEXT = [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
SOURCES = [file for folder in ("fenicsmech", "benchmarks", "demos") for file in (ROOT / folder).rglob("*.py")]


def test_every_path_command_and_target_named_exists():
    makefile, missing = (ROOT / "Makefile").read_text(), []
    tables = re.findall(r"^BENCHMARKS := (.*)", makefile, flags=re.M)[0].split()
    targets = {*re.findall(r"^([\w-]+):", makefile, flags=re.M), *(f"table-{name}" for name in tables)}
    for file in [*PAGES_OF_TEXT, *SOURCES]:
        text = file.read_text()
        paths = re.findall(r"(?<![\w/])(?<!\w\.)((?:fenicsmech|tests|benchmarks|demos|tools|docs)/[\w./-]*\w)", text)
        modules = [name.replace(".", "/") for name in re.findall(r"-m ((?:benchmarks|tests)(?:\.\w+)+)", text)]
        found = [path for path in paths if (ROOT / path).exists()]
        found += [path for path in modules if (ROOT / path).exists() or (ROOT / f"{path}.py").exists()]
        named = [name for name in re.findall(r"`make ([\w-]+)", text) if name not in targets]
        missing += [f"{file.name}: {name}" for name in {*paths, *modules} - {*found} if "NAME" not in name]
        missing += [f"{file.name}: make {name}" for name in named]
    assert not missing


def test_every_name_on_the_way_through_the_code_exists():
    page = (ROOT / "docs" / "contributing.md").read_text()
    rows = re.findall(r"^\| [^|`]+ \| (`.*?) \| (.*) \|$", page, flags=re.M)
    assert len(rows) > 20
    for files, names in rows:
        code = "\n".join((ROOT / "fenicsmech" / file).read_text() for file in re.findall(r"`([\w/]+\.py)`", files))
        for name in re.findall(r"`([\w.]+)`", names):
            for each in name.split("."):
                assert re.search(rf"(?:class|def) {each}\b", code), f"{name} is not in {files}"


def test_generated_tables_are_measured():
    for table in (ROOT / "docs" / "tables").glob("*.md"):
        assert re.search(r"^Commit [0-9a-f]{7}", table.read_text(), flags=re.M), f"{table.name}: run its command"
