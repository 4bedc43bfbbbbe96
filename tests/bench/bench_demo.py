#!/usr/bin/env python3
"""Measures a scene in the real daemon and prints README's table: time to ready, memory, cold draw time.

  tests/bench/bench_demo.py [--build DIR] [--scene FILE] [--poses N]

Starts silvistad on a free port with an empty cache folder (first start), again with what was kept (second start), then asks
for N poses of two kinds (overview: 30 to 60 m above the ground; walk: 1.7 m), each once, so that no picture is cached. Draw
time is the server's own `near` stage plus `composite`; encoding and the hand-over are told apart. Memory is PSS split by
/proc/PID/smaps_rollup. Nothing is asserted about time.
"""
import argparse
import json
import os
import pathlib
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]


def start(build, scene, cache):
    began = time.monotonic()
    process = subprocess.Popen([str(build / "server/silvistad"), "--scene", scene, "--listen", "127.0.0.1:0"],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env={**os.environ, "SILVISTA_CACHE_DIR": cache})
    url = None
    while url is None:
        line = process.stdout.readline()
        if not line:
            sys.exit("silvistad ended: " + process.stderr.read()[-2000:])
        found = re.search(r"http://[0-9.]+:\d+", line)
        url = found.group(0) if found else None
    os.set_blocking(process.stderr.fileno(), False)
    while True:
        try:
            process.stderr.read()
            with urllib.request.urlopen(url + "/readyz", timeout=5) as answer:
                if answer.status == 200:
                    return process, url, time.monotonic() - began
        except OSError:
            pass
        if process.poll() is not None:
            sys.exit("silvistad ended while loading")
        time.sleep(0.05)


def family(pid):
    """pid and all its descendants."""
    found = [pid]
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            found += family(int(child))
    return found


def memory(pid):
    fields = {}
    for line in pathlib.Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]:
        name, value = line.split(":")
        fields[name] = int(value.split()[0]) / 1024
    own = fields["Private_Clean"] + fields["Private_Dirty"]
    return {"rss": fields["Rss"], "pss": fields["Pss"], "own": own, "shared": fields["Rss"] - own}


def name_of(pid):
    return pathlib.Path(f"/proc/{pid}/comm").read_text().strip()


def poses(extent, count):
    """Fixed poses, spread by golden ratios: the same in every run."""
    x0, y0, x1, y1 = extent
    for k in range(count):
        u, v = (0.1 + 0.8 * ((k * 0.7548776662 + 0.5) % 1)), (0.1 + 0.8 * ((k * 0.5698402910 + 0.5) % 1))
        base = f"x={x0 + u * (x1 - x0):.2f}&y={y0 + v * (y1 - y0):.2f}&heading={(k * 137.508) % 360:.2f}"
        yield "overview", base + f"&agl={30 + 30 * ((k * 0.31) % 1):.2f}&pitch=-12"
        yield "walk", base + "&agl=1.7&pitch=2"


def ask(url, query):
    began = time.monotonic()
    with urllib.request.urlopen(f"{url}/v1/view?{query}", timeout=120) as answer:
        body = answer.read()
        stages = dict(re.findall(r"(\w+);dur=([0-9.]+)", answer.headers["Server-Timing"]))
    return {**{k: float(v) for k, v in stages.items()}, "wall": (time.monotonic() - began) * 1000, "bytes": len(body)}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build")
    parser.add_argument("--scene", default=str(ROOT / "deploy/demo/scene.json"))
    parser.add_argument("--poses", type=int, default=12)
    parser.add_argument("--quality", default="balanced")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as cache:
        process, url, first = start(options.build, options.scene, cache)
        process.send_signal(signal.SIGTERM)
        process.wait(30)
        process, url, second = start(options.build, options.scene, cache)
        try:
            scene = json.load(urllib.request.urlopen(url + "/v1/scene"))
            print(f"| ready, first start (nothing kept) | {first:.1f} s |")
            print(f"| ready, from then on | {second:.1f} s |")
            extent = scene["extent"]["scene"]
            for size in ("512x512", "1024x768"):
                width, height = size.split("x")
                rows = {"overview": [], "walk": []}
                for kind, query in poses(extent, options.poses):
                    rows[kind].append(ask(url, f"{query}&width={width}&height={height}&quality={options.quality}"))
                for kind, values in rows.items():
                    draw = [v.get("near", 0) + v.get("composite", 0) for v in values]
                    print(f"| draw {size}, {kind}, cold | median {statistics.median(draw):.0f} ms, worst {max(draw):.0f} ms"
                          f" (encode {statistics.median(v.get('encode', 0) for v in values):.1f} ms, whole answer "
                          f"{statistics.median(v['wall'] for v in values):.0f} ms) |")
            for pid in family(process.pid):
                m = memory(pid)
                print(f"| memory of {name_of(pid)} ({pid}) | {m['own']:.0f} MB own, {m['shared']:.0f} MB shared, "
                      f"{m['pss']:.0f} MB proportional |")
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(30)


main()
