"""Kills `vsd build --publish` again and again, against a real S3-compatible server on this machine (moto).

After every kill a reader opens what `current.json` names, through `pyarrow.fs`: always the facts of one build, whole.
After the last run the totals are those of the project. Then the records are published too, and a project that fetches
them must have the same files and facts. Run it with

    PYTHONPATH=tests python tests/cluster/prove_bucket.py --kills 12

and put its line into docs/methods/several-machines.md. Exits with 1 when anything is wrong.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pyarrow.fs
import pyarrow.parquet as pq
from benchmarks.made_up_site import write_site
from prove_cluster import free_port, kill, start, wait_for

from vsd_analytics.config.project import load_site
from vsd_analytics.warehouse.build import build, current_files

BUCKET, URL = "figures", "s3://figures/shop"
Totals = dict[str, int]


def published(port: int) -> Totals | None:
    """Return the rows of each fact as a reader of the bucket finds them; None before the first build."""
    s3 = pyarrow.fs.S3FileSystem(
        endpoint_override=f"127.0.0.1:{port}", scheme="http", access_key="x", secret_key="x", region="us-east-1"
    )
    try:
        with s3.open_input_stream(f"{BUCKET}/shop/current.json") as file:
            named = json.loads(file.read())["facts"]
    except FileNotFoundError:
        return None
    rows = {fact: [pq.read_table(f"{BUCKET}/shop/{n}", filesystem=s3) for n in names] for fact, names in named.items()}
    return {fact: sum(t.num_rows for t in tables) for fact, tables in rows.items()}


def stored(project: Path) -> Totals:
    """Return the rows of each fact of the project."""
    site = load_site(project, environ={})
    files = current_files(site, build(site))
    return {fact: sum(pq.read_metadata(p).num_rows for p in paths) for fact, paths in files.items()}


def files(project: Path) -> dict[str, bytes]:
    """Return the files of records of a project."""
    found = (project / "store").rglob("*.parquet")
    return {str(path.relative_to(project)): path.read_bytes() for path in found}


def main() -> int:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng, port = random.Random(given.seed), free_port()
    access = {"AWS_ACCESS_KEY_ID": "x", "AWS_SECRET_ACCESS_KEY": "x", "AWS_DEFAULT_REGION": "us-east-1"}
    os.environ |= {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}", **access}
    server = start(sys.executable, "-m", "moto.server", "-p", str(port))
    n_wrong = n_old = n_new = 0
    is_fetched = False
    try:
        wait_for(port)
        import boto3

        boto3.client("s3").create_bucket(Bucket=BUCKET)
        with tempfile.TemporaryDirectory() as folder:
            project = Path(folder)
            write_site(project, n_records=60_000, n_cameras=1, open_h=1)
            text = (project / "vsd.toml").read_text()
            of_distance: dict[float, Totals] = {}
            for distance_m in (2.0, 1.0):
                (project / "vsd.toml").write_text(text.replace("[site]\n", f"[site]\ndistance_m = {distance_m}\n", 1))
                of_distance[distance_m] = stored(project)
            assert of_distance[1.0] != of_distance[2.0]
            command = [sys.executable, "-c", "from vsd_analytics.cli import main; main()", "-C", str(project)]
            command += ["build", "--publish", URL]
            old: Totals | None = None
            begun = time.monotonic()
            subprocess.run(command, check=True, capture_output=True)
            whole_s = time.monotonic() - begun
            old = of_distance[1.0]
            for number in range(given.kills):
                distance_m = (2.0, 1.0)[number % 2]
                (project / "vsd.toml").write_text(text.replace("[site]\n", f"[site]\ndistance_m = {distance_m}\n", 1))
                stored(project)  # so that nearly all of the run is writing to the bucket
                running = start(*command)
                time.sleep(whole_s * rng.uniform(0.3, 1.1))
                kill(running)
                found, new = published(port), of_distance[distance_m]
                n_old, n_new = n_old + (found == old), n_new + (found == new)
                n_wrong += found not in (old, new)
                subprocess.run(command, check=True, capture_output=True)
                n_wrong += published(port) != new
                old = new
            subprocess.run([*command, "--records"], check=True, capture_output=True)
            with tempfile.TemporaryDirectory() as reader:
                shutil.copy(project / "vsd.toml", reader)
                subprocess.run([*command[:4], reader, "fetch", URL], check=True, capture_output=True)
                is_fetched = files(Path(reader)) == files(project) and stored(Path(reader)) == stored(project)
    finally:
        kill(server)
    print(f"{given.kills} kills: {n_old} left the old build, {n_new} the new one, {n_wrong} wrong")
    print(f"a project that fetched the records has their bytes and the rows of facts: {'yes' if is_fetched else 'NO'}")
    return int(n_wrong > 0 or not is_fetched)


if __name__ == "__main__":
    sys.exit(main())
