"""harness.py - starts the real daemon on a free port, speaks HTTP to it, and looks at its processes.

Which programs: environment E2E_DAEMON and E2E_SCENE_PROGRAM (silvista-scene, or fake-scene, which draws
nothing). Moments are chosen by hook files (server/scene/hooks.h), never by sleeping: `until` waits for what is to be
seen, and fails after a time that no healthy run needs.
"""
import atexit
import contextlib
import functools
import http.client
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
import unittest

DAEMON = os.environ["E2E_DAEMON"]
PROGRAM = os.environ["E2E_SCENE_PROGRAM"]
FAKE = os.path.basename(PROGRAM).startswith("fake")
FULL = os.environ.get("SV_TEST_FULL") == "1"
PATIENCE_S = float(os.environ.get("E2E_PATIENCE_S", "60"))
# The sanitizer keeps freed memory back, 256 MiB of it by default, which would hide whether ours grows.
SANITIZER = {"ASAN_OPTIONS": "quarantine_size_mb=8"} if os.environ.get("E2E_SANITIZED") == "1" else {}
SCENE = {
    "name": "e2e",
    "terrain": {"procedural": {"size_m": 400, "samples": 65, "relief_m": 10, "seed": 1}},
}
TOKEN = "a token for tests"


# What the daemon does whatever draws: with fake-scene, which starts ten times as fast, and with --full.
daemon_alone = unittest.skipUnless(FAKE or FULL, "the daemon alone: with fake-scene")


def until(condition, what):
    """Waits until condition() is true; returns its value."""
    end = time.monotonic() + PATIENCE_S
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError("not within %g s: %s" % (PATIENCE_S, what))
        time.sleep(0.005)


def alive(pid):
    """Is there a process of that id that is not a zombie?"""
    try:
        with open("/proc/%d/stat" % pid) as f:
            return f.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def children(pid):
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            with contextlib.suppress(OSError, IndexError):
                with open("/proc/%s/stat" % entry) as f:
                    fields = f.read().rpartition(")")[2].split()
                if int(fields[1]) == pid and fields[0] != "Z":
                    found.append(int(entry))
    return sorted(found)


def environment():
    """Ours without settings of the daemon's, and with hooks allowed."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("SILVISTA_")}
    return dict(kept, SILVISTA_TEST_HOOKS="1", **SANITIZER)


@functools.cache
def bakes():
    """A folder for cache_dir of tests that do not ask what is built when: a tree is baked once for all that use it. The one
    that SILVISTA_CACHE_DIR names, or one of this run."""
    folder = os.environ.get("SILVISTA_CACHE_DIR")
    if not folder:
        folder = tempfile.mkdtemp(prefix="silvista-e2e-bakes-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


class Answer:
    def __init__(self, response, body):
        self.status = response.status
        self.headers = response.headers
        self.body = body

    def problem(self):
        assert self.headers["Content-Type"] == "application/problem+json", self.headers
        document = json.loads(self.body)
        assert document["status"] == self.status, document
        return document


class Daemon:
    """A running silvistad with a folder of its own. settings: keys of the configuration."""

    def __init__(self, scene=None, wait_ready=True, hold_load=False, **settings):
        self.folder = tempfile.mkdtemp(prefix="silvista-e2e-")
        self.scene_path = os.path.join(self.folder, "scene.json")
        self.hooks = os.path.join(self.folder, "hooks")
        os.mkdir(self.hooks)
        self.write_scene(SCENE if scene is None else scene)
        if hold_load:
            self.hook("hold-load")
        keys = {
            "scene": self.scene_path,
            "listen": "127.0.0.1:0",
            "scene_program": PROGRAM,
            "cache_dir": os.path.join(self.folder, "cache"),
            "test_hooks_dir": self.hooks,
            "admin_token": TOKEN,
            "workers": 2,
            "log_level": "debug",
            "refine_samples": 0,  # pictures stay as they are
        }
        keys.update(settings)
        command = [DAEMON] + ["--%s=%s" % (k.replace("_", "-"), v) for k, v in keys.items()]
        self.log_path = os.path.join(self.folder, "log")
        self.log = open(self.log_path, "wb")
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=self.log, env=environment()
        )
        line = self.process.stdout.readline().decode()
        match = re.fullmatch(r"listening on https?://127\.0\.0\.1:(\d+)\n", line)
        self.port = int(match.group(1)) if match else None
        if wait_ready:
            assert self.port, self.log_text()
            until(lambda: self.get("/readyz").status == 200, "ready\n" + self.log_text())

    def write_scene(self, scene):
        with open(self.scene_path, "w") as f:
            f.write(scene if isinstance(scene, str) else json.dumps(scene))

    def log_text(self):
        with open(self.log_path, errors="replace") as f:
            return f.read()

    # ---- hooks ----
    def hook(self, name, text=""):
        path = os.path.join(self.hooks, name)
        with open(path + ".new", "w") as f:
            f.write(text)
        os.rename(path + ".new", path)

    def unhook(self, name):
        os.unlink(os.path.join(self.hooks, name))

    def held(self):
        """Workers that wait before drawing."""
        pids = [int(n[5:]) for n in os.listdir(self.hooks) if n.startswith("held-")]
        return [p for p in pids if alive(p)]

    def until_held(self, count=1):
        def enough():
            held = self.held()
            return held if len(held) >= count else None

        return until(enough, "%d workers held" % count)

    def until_others_held(self, but, what):
        return until(lambda: [pid for pid in self.held() if pid not in but], what)

    # ---- HTTP ----
    def request(self, method, target, body=None, headers=None, timeout=PATIENCE_S):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        try:
            connection.request(method, target, body, headers or {})
            response = connection.getresponse()
            return Answer(response, response.read())
        finally:
            connection.close()

    def get(self, target, **headers):
        return self.request("GET", target, headers={k.replace("_", "-"): v for k, v in headers.items()})

    def view(self, width=64, x=100, **headers):
        return self.get(view_target(width, x), **headers)

    def background(self, call, *args, **kwargs):
        return Background(call, *args, **kwargs)

    def connect(self):
        s = socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE_S)
        return s

    def raw(self, data):
        """Sends bytes, reads until the daemon closes; what came."""
        with self.connect() as s:
            s.sendall(data)
            return read_all(s)

    def reload(self):
        return self.request("POST", "/v1/scene/reload", headers={"Authorization": "Bearer " + TOKEN})

    def metric(self, name):
        text = self.get("/metrics").body.decode()
        match = re.search(r"^silvista_%s(?:\{[^}]*\})? (\S+)$" % re.escape(name), text, re.M)
        assert match, name
        return float(match.group(1))

    # ---- processes ----
    def scene_pids(self):
        return children(self.process.pid)

    def scene_pid(self):
        return until(lambda: len(self.scene_pids()) == 1 and self.scene_pids(), "one scene process")[0]

    def worker_pids(self):
        return [w for s in self.scene_pids() for w in children(s)]

    def family(self):
        return self.scene_pids() + self.worker_pids()

    def stop(self):
        """SIGTERM; the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        status = self.process.wait(PATIENCE_S)
        self.close()
        return status

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()
        self.log.close()
        shutil.rmtree(self.folder, ignore_errors=True)


class Background(threading.Thread):
    """A call in a thread; result() waits for it."""

    def __init__(self, call, *args, **kwargs):
        super().__init__(daemon=True)
        self.call, self.args, self.kwargs = call, args, kwargs
        self.value = self.error = None
        self.start()

    def run(self):
        try:
            self.value = self.call(*self.args, **self.kwargs)
        except Exception as e:  # handed to whoever asks for the result
            self.error = e

    def result(self):
        self.join(PATIENCE_S)
        assert not self.is_alive(), "no answer"
        if self.error:
            raise self.error
        return self.value


def view_target(width=64, x=100):
    return "/v1/view?x=%g&y=100&agl=10&width=%d&height=64&format=png" % (x, width)


def read_all(s):
    data = b""
    while True:
        try:
            more = s.recv(65536)
        except ConnectionResetError:
            return data
        if not more:
            return data
        data += more


def end(daemon):
    """Kills the daemon; checks that none of its processes is left behind."""
    with contextlib.suppress(OSError):
        family = daemon.family()
        daemon.close()
        until(lambda: not any(alive(p) for p in family), "no orphans")


class Case(unittest.TestCase):
    """Starts daemons: one a test, or one for all tests of the class that leave it as it was."""

    settings = {}
    shared = None

    @classmethod
    def tearDownClass(cls):
        if cls.shared:
            end(cls.shared)

    def setUp(self):
        self.daemons = []

    def share(self):
        """The daemon of the class's tests that only ask: what has been counted before is not theirs alone."""
        cls = type(self)
        if not cls.shared:
            cls.shared = Daemon(**self.settings)
        return cls.shared

    def start(self, **settings):
        daemon = Daemon(**{**self.settings, **settings})
        self.daemons.append(daemon)
        return daemon

    def tearDown(self):
        failed = self._outcome and not self._outcome.success
        for daemon in self.daemons + ([self.shared] if failed and self.shared else []):
            if failed:
                print(daemon.log_text()[-6000:])
        for daemon in self.daemons:
            end(daemon)
