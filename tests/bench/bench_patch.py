#!/usr/bin/env python3
"""Measures how long PATCH /v1/scene takes on a forest as large as asked for, in the real daemon.

  tests/bench/bench_patch.py [--build DIR] [--trees N] [--times N] [--scattered N] [--profile FILE]

Trees are scattered over procedural terrain, 20 m^2 a tree, at most 4.5 km a side. Four patches, in turns: one tree that comes,
one that goes, a polygon of 60 m x 60 m that goes, and N trees far from each other that come. Told are the wall time of the
request, the processor time of the scene process that makes the patch, what it says of it ("scene", "what is drawn": by the
clock) and the wall time of the first view after it. --profile: perf record of the scene process and its successors meanwhile. Nothing is asserted
about time; every patch must be answered with what was asked for.
"""
import argparse
import http.client
import json
import os
import pathlib
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOKEN = "bench"


def scene_of(trees):
    side = min(4500.0, max(300.0, (trees * 20.0) ** 0.5))
    return side, {
        "name": "bench",
        "terrain": {"procedural": {"size_m": side, "samples": 1025, "relief_m": side / 40, "seed": 1}},
        "species": [{"name": "oak", "procedural": {"habit": "broadleaf", "leaves": 9000, "seed": 2}},
                    {"name": "pine", "procedural": {"habit": "conifer", "leaves": 12000, "seed": 4}}],
        "forest": [{"scatter": {"count": trees, "seed": 5, "mix": {"oak": 0.6, "pine": 0.4}, "height_m": [5, 22],
                                "min_spacing_m": 2}}],
    }


class Daemon:
    def __init__(self, build, folder, scene):
        path = folder / "scene.json"
        path.write_text(json.dumps(scene))
        self.log_path = folder / "log"
        self.log = self.log_path.open("wb")
        command = [build / "server/silvistad", "--scene", path, "--listen", "127.0.0.1:0", "--workers", "1",
                   "--admin-token", TOKEN, "--refine-samples", "0"]
        if "SILVISTA_CACHE_DIR" not in os.environ:
            command += ["--cache-dir", folder / "cache"]
        self.process = subprocess.Popen([str(c) for c in command], stdout=subprocess.PIPE, stderr=self.log, text=True)
        found = re.search(r"127\.0\.0\.1:(\d+)", self.process.stdout.readline())
        self.port = int(found.group(1))
        while self.ask("GET", "/readyz")[0] != 200:
            if self.process.poll() is not None:
                sys.exit(self.log_path.read_text()[-2000:])
            time.sleep(0.2)

    def ask(self, method, target, body=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=600)
        headers = {"Authorization": "Bearer " + TOKEN, "Content-Type": "application/json"} if body else {}
        began = time.monotonic()
        connection.request(method, target, json.dumps(body) if body else None, headers)
        answer = connection.getresponse()
        data = answer.read()
        return answer.status, data, time.monotonic() - began

    def patch(self, body):
        status, data, wall = self.ask("PATCH", "/v1/scene", body)
        if status != 200:
            sys.exit(data.decode())
        told = re.findall(r"scene ([0-9.]+) ms, what is drawn ([0-9.]+) ms", self.log_path.read_text())[-1]
        return json.loads(data), 1e3 * wall, self.successor_ms(), float(told[0]), float(told[1])

    def successor_ms(self):
        """Processor time of the youngest scene process, which was born for the patch."""
        children = pathlib.Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        youngest = max(children, key=lambda pid: int(pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19]))
        return int(pathlib.Path(f"/proc/{youngest}/schedstat").read_text().split()[0]) * 1e-6

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(60)


def square(x, y, half):
    return [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half],
            [x - half, y - half]]


def measure(daemon, side, options):
    random_ = random.Random(7)
    place = lambda: (random_.uniform(0.05, 0.95) * side, random_.uniform(0.05, 0.95) * side)
    tree = lambda: dict(zip(("x", "y"), place()), species="oak", height_m=15)
    rows, came = {}, []

    def one(kind, body, trees):
        told, *times = daemon.patch({"trees": body})
        if trees is not None and told["trees"]["added"] + told["trees"]["removed"] != trees:
            sys.exit("%s: %s" % (kind, told))
        status, _, view = daemon.ask("GET", "/v1/view?x=%.1f&y=%.1f&agl=40&pitch=-20&width=256&height=256" % place())
        if status != 200:
            sys.exit("a view: %d" % status)
        rows.setdefault(kind, []).append((*times, 1e3 * view))
        return told

    for _ in range(options.times):
        told = one("a tree comes", {"add": [tree()]}, 1)
        came.append(told["trees"]["first_id"])
        one("a tree goes", {"remove": {"ids": [came.pop()]}}, 1)
        x, y = place()
        one("60 m x 60 m go", {"remove": {"within": {"type": "Polygon", "coordinates": [square(x, y, 30)]}}}, None)
        one("%d come" % options.scattered, {"add": [tree() for _ in range(options.scattered)]}, options.scattered)
    print("| patch | wall | least, most | processor | scene | what is drawn | first view after |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for kind, values in rows.items():
        wall, cpu, scene, drawn, view = (statistics.median(v) for v in zip(*values))
        walls = [v[0] for v in values]
        print(f"| {kind} | {wall:.0f} ms | {min(walls):.0f}, {max(walls):.0f} ms | {cpu:.0f} ms | {scene:.0f} ms | {drawn:.0f} ms | "
              f"{view:.0f} ms |")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build")
    parser.add_argument("--trees", type=int, default=1000000)
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--scattered", type=int, default=300)
    parser.add_argument("--profile", type=pathlib.Path)
    options = parser.parse_args()
    side, scene = scene_of(options.trees)
    with tempfile.TemporaryDirectory() as folder:
        daemon = Daemon(options.build, pathlib.Path(folder), scene)
        try:
            perf = None
            if options.profile:
                task = pathlib.Path(f"/proc/{daemon.process.pid}/task/{daemon.process.pid}/children")
                perf = subprocess.Popen(["perf", "record", "-q", "-g", "-F", "499", "-o", options.profile, "-p",
                                         ",".join(task.read_text().split())])
                time.sleep(1)
            measure(daemon, side, options)
            if perf:
                perf.send_signal(signal.SIGINT)
                perf.wait()
        finally:
            daemon.stop()


main()
