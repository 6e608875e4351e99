"""Scripts run on two ranks as they are: each file is written once, each line printed once, an error ends all."""

import fenicsmech as fm

RANKS = 2
DESCRIPTION = """
import fenicsmech as fm

beam = fm.Mechanism("cantilever")
wall, hook = beam.rigid("wall", fixed=True), beam.rigid("hook")
strip = beam.flexible("strip", fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=10.0), fm.ONYX)
beam.clamp(wall, strip, end="start", length=4.0)
beam.revolute(strip, hook, at=(58, 0), interface_radius=1.0)
push = beam.force(on=hook, at=(58, 0), direction=(0, -1), name="push")
sim = fm.Simulation(fm.Scene(beam), space="plane-stress", size=3.0)
curve = sim.load_displacement(push, forces=[0, 1, 2])
"""
WRITING = """
curve.plot("curve.png")
curve.write_csv("curve.csv", errors=True)
fm.plot_curve("both.png", [curve.series("one"), curve.series("other", faint=True)])
fm.print_once("bends", f"{curve.displacements[-1]:.2f}", curve.error_estimates().shape, sep="|")
"""
FAILING = """
for write in (
    lambda: curve.plot("file/curve.png"),
    lambda: curve.write_csv("file/curve.csv"),
    lambda: fm.plot_curve("file/both.png", [curve.series()]),
):
    try:
        write()
    except OSError:
        print("refused", flush=True)
"""


def test_files_are_written_and_lines_printed_once_and_errors_raised_on_all_ranks(mpirun, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("no folder")
    (tmp_path / "script.py").write_text(DESCRIPTION + WRITING + FAILING)
    done = mpirun(RANKS, "script.py")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("bends|") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"script.py", "file", "curve.png", "curve.csv", "both.png"}
    assert {len(column) for column in fm.read_csv("curve.csv").values()} == {3}
    assert done.stdout.count("refused") == 3 * RANKS
