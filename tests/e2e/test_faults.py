"""What dies, stalls or overflows, and what clients see of it."""
import os
import signal
import subprocess
import time
import unittest

from harness import DAEMON, PROGRAM, SCENE, Case, alive, daemon_alone, environment, until, view_target


class Workers(Case):
    def test_kill_in_mid_view_still_gives_the_picture(self):
        d = self.start()
        d.hook("hold", "77")
        answer = d.background(d.view, 77)
        victim = d.until_held()[0]
        os.kill(victim, signal.SIGKILL)
        d.until_others_held([victim], "a fresh worker has the view")
        d.unhook("hold")
        self.assertEqual(answer.result().status, 200)
        self.assertGreater(len(answer.result().body), 64)
        self.assertEqual(d.metric("workers_died_total"), 1)
        self.assertEqual(d.metric("views_drawn_total"), 1)

    def test_a_view_that_kills_two_workers_kills_no_third(self):
        d = self.start()
        d.hook("crash", "78")
        answer = d.view(78)
        self.assertEqual(answer.status, 500)
        self.assertEqual(answer.problem()["type"], "urn:silvista:problem:view-kills-workers")
        self.assertEqual(d.metric("workers_died_total"), 2)
        self.assertEqual(d.view(78).status, 500)
        self.assertEqual(d.metric("workers_died_total"), 2)
        self.assertEqual(d.metric("views_refused_total"), 1)
        self.assertEqual(d.view(64).status, 200)
        until(lambda: d.metric("workers") == 2, "both workers replaced")

    @daemon_alone
    def test_deadline_is_504_and_kills_the_worker(self):
        d = self.start()
        d.hook("hold", "79")
        answer = d.view(79, Prefer="wait=1")
        self.assertEqual(answer.status, 504)
        self.assertEqual(answer.problem()["type"], "urn:silvista:problem:deadline-passed")
        self.assertEqual(d.metric("workers_killed_total"), 1)
        self.assertEqual(d.metric("workers_died_total"), 0)
        self.assertEqual(d.metric("views_drawn_total"), 0)
        d.unhook("hold")
        self.assertEqual(d.view(79).status, 200)

    @daemon_alone
    def test_prefer_wait_sets_the_deadline(self):
        d = self.start(deadline_max_ms=400, deadline_ms=200)
        d.hook("hold", "79")
        start = time.monotonic()
        answer = d.view(79, Prefer="respond-async, wait=100")
        self.assertEqual(answer.status, 504)
        self.assertGreaterEqual(time.monotonic() - start, 0.4)
        self.assertIn("Preference-Applied", answer.headers)

    def test_worker_retires_after_its_views(self):
        d = self.start(workers=1, worker_max_views=3)
        first = until(d.worker_pids, "a worker")
        for i in range(7):
            self.assertEqual(d.view(64, x=100 + i).status, 200)
        self.assertEqual(d.metric("workers_retired_total"), 2)
        self.assertNotEqual(until(d.worker_pids, "a worker"), first)
        self.assertEqual(d.metric("workers_died_total"), 0)


@daemon_alone
class Queue(Case):
    settings = {"workers": 1, "queue_limit": 2}

    def test_full_queue_is_503_with_retry_after(self):
        d = self.start()
        d.hook("hold", "all")
        running = d.background(d.view, 70)
        d.until_held()
        waiting = [d.background(d.view, 71 + i) for i in range(2)]
        until(lambda: d.metric("queue_length") == 2, "two jobs wait")
        self.assertEqual(d.get("/readyz").status, 503)
        refused = d.view(75)
        self.assertEqual(refused.status, 503)
        self.assertGreaterEqual(int(refused.headers["Retry-After"]), 1)
        self.assertEqual(refused.problem()["type"], "urn:silvista:problem:overloaded")
        d.unhook("hold")
        self.assertEqual([running.result().status] + [w.result().status for w in waiting], [200] * 3)

    def test_identical_views_are_drawn_once(self):
        d = self.start()
        d.hook("hold", "70")
        twins = [d.background(d.view, 70)]
        d.until_held()
        twins += [d.background(d.view, 70) for _ in range(3)]
        until(lambda: d.metric("views_collapsed_total") == 3, "three joined")
        d.unhook("hold")
        answers = [t.result() for t in twins]
        self.assertEqual({a.status for a in answers}, {200})
        self.assertEqual(len({a.body for a in answers}), 1)
        self.assertEqual(len({a.headers["ETag"] for a in answers}), 1)
        self.assertEqual(sum("collapsed" in a.headers["Cache-Status"] for a in answers), 3)
        self.assertEqual(d.metric("views_drawn_total"), 1)

    def test_client_gone_while_queued_is_never_started(self):
        d = self.start()
        d.hook("hold", "70")
        running = d.background(d.view, 70)
        d.until_held()
        with d.connect() as s:
            s.sendall(("GET %s HTTP/1.1\r\nHost: x\r\n\r\n" % view_target(71)).encode())
            until(lambda: d.metric("queue_length") == 1, "queued")
        until(lambda: d.metric("clients_gone_total") == 1, "its leaving is noticed")
        self.assertEqual(d.metric("queue_length"), 0)
        self.assertEqual(d.metric("jobs_never_started_total"), 1)
        d.unhook("hold")
        self.assertEqual(running.result().status, 200)
        self.assertEqual(d.metric("views_drawn_total"), 1)

    def test_deadline_in_the_queue_is_never_started(self):
        d = self.start(deadline_ms=60000)
        d.hook("hold", "70")
        running = d.background(d.view, 70)
        d.until_held()
        self.assertEqual(d.view(71, Prefer="wait=0").status, 504)
        self.assertEqual(d.metric("jobs_never_started_total"), 1)
        d.unhook("hold")
        self.assertEqual(running.result().status, 200)
        self.assertEqual(d.metric("workers_killed_total"), 0)


class Scene(Case):
    def test_kill_of_the_scene_process(self):
        d = self.start()
        old = d.scene_pid()
        workers = until(lambda: len(d.worker_pids()) == 2 and d.worker_pids(), "two workers")
        d.hook("hold", "77")
        in_flight = d.background(d.view, 77)
        d.until_held()
        d.hook("hold-load")
        os.kill(old, signal.SIGKILL)
        until(lambda: d.get("/readyz").status == 503, "not ready")
        refused = d.view(64)
        self.assertEqual(refused.status, 503)
        self.assertGreaterEqual(int(refused.headers["Retry-After"]), 1)
        self.assertEqual(d.get("/livez").status, 200)
        until(lambda: not any(alive(p) for p in [old] + workers), "no orphan")
        d.unhook("hold")
        d.unhook("hold-load")
        until(lambda: d.get("/readyz").status == 200, "ready again")
        self.assertEqual(d.view(64).status, 200)
        self.assertEqual(in_flight.result().status, 200, in_flight.result().body)
        self.assertEqual(d.metric("scene_deaths_total"), 1)
        self.assertEqual(d.metric("workers_died_total"), 0)

    def test_reload_of_a_broken_scene_changes_nothing(self):
        d = self.start()
        before = d.view(64)
        d.write_scene({"name": 3, "bogus": 1, "terrain": {"procedural": {"size_m": 400}}})
        answer = d.reload()
        self.assertEqual(answer.status, 422)
        fields = {e["field"] for e in answer.problem()["errors"]}
        self.assertTrue({"name", "bogus"} <= fields, fields)
        after = d.view(64)
        self.assertEqual((after.status, after.body), (200, before.body))
        self.assertIn("hit", after.headers["Cache-Status"])
        d.write_scene("this is no JSON")
        self.assertEqual(d.reload().status, 422)
        self.assertEqual(d.get("/readyz").status, 200)
        self.assertEqual(len(d.scene_pids()), 1)

    def test_reload_of_a_good_scene(self):
        d = self.start()
        before, old = d.get("/v1/scene"), d.scene_pid()
        etag = d.view(64).headers["ETag"]
        d.write_scene(dict(SCENE, name="changed"))
        answer = d.reload()
        self.assertEqual(answer.status, 200)
        after = d.get("/v1/scene")
        self.assertNotEqual(before.headers["ETag"], after.headers["ETag"])
        self.assertIn(b'"changed"', after.body)
        self.assertNotEqual(d.view(64).headers["ETag"], etag)
        until(lambda: not alive(old), "the old scene process has left")
        d.write_scene(dict(SCENE, name="by signal"))
        d.process.send_signal(signal.SIGHUP)
        until(lambda: b'"by signal"' in d.get("/v1/scene").body, "reloaded by SIGHUP")

    def test_a_view_in_flight_survives_a_reload(self):
        d = self.start()
        d.hook("hold", "77")
        in_flight = d.background(d.view, 77)
        d.until_held()
        d.write_scene(dict(SCENE, name="changed"))
        self.assertEqual(d.reload().status, 200)
        d.unhook("hold")
        self.assertEqual(in_flight.result().status, 200)
        until(lambda: len(d.scene_pids()) == 1, "the old scene process has left")

    def test_a_load_that_crashes_leaves_the_old_one(self):
        d = self.start()
        d.hook("hold-load")
        answer = d.background(d.reload)
        old = d.scene_pids()
        loading = until(lambda: [p for p in d.scene_pids() if p not in old or len(d.scene_pids()) == 2], "loading")
        os.kill(max(loading), signal.SIGKILL)
        self.assertEqual(answer.result().status, 500)
        d.unhook("hold-load")
        self.assertEqual(d.view(64).status, 200)
        self.assertEqual(d.reload().status, 200)

    @daemon_alone
    def test_reload_needs_the_token(self):
        d = self.start()
        for token in ["", "Bearer ", "Bearer wrong", "Basic x", "Bearer a token for test", "Bearer a token for tests2"]:
            answer = d.request("POST", "/v1/scene/reload", headers={"Authorization": token})
            self.assertEqual(answer.status, 401, token)
            self.assertIn("Bearer", answer.headers["WWW-Authenticate"])
        none = self.start(admin_token="")
        self.assertEqual(none.reload().status, 403)

    def test_serves_liveness_while_it_loads(self):
        d = self.start(hold_load=True, wait_ready=False)
        self.assertEqual(d.get("/livez").status, 200)
        self.assertEqual(d.get("/readyz").status, 503)
        self.assertEqual(d.get("/v1/scene").status, 503)
        answer = d.view(64)
        self.assertEqual(answer.status, 503)
        self.assertIn("Retry-After", answer.headers)
        d.unhook("hold-load")
        until(lambda: d.get("/readyz").status == 200, "ready")
        self.assertEqual(d.view(64).status, 200)


class Ends(Case):
    def test_bad_scene_at_the_start_ends_the_daemon_with_reasons(self):
        d = self.start(scene={"bogus": 1}, wait_ready=False)
        self.assertEqual(d.process.wait(60), 1)
        self.assertIn('"field":"bogus"', d.log_text())

    @daemon_alone
    def test_restart_right_after_kill(self):
        d = self.start()
        port, family = d.port, until(lambda: len(d.family()) == 3 and d.family(), "three processes")
        with d.connect() as s:  # a connection that the kill leaves behind on that port
            s.sendall(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n")
            self.assertIn(b"200", s.recv(4096))
            d.process.kill()
            d.process.wait()
            again = self.start(listen="127.0.0.1:%d" % port)
            self.assertEqual(again.port, port)
            self.assertEqual(again.view(64).status, 200)
        until(lambda: not any(alive(p) for p in family), "no orphan of the killed one")

    def test_sigterm_drains(self):
        d = self.start()
        d.hook("hold", "77")
        in_flight = d.background(d.view, 77)
        d.until_held()
        family = d.family()
        d.process.send_signal(signal.SIGTERM)

        def refused():
            try:
                d.connect().close()
            except ConnectionRefusedError:
                return True
            return False

        until(refused, "no new connections")
        self.assertIsNone(d.process.poll())
        d.unhook("hold")
        self.assertEqual(in_flight.result().status, 200)
        self.assertEqual(d.process.wait(60), 0)
        until(lambda: not any(alive(p) for p in family), "no orphan")

    @daemon_alone
    def test_drain_ends_at_its_time(self):
        d = self.start(drain_ms=200)
        d.hook("hold", "77")
        in_flight = d.background(d.view, 77)
        d.until_held()
        family = d.family()
        d.process.send_signal(signal.SIGTERM)
        answer = in_flight.result()
        self.assertEqual(answer.status, 503)
        self.assertEqual(answer.problem()["type"], "urn:silvista:problem:draining")
        self.assertEqual(d.process.wait(60), 0)
        until(lambda: not any(alive(p) for p in family), "no orphan")


class Commands(Case):
    def run_daemon(self, *args, **settings):
        return subprocess.run(
            [DAEMON, *args], capture_output=True, text=True, timeout=60, env={**environment(), "SILVISTA_TEST_HOOKS": "0", **settings}
        )

    def test_bad_settings_name_the_key(self):
        for args, key in [
            (["--workers", "x"], "workers"),
            (["--workers", "99999"], "workers"),
            (["--no-such-key", "1"], "no_such_key"),
            (["--log-level", "loud"], "log_level"),
            (["--workers"], "workers"),
            (["--test-hooks-dir", "/tmp"], "test_hooks_dir"),
            (["--scene", "/no/such/file"], "scene"),
            (["--scene", "/dev/null", "--listen", "nonsense", "--scene-program", PROGRAM], "listen"),
            (["--scene", "/dev/null", "--scene-program", "/no/such"], "scene_program"),
        ]:
            result = self.run_daemon(*args)
            self.assertNotEqual(result.returncode, 0, args)
            self.assertIn("silvistad: %s: " % key, result.stderr, args)
        self.assertIn("queue_limit", self.run_daemon(SILVISTA_QUEUE_LIMIT="0").stderr)

    def test_check_and_samples(self):
        self.assertEqual(self.run_daemon("--help").returncode, 0)
        self.assertRegex(self.run_daemon("--version").stdout, r"^silvistad \d")
        good = self.run_daemon("--scene", "/dev/null", "--scene-program", PROGRAM, "--check-config")
        self.assertEqual((good.returncode, good.stderr), (0, ""))
        sample = self.run_daemon("--print-config").stdout
        path = os.path.join(os.path.dirname(__file__), "../../deploy/silvistad.conf")
        with open(path) as f:
            self.assertEqual(f.read(), sample, "deploy/silvistad.conf is not what --print-config prints")

    def test_render_without_a_server(self):
        d = self.start()
        view, out = os.path.join(d.folder, "view.json"), os.path.join(d.folder, "out.png")
        common = ["--scene", d.scene_path, "--scene-program", PROGRAM, "--cache-dir", d.folder + "/cache"]
        with open(view, "w") as f:
            f.write('{"x": 100, "y": 100, "agl": 10, "width": 64, "height": 64, "format": "png"}')
        result = self.run_daemon(*common, "--render", view, "-o", out)
        self.assertEqual((result.returncode, os.path.getsize(out) > 64), (0, True), result.stderr)
        with open(out, "rb") as f:
            self.assertEqual(f.read(), d.view(64).body)
        for given, name, good in [("", "a.PNG", True), ("", "a.gif", False), ("", "plain", True), (', "f": "json"', "a.json", True),
                                  (', "format": "jpeg"', "a.png", False), (', "format": "tiff"', "a.tif", True)]:
            with open(view, "w") as f:
                f.write('{"x": 100, "y": 100, "agl": 10, "width": 64, "height": 64%s}' % given)
            out = os.path.join(d.folder, name)
            result = self.run_daemon(*common, "--render", view, "-o", out)
            self.assertEqual((result.returncode == 0, os.path.exists(out)), (good, good), (name, result.stderr))
            self.assertEqual(name in result.stderr, not good, result.stderr)
        with open(view, "w") as f:
            f.write('{"x": 100, "y": 100, "vfov": 200, "bogus": 1}')
        result = self.run_daemon(*common, "--render", view, "-o", out)
        self.assertEqual(result.returncode, 1)
        self.assertIn("vfov", result.stderr)
        self.assertIn("bogus", result.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
