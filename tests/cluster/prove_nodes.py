"""Three nodes hand on to one site, with overlapping deliveries, kills, full and broken disks, and a link that breaks.

Each round makes a site, sends the same messages to one to three of its nodes, and takes steps at random: a node
ingests, a node hands on, the site receives. Most steps are disturbed: killed or refused at a call of the file system
(`tests/faults/crash_points.py`), or cut at a call of the exchange. What was not acknowledged is sent again, as an
engine or a broker would do. Files that were received are put back at the place, as a slow copying program may do. Then
everything runs undisturbed, and the site must have exactly the rows that were sent: by count and by hash. Run it with

    python tests/cluster/prove_nodes.py --rounds 20
    python tests/cluster/prove_nodes.py --rounds 4 --bucket

and put the table into docs/methods/several-machines.md. Exits with 1 when anything is wrong.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS), str(TESTS / "faults"), str(TESTS / "cluster")]

from crash_points import FAULTS, Point, run  # noqa: E402
from exchange_world import NODES, World, expected, litter, make_world, send, stored, take, take_in, traffic  # noqa: E402
from prove_cluster import free_port, kill, start, wait_for  # noqa: E402

DISK_FAULTS = ("kill -9", "kill -9", "kill -9", "ENOSPC that stays", "EIO", "short write, then ENOSPC")
LATEST = {"create": 8, "write": 7, "fsync": 14, "rename": 6, "unlink": 6, "mkdir": 2}
"""About how many calls of a kind a step makes: a later one would not be disturbed."""


def one_round(
    seed: int, root: Path, *, place: str | None, n_frames: int, n_steps: int, n_batches: int = 4
) -> Counter[str]:
    """Return what happened in a round: steps by kind and fault, and what is wrong at its end."""
    rng, seen = random.Random(seed), Counter[str]()
    world = make_world(root, place=place)
    sent = traffic(rng, n_frames=n_frames, n_batches=n_batches)
    left = {node: ["\n".join(batch) for batch in batches] for node, batches in sent.batches.items()}
    old: dict[Path, bytes] = {}
    outage = 0
    for _ in range(n_steps):
        if place is None:
            outage = toggle(world, outage or (rng.random() < 0.08) * rng.randint(2, 6), seen)
            keep_copies(world, old)
            if old and not outage and rng.random() < 0.2:
                path = rng.choice(sorted(old))
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(old[path])
                seen["files put back"] += 1
        step(world, rng, left, seen)
    if outage:
        toggle(world, 1, seen)
    finish(world, left)
    truth, found = expected(world, sent), stored(world)
    seen["rows"] += sum(map(len, truth))
    seen["wrong"] += digest(truth) != digest(found) or list(map(len, truth)) != list(map(len, found))
    seen["left over"] += len(litter(world)) if place is None else len([x for x in litter(world) if "place" not in x])
    return seen


def step(world: World, rng: random.Random, left: dict[str, list[str]], seen: Counter[str]) -> None:
    """Take one step, half of the time disturbed."""
    node = rng.choice(NODES)
    action = rng.choice(("ingest", "send", "receive"))
    point, fault, turn, is_killing = None, None, 0, False
    if rng.random() < 0.7:
        if action != "ingest" and rng.random() < 0.4:
            turn, is_killing = rng.randint(1, 12), rng.random() < 0.6
        else:
            fault = FAULTS[rng.choice(DISK_FAULTS)]
            kind = rng.choice([k for k in LATEST if k in fault.kinds])
            point = Point(kind, rng.randint(1, LATEST[kind]), "", "")
    where = {"point": point, "fault": fault}
    if action == "ingest":
        if not left[node]:
            return
        done = run(take_in, world.root, world.place, node, left[node][0], **where)
        if done.status == "ok":
            left[node].pop(0)
    elif action == "send":
        done = run(send, world.root, world.place, node, turn, is_killing, **where)
    else:
        done = run(take, world.root, world.place, turn, is_killing, **where)
    seen["steps"] += 1
    if done.status == "killed":
        seen[f"kills of {'the site' if action == 'receive' else 'nodes'}"] += 1
    elif done.struck is not None and fault is not None:
        seen[f"disks {'full' if 'ENOSPC' in fault.name else 'broken'}"] += 1
    elif turn and done.status == "error":
        seen["links broken"] += 1
    if done.status == "unclear":
        seen["wrong"] += 1
        print(action, node, fault, point, done.told, file=sys.stderr)


def toggle(world: World, outage: int, seen: Counter[str]) -> int:
    """Take the place away at the begin of an outage and bring it back at its end; return the steps that are left."""
    here, away = world.root / "place", world.root / "away"
    if outage and here.exists():
        here.rename(away)
        seen["outages"] += 1
    elif outage == 1 and away.exists():
        away.rename(here)
        return 0
    return max(0, outage - 1) if outage > 1 else outage


def keep_copies(world: World, old: dict[Path, bytes]) -> None:
    """Note the files of records at the place."""
    for path in (world.root / "place" / "nodes").glob("*/*/*"):
        if not path.name.startswith("."):
            old[path] = path.read_bytes()


def finish(world: World, left: dict[str, list[str]]) -> None:
    """Deliver what is left, and hand on and receive until nothing is on its way."""
    for node, texts in left.items():
        for text in texts:
            take_in(world.root, world.place, node, text)
    for _ in range(3):
        for node in NODES:
            send(world.root, world.place, node)
        take(world.root, world.place)
    for node in NODES:
        send(world.root, world.place, node)


def digest(rows: Sequence[object]) -> str:
    return hashlib.blake2b(repr(rows).encode(), digest_size=16).hexdigest()


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--steps", type=int, default=80)
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bucket", action="store_true", help="Through a bucket of a server on this machine (moto).")
    given = parser.parse_args()
    server, url = None, None
    if given.bucket:
        port = free_port()
        access = {"AWS_ACCESS_KEY_ID": "x", "AWS_SECRET_ACCESS_KEY": "x", "AWS_DEFAULT_REGION": "us-east-1"}
        os.environ |= {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}", **access}
        server = start(sys.executable, "-m", "moto.server", "-p", str(port))
        wait_for(port)
        import boto3

        boto3.client("s3").create_bucket(Bucket="exchange")
    total = Counter[str]()
    try:
        for number in range(given.rounds):
            if given.bucket:
                url = f"s3://exchange/round-{number}"
            root = Path(tempfile.mkdtemp())
            try:
                total += one_round(given.seed + number, root, place=url, n_frames=given.frames, n_steps=given.steps)
            finally:
                shutil.rmtree(root, ignore_errors=True)
    finally:
        if server is not None:
            kill(server)
    seeds = f"seeds {given.seed} to {given.seed + given.rounds - 1}"
    print(f"{given.rounds} rounds, {seeds}, through {'a bucket' if given.bucket else 'a folder'}\n")
    for name in sorted({*total, "wrong", "left over"}):
        print(f"| {name} | {total[name]:,} |")
    return int(total["wrong"] > 0 or total["left over"] > 0)


if __name__ == "__main__":
    sys.exit(main())
