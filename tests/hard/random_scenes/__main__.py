"""Judges random scenes, shows progress and prints the table of outcomes: `python -m tests.hard.random_scenes`.

Verdicts are kept in DIR/seed-SEED.jsonl; the same command goes on after an interruption, with the same code. Exits
with 1 if any is wrong, or if an excuse lets off more than its share.
"""

from __future__ import annotations

import os
import sys
import time
from functools import partial
from pathlib import Path

from benchmarks.table import ROOT, command, publish, revision
from fenicsmech.files import atomic_write

from .record import CODE, OtherCode, append, read
from .scene_result import SceneResult, judge
from .summary import excessive, raw_table, table
from .worker import Crashed, side_by_side

_RAW = ROOT / "docs" / "tables" / "random-scenes.csv"


def main() -> int:
    """Runs what the command line asks for."""
    parser = command(__doc__)
    parser.add_argument("--count", type=int, default=1000, help="number of scenes")
    parser.add_argument("--seed", type=int, default=0, help="the first scene")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds of a processor after which a scene hangs")
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="scenes judged side by side")
    parser.add_argument("--quick", action="store_true", help="larger elements and fewer loads")
    parser.add_argument("--out", type=Path, default=Path("results/random-scenes"), metavar="DIR")
    options = parser.parse_args()
    if options.quick and options.write:
        parser.error("--quick scenes are for building; leave --write out, or --quick")
    seeds = range(options.seed, options.seed + options.count)
    path = options.out / f"{'quick' if options.quick else 'seed'}-{options.seed}.jsonl"
    commit = revision(*CODE)
    try:
        known = read(path, commit, lambda entries: SceneResult(**entries))
    except OtherCode as other:
        parser.error(str(other))
    results = {seed: result for seed, result in known.items() if seed in seeds}
    start, before = time.monotonic(), len(results)
    missing = [seed for seed in seeds if seed not in results]
    judging, failed = partial(judge, quick=options.quick), partial(_failed, options.limit)
    for result in side_by_side(judging, missing, failed, limit=options.limit, processes=options.processes):
        results[result.seed] = result
        append(path, result.record(), commit)
        done, wrong = len(results), sum(own.wrong for own in results.values())
        left = (time.monotonic() - start) / (done - before) * (options.count - done)
        print(
            f"\r{done}/{options.count} scenes, {wrong} wrong, {left:.0f} s left ", end="", file=sys.stderr, flush=True
        )
    print(file=sys.stderr)
    judged = [results[seed] for seed in seeds]
    publish("random_scenes", table(judged), write=options.write, commit=commit)
    if options.write:
        with atomic_write(_RAW) as file:
            file.write(raw_table(judged))
    return int(bool(excessive(judged)) or any(result.wrong for result in judged))


def _failed(limit: float, seed: int, failure: TimeoutError | Crashed) -> SceneResult:
    end, cpu = ("hangs", limit) if isinstance(failure, TimeoutError) else ("crashes", 0.0)
    return SceneResult(seed, "", f"wrong: {end}", str(failure), seconds=cpu, cpu=cpu)


if __name__ == "__main__":
    sys.exit(main())
