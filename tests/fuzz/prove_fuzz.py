"""At least 100,000 damaged inputs over all adapters: none ends in a traceback or hangs, and the good rows are stored.

    python tests/fuzz/prove_fuzz.py --inputs 100000 --seed 0

prints a Markdown table for docs/security.md. A sample also goes through `vsd ingest` itself. Every failure is printed
with the number that makes it again: `--only NUMBER`.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import multiprocessing as mp
import resource
import sys
import tempfile
import traceback
import warnings
from collections import Counter, defaultdict
from pathlib import Path
from queue import Empty
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent.parent)]

import fuzz_mutations as mutations  # noqa: E402
from fuzz_cases import WORLDS, run_case  # noqa: E402
from fuzz_judge import HangError, Judge  # noqa: E402
from fuzz_worlds import CONFIG, text_of  # noqa: E402

MEMORY_BYTES = 8 << 30
SILENCE_S = 600
CHUNK = 100
CLI_EVERY = 50


def worker(first: int, end: int, step: int, seed: int, said: mp.Queue[Any], at: Any) -> None:
    """Run cases `first`, `first + step`, ... below `end` and report them a chunk at a time."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    for kind in (RuntimeWarning, SyntaxWarning):  # people would see them
        warnings.simplefilter("error", kind)
    with tempfile.TemporaryDirectory() as folder:
        judge, done = Judge(Path(folder)), []
        for number in range(first, end, step):
            at.value = number
            try:
                verdict = run_case(judge, number, seed=seed)
                outcome = verdict.outcome
                done.append((verdict.world, verdict.damage, outcome.word, outcome.code, outcome.took_s, ""))
                if number // step % CLI_EVERY == 0:
                    through_command(Path(folder), number, seed=seed)
            except (Exception, HangError):
                done.append((WORLDS[number % len(WORLDS)].name, "", "failed", "", 0.0, f"{number}: {_last()}"))
            if len(done) == CHUNK:
                said.put(done)
                done = []
        said.put(done)
    said.put(None)


def through_command(folder: Path, number: int, *, seed: int) -> None:
    """Run a damaged text through `vsd ingest`; an exit code it does not know, or E900, is a failure."""
    from random import Random

    from vsd_analytics.cli import cli
    from vsd_analytics.cli.exit_codes import run

    rng = Random(f"cli/{seed}/{number}")
    world = rng.choice([w for w in WORLDS if w.file and w.lines])
    damage = mutations.ANYWHERE[rng.choice(sorted(mutations.ANYWHERE))]
    project = folder / "cli"
    project.mkdir(exist_ok=True)
    (project / "vsd.toml").write_text(CONFIG)
    assert world.pack is not None
    (project / world.file).write_bytes(world.pack(damage(rng, text_of(world.lines))))
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(cli, ["-C", str(project), "--now", "2026-11-20T00:00:00Z", "ingest", str(project / world.file)])
    said = out.getvalue() + err.getvalue()
    if code not in (0, 1, 2) or "E900" in said or "Traceback" in said:
        raise AssertionError(f"vsd ingest of case cli/{seed}/{number}: {code} {said[-500:]}")


def _last() -> str:
    return traceback.format_exc(limit=-3)


def prove(inputs: int, *, seed: int, processes: int) -> tuple[list[Any], list[str]]:
    """Return what became of every input, and the failures; a worker that dies or falls silent is one of them."""
    context = mp.get_context("spawn")
    running, results, failures = [], [], []
    for i in range(processes):
        said, at = context.Queue(), context.Value("q", -1)
        process = context.Process(target=worker, args=(i, inputs, processes, seed, said, at), daemon=True)
        process.start()
        running.append((process, said, at))
    while running:
        process, said, at = running.pop(0)
        try:
            chunk = said.get(timeout=SILENCE_S)
        except Empty:
            end = "hangs" if process.is_alive() else f"died ({process.exitcode})"
            failures.append(f"{at.value}: the process {end}")
            print(f"\nFAILED {failures[-1]}", file=sys.stderr, flush=True)
            process.kill()
            said, first = context.Queue(), at.value + processes
            process = context.Process(target=worker, args=(first, inputs, processes, seed, said, at), daemon=True)
            process.start()
            running.append((process, said, at))
            continue
        if chunk is None:
            process.join()
            continue
        results += chunk
        for text in (text for *_, text in chunk if text):
            failures.append(text)
            print(f"\nFAILED {text}", file=sys.stderr, flush=True)
        running.append((process, said, at))
    return results, failures


def table(results: list[Any]) -> str:
    """Return what became of the inputs, one row an adapter, as Markdown."""
    kinds: dict[str, set[str]] = defaultdict(set)
    words: dict[str, Counter[str]] = defaultdict(Counter)
    codes: dict[str, Counter[str]] = defaultdict(Counter)
    slowest: dict[str, float] = defaultdict(float)
    for world, damage, word, code, took_s, _ in results:
        kinds[world].add(damage)
        words[world][word] += 1
        codes[world].update([code] if code else [])
        slowest[world] = max(slowest[world], took_s)
    lines = [
        "| input | kinds of damage | inputs | clean | quarantined | refused | failed | slowest s |",
        "|---|--:|--:|--:|--:|---|--:|--:|",
    ]
    names = [w.name for w in WORLDS if w.name in words]
    for name in names:
        n = words[name]
        refused = ", ".join(f"{code} {count:,}" for code, count in sorted(codes[name].items())) or "0"
        lines.append(
            f"| {name} | {len(kinds[name])} | {n.total():,} | {n['clean']:,} | {n['quarantined']:,} | {refused} "
            f"| {n['failed']:,} | {slowest[name]:.2f} |"
        )
    total, n_kinds = sum(words.values(), Counter()), len(set().union(*kinds.values()))
    lines.append(
        f"| all | {n_kinds} | {total.total():,} | {total['clean']:,} | {total['quarantined']:,} | {total['refused']:,} "
        f"| {total['failed']:,} | {max(slowest.values()):.2f} |"
    )
    return "\n".join(lines)


def main() -> int:
    """Print the table and the failures; return 1 when there are any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", type=int, help="Run one case and show its traceback.")
    given = parser.parse_args()
    if given.only is not None:
        with tempfile.TemporaryDirectory() as folder:
            print(run_case(Judge(Path(folder)), given.only, seed=given.seed))
        return 0
    results, failures = prove(given.inputs, seed=given.seed, processes=given.processes)
    print(f"{len(results):,} inputs, seed {given.seed}; one in {CLI_EVERY} also through vsd ingest\n")
    print(table(results))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
