"""fuzz_http.py N [SEED] [THREADS] - N (50,000 with SV_TEST_FULL=1) mutated requests (query strings, JSON bodies, raw bytes) against the real daemon.

Each must get a defined status or, where bytes were broken, a clean close. At the end the daemon, its scene process and
its workers must be the ones that were there at the start, without more descriptors or memory than after the warm-up, and
at least a fifth of the requests must have reached drawing. The request that fails is printed, with its seed.
"""
import json
import os
import random
import socket
import sys
import threading
import time
import urllib.parse

from harness import Daemon, until

STATUSES = {200, 204, 304, 400, 404, 405, 406, 411, 413, 414, 415, 422, 431, 501, 503, 505}
NUMBERS = ["nan", "inf", "-inf", "1e309", "-1e309", "-0", "4.9e-324", "1e-310", "0", "1e30", "-1", "007", "0x10", "1e",
           "", " ", "+1", "%2B1", "1,5", "1e400", "9" * 60, "9" * 300, ".", "-", "1.", "1e+2", "\u0661", "true", "null"]
CHOICES = {
    "format": ["png", "jpeg", "webp", "tiff", "exr", "gif", "PNG"],
    "layer": ["color", "depth", "normal", "id", "color,depth", "color,color", "depth,normal,id", ",", "none"],
    "quality": ["fast", "balanced", "high", "best"],
    "trees": ["auto", "polygon", "none", "billboard", "density", "coarse", "x"],
    "relief": ["auto", "off", "on", "paper"],
    "projection": ["perspective", "orthographic", "fisheye"],
    "north": ["grid", "true", "south"],
    "sky": ["on", "off", "maybe"],
    "shadows": ["off", "on"],
    "air": ["off", "on"],
    "samples": ["1", "4", "16", "64", "2", "0"],
    "time": ["2026-06-21T12:00:00Z", "2026-13-40T99:00:00Z", "now"],
    "crs": ["EPSG:4326", "EPSG:32633", "EPSG:0", "EPSG:x"],
    "f": ["image", "json", "xml"],
}
RANGES = {"heading": (-400, 400), "pitch": (-90, 90), "roll": (-180, 180), "vfov": (1, 150), "q": (1, 100),
          "sun_azimuth": (0, 360), "sun_elevation": (-10, 90), "agl": (0.5, 300), "z": (0, 400), "range": (1, 300),
          "ortho_height": (1, 500), "target_x": (0, 400), "target_y": (0, 400), "target_z": (0, 100),
          "max_error": (0.1, 9), "budget_ms": (1, 99), "relief_distance": (10, 200), "relief_resolution": (64, 2048)}
DAEMON_SETTINGS = {"workers": 2, "max_pixels": 16384, "max_samples_pixels": 65536, "picture_cache_mb": 4,
                   "resolve_cache_entries": 500, "worker_max_views": 0, "access_log": "off", "log_level": "info",
                   "accept_deadline_ms": 5000, "request_read_deadline_ms": 5000, "queue_limit": 64}


def legal_view(r):
    """A view that will be drawn, or nearly always."""
    view = {"x": round(r.uniform(20, 380), 2), "y": round(r.uniform(20, 380), 2), "agl": round(r.uniform(1, 80), 2),
            "width": r.randint(16, 64), "height": r.randint(16, 64), "heading": r.randint(0, 359),
            "pitch": r.randint(-89, 89), "vfov": r.randint(1, 150)}
    kind = r.random()
    if kind < 0.15:
        view.update(projection="orthographic", ortho_height=r.randint(1, 400))
        del view["vfov"]
    elif kind < 0.25:
        view = {k: view[k] for k in ("width", "height", "heading", "pitch")}
        view.update(target_x=r.randint(50, 350), target_y=r.randint(50, 350), target_agl=5, range=r.randint(5, 100))
        view["pitch"] = -abs(view["pitch"])
    view["format"], layer = r.choice([("png", None), ("jpeg", None), ("webp", None), ("tiff", None), ("exr", None),
                                      ("exr", "color,depth,normal,id"), ("tiff", "depth"), ("png", "normal"),
                                      ("tiff", "id"), ("exr", "depth")])
    if layer:
        view["layer"] = layer
    for key, values in (("quality", ["fast", "balanced", "high"]), ("trees", ["auto", "polygon", "none"]),
                        ("samples", [1, 4]), ("sun_elevation", [5, 45, 90]), ("air", ["on", "off"])):
        if r.random() < 0.2:
            view[key] = r.choice(values)
    return view


def mutate_view(r, view):
    for _ in range(r.randint(1, 3)):
        kind = r.randrange(6)
        if kind == 0 and view:
            del view[r.choice(list(view))]
        elif kind == 1:
            key = r.choice(list(RANGES))
            low, high = RANGES[key]
            view[key] = round(r.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low)), 3)
        elif kind == 2:
            key = r.choice(list(CHOICES))
            view[key] = r.choice(CHOICES[key])
        elif kind == 3:
            view[r.choice(list(RANGES) + ["x", "y", "width", "height", "samples", "q"])] = r.choice(NUMBERS)
        elif kind == 4:
            view["".join(chr(r.randrange(33, 0x250)) for _ in range(r.randint(1, 9)))] = "1"
        else:
            view[r.choice(["lon", "lat", "z", "agl", "x", "target_x", "width"])] = r.choice([0, -1, 1e9, 91, 17, 4097])
    return view


def flip(r, data, times):
    data = bytearray(data)
    for _ in range(times):
        kind, at = r.randrange(5), r.randrange(len(data) + 1)
        if kind == 0 and data:
            data[at % len(data)] = r.randrange(256)
        elif kind == 1:
            data[at:at] = bytes([r.randrange(256)])
        elif kind == 2:
            del data[at : at + r.randint(1, 8)]
        elif kind == 3:
            data[at:at] = r.choice([b"\r\n", b"\n", b"\0", b"%00", b"%", b"&", b"=", b"\x80\xff", b"{", b'"', b"[" * 40])
        else:
            data[at:at] = data[at : at + r.randint(1, 30)]
    return bytes(data)


def query_of(r, view):
    pairs = [(k, str(v)) for k, v in view.items()]
    if r.random() < 0.1:
        r.shuffle(pairs)
    return "&".join("%s=%s" % (urllib.parse.quote(k), urllib.parse.quote(v, safe=",:%+")) for k, v in pairs)


def fields(r):
    text = "Host: x\r\n"
    if r.random() < 0.1:
        text += "Accept: %s\r\n" % r.choice(["image/png", "*/*;q=0.1", "text/html", "image/*", ";;,", "image/webp,image/*;q=0"])
    if r.random() < 0.05:
        text += "Prefer: wait=%s\r\n" % r.choice(["30", "x", "99999999999999999999", "-1"])
    if r.random() < 0.05:
        text += "If-None-Match: %s\r\n" % r.choice(["*", '"x"', 'W/"', ",,"])
    return text


def make(r):
    """The bytes of a request, and whether they may break the connection."""
    kind = r.random()
    view = legal_view(r)
    if kind >= 0.45:
        view = mutate_view(r, view)
    if kind < 0.3 or 0.45 <= kind < 0.65:
        query = query_of(r, view)
        if kind >= 0.6:
            query = flip(r, query.encode(), 2).decode("latin-1")
            query = "".join(c if 32 < ord(c) < 127 else "%%%02X" % ord(c) for c in query)
        head = "%s /v1/view?%s HTTP/1.1\r\n%s\r\n" % ("HEAD" if r.random() < 0.02 else "GET", query, fields(r))
        return head.encode("latin-1"), False
    body = json.dumps(view).encode()
    if kind >= 0.75:
        body = flip(r, body, r.randint(1, 4))
    head = "POST /v1/view HTTP/1.1\r\n%sContent-Type: application/json\r\nContent-Length: %d\r\n\r\n" % (fields(r), len(body))
    data = head.encode() + body
    if kind < 0.85:
        return data, False
    if r.random() < 0.5:
        data = ("GET /v1/view?%s HTTP/1.1\r\n%s\r\n" % (query_of(r, view), fields(r))).encode()
    return flip(r, data, r.randint(1, 6)), True


class Client:
    """A connection that is kept as long as it can be."""

    def __init__(self, port):
        self.port, self.socket, self.data = port, None, b""

    def open(self):
        if not self.socket:
            self.socket = socket.create_connection(("127.0.0.1", self.port), timeout=60)
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.data = b""

    def close(self):
        if self.socket:
            self.socket.close()
        self.socket = None

    def more(self):
        try:
            got = self.socket.recv(1 << 18)
        except ConnectionResetError:
            got = b""
        self.data += got
        return bool(got)

    def whole(self, data):
        """Sends a well-framed request on the kept connection; its status."""
        for attempt in (0, 1):
            fresh = self.socket is None
            self.open()
            try:
                self.socket.sendall(data)
                while b"\r\n\r\n" not in self.data:
                    if not self.more():
                        raise ConnectionError("closed without an answer")
                break
            except (ConnectionError, BrokenPipeError):
                self.close()  # a kept connection may have been closed while it idled: once more on a new one
                if fresh:
                    raise
        head, _, rest = self.data.partition(b"\r\n\r\n")
        lines = head.split(b"\r\n")
        status = int(lines[0].split()[1])
        values = dict(l.lower().split(b": ", 1) for l in lines[1:] if b": " in l)
        length = 0 if data[:4] == b"HEAD" or status in (204, 304) else int(values[b"content-length"])
        while len(rest) < length:
            if not self.more():
                raise ConnectionError("closed in mid-answer")
            rest = self.data.partition(b"\r\n\r\n")[2]
        self.data = rest[length:]
        if values.get(b"connection", b"").lower() == b"close":
            self.close()
        return status

    def broken(self, data):
        """Sends any bytes on a connection of their own; the statuses that came before the daemon closed."""
        self.close()
        self.open()
        try:
            self.socket.sendall(data)
            self.socket.shutdown(socket.SHUT_WR)
        except OSError:
            pass
        while self.more():
            pass
        self.close()
        return [int(p.split()[1]) for p in self.data.split(b"\r\n") if p[:9] in (b"HTTP/1.1 ", b"HTTP/1.0 ")]


class Fuzzer:
    def __init__(self, daemon, seed):
        self.daemon, self.seed = daemon, seed
        self.lock, self.counts, self.failure = threading.Lock(), {}, None

    def check(self, number, data, statuses):
        bad = [s for s in statuses if s not in STATUSES and not (s == 100)]
        with self.lock:
            for s in statuses or [0]:
                self.counts[s] = self.counts.get(s, 0) + 1
            if bad and not self.failure:
                self.failure = "request %d: status %s\n%r" % (number, bad, data)

    def run(self, start, count, step):
        client = Client(self.daemon.port)
        for number in range(start, count, step):
            r = random.Random("%s/%d" % (self.seed, number))
            data, may_break = make(r)
            try:
                self.check(number, data, client.broken(data) if may_break else [client.whole(data)])
            except Exception as e:
                with self.lock:
                    self.failure = self.failure or "request %d: %s: %s\n%r" % (number, type(e).__name__, e, data)
            if self.failure:
                return

    def burst(self, first, last, threads):
        crowd = [threading.Thread(target=self.run, args=(first + t, last, threads)) for t in range(threads)]
        for t in crowd:
            t.start()
        for t in crowd:
            t.join()


def resident_kb(pid):
    with open("/proc/%d/status" % pid) as f:
        return next(int(l.split()[1]) for l in f if l.startswith("VmRSS"))


def measure(d):
    until(lambda: d.metric("connections") == 1 and d.metric("flights") == 0, "all connections closed")
    return {"descriptors": len(os.listdir("/proc/%d/fd" % d.process.pid)), "rss_kb": resident_kb(d.process.pid),
            "worker_kb": [resident_kb(p) for p in d.worker_pids()], "family": d.family()}


def main():
    count = 50000 if os.environ.get("SV_TEST_FULL") == "1" else int(sys.argv[1])
    seed = sys.argv[2] if len(sys.argv) > 2 else "1"
    threads = int(sys.argv[3]) if len(sys.argv) > 3 else 4
    sanitized = os.environ.get("E2E_SANITIZED") == "1"
    d = Daemon(**DAEMON_SETTINGS)
    until(lambda: len(d.family()) == 3, "two workers")
    fuzzer = Fuzzer(d, seed)
    start = time.monotonic()
    warm = max(count // 5, 1)
    fuzzer.burst(0, warm, threads)
    before = measure(d) if not fuzzer.failure else None
    if not fuzzer.failure:
        fuzzer.burst(warm, count, threads)
    seconds = time.monotonic() - start
    problems = [fuzzer.failure] if fuzzer.failure else []
    if d.process.poll() is not None:
        problems.append("the daemon has ended")
    else:
        after = measure(d)
        drawn = d.metric("views_drawn_total")
        print("%d requests in %.1f s, %d drawn, statuses %s" % (count, seconds, drawn, dict(sorted(fuzzer.counts.items()))))
        print("warm %s\nend  %s" % (before, after))
        for name in ("workers_died_total", "workers_killed_total", "scene_deaths_total", "views_refused_total"):
            if d.metric(name):
                problems.append("%s is %g" % (name, d.metric(name)))
        if drawn < count / 5:
            problems.append("only %d of %d reached drawing" % (drawn, count))
        if before and after["descriptors"] > before["descriptors"] + 8:  # kept slabs are descriptors, too
            problems.append("descriptors grew")
        if before and after["rss_kb"] > before["rss_kb"] + (65536 if sanitized else 8192):
            problems.append("memory grew")
        if before and not sanitized and max(after["worker_kb"]) > max(before["worker_kb"]) + 32768:
            problems.append("a worker's memory grew")
    log = d.log_text()
    status = d.stop()
    if status != 0:
        problems.append("the daemon ended with status %d\n%s" % (status, log[-4000:]))
    for text in problems:
        print("FAILED (seed %s): %s" % (seed, text))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
