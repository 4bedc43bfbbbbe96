"""A picture that two workers draw, a band of rows each: it is that of one worker, whatever happens to the bands."""
import json
import os
import signal
import unittest

from harness import FAKE, SCENE, TOKEN, Case, alive, bakes, daemon_alone, until, view_target

WOOD = dict(
    SCENE,
    species=[{"name": "spruce", "procedural": {"habit": "conifer", "leaves": 400, "seed": 1}}],
    forest=[{"scatter": {"count": 300, "seed": 1, "height_m": [6, 12], "min_spacing_m": 3}}],
    relief={"distance_m": 50, "resolution": 256},
)
# As large as is worth two workers (64 rows).
WIDTH = 300


def wood(width=200, height=160, **more):
    keys = dict(x=200, y=150, agl=9, pitch=-8, width=width, height=height, format="png")
    keys.update(more)
    return "/v1/view?" + "&".join("%s=%s" % k for k in keys.items())


class Bands(Case):
    def both_idle(self, d):
        until(lambda: d.metric("workers") == 2, "two workers")
        return d

    def split(self, d, target=None, **headers):
        """Asks for a view; two workers are held before they draw it."""
        d.hook("hold", str(WIDTH))
        answer = d.background(d.get, target or view_target(WIDTH), **headers)
        d.until_held(2)
        return answer

    def by_one(self, target=None):
        return self.start(workers=1).get(target or view_target(WIDTH))

    def check(self, d, answer, expected=None):
        """The picture of one worker; and the daemon draws on with two."""
        self.assertEqual(answer.status, 200, answer.body)
        self.assertEqual(answer.body, (expected or self.by_one()).body)
        self.both_idle(d)
        self.assertEqual(d.view(WIDTH, x=110).status, 200)

    def test_two_workers_draw_the_picture_of_one(self):
        d = self.both_idle(self.start())
        answer = self.split(d)
        d.unhook("hold")
        self.check(d, answer.result())
        self.assertEqual(d.metric("views_drawn_total"), 2)

    @daemon_alone
    def test_what_is_small_is_not_split(self):
        d = self.both_idle(self.start())
        d.hook("hold", "64")
        small = d.background(d.view, 64)
        d.until_held()
        other = d.background(d.view, 64, x=101)
        d.until_held(2)
        d.unhook("hold")
        self.assertEqual([small.result().status, other.result().status], [200, 200])

    @daemon_alone
    def test_a_view_that_waits_goes_first(self):
        d = self.both_idle(self.start())
        d.hook("hold", "64 %d" % WIDTH)
        small = d.background(d.view, 64)
        d.until_held()
        large = [d.background(d.view, WIDTH, x=100 + k) for k in range(2)]
        d.until_held(2)
        until(lambda: d.metric("queue_length") == 1, "the other waits")
        d.unhook("hold")
        self.assertEqual([a.result().status for a in [small] + large], [200] * 3)
        self.assertEqual(d.metric("views_drawn_total"), 3)

    def test_kill_in_a_band_still_gives_the_picture(self):
        for band in range(2):
            d = self.both_idle(self.start())
            d.hook("hold", "%d/%d" % (WIDTH, band))
            answer = d.background(d.view, WIDTH)
            victim = d.until_held()[0]
            os.kill(victim, signal.SIGKILL)
            fresh = d.until_others_held([victim], "a fresh worker has the band")
            self.assertEqual(len(fresh), 1)
            d.unhook("hold")
            self.check(d, answer.result())
            self.assertEqual(d.metric("workers_died_total"), 1)
            self.assertEqual(d.metric("views_drawn_total"), 2)

    @daemon_alone
    def test_kill_of_the_band_that_is_drawn_while_the_other_is(self):
        d = self.both_idle(self.start())
        answer = self.split(d)
        os.kill(d.held()[0], signal.SIGKILL)
        until(lambda: d.metric("workers_died_total") == 1, "its death is known")
        d.unhook("hold")
        self.check(d, answer.result())

    def test_kill_of_the_one_that_encodes(self):
        d = self.both_idle(self.start())
        d.hook("crash-encode", str(WIDTH))
        self.check(d, d.view(WIDTH))
        self.assertEqual(d.metric("workers_died_total"), 1)

    @daemon_alone
    def test_a_band_that_kills_two_workers_kills_no_third(self):
        for listed in ["%d/1" % WIDTH, str(WIDTH)]:  # one band twice, or both at once
            d = self.both_idle(self.start())
            d.hook("crash", listed)
            answer = d.view(WIDTH)
            self.assertEqual(answer.status, 500)
            self.assertEqual(answer.problem()["type"], "urn:silvista:problem:view-kills-workers")
            self.assertEqual(d.view(WIDTH).status, 500)
            self.assertEqual(d.metric("workers_died_total"), 2)
            d.unhook("crash")
            self.both_idle(d)
            self.assertEqual(d.view(WIDTH, x=110).status, 200)

    @daemon_alone
    def test_deadline_in_one_band_gives_up_both(self):
        d = self.both_idle(self.start())
        d.hook("hold", "%d/1" % WIDTH)
        answer = d.view(WIDTH, Prefer="wait=1")
        self.assertEqual(answer.status, 504)
        self.assertEqual(answer.problem()["type"], "urn:silvista:problem:deadline-passed")
        self.assertEqual(d.metric("workers_killed_total"), 1)
        d.hook("hold", str(WIDTH))
        self.both_idle(d)
        self.assertEqual(d.view(WIDTH, Prefer="wait=1").status, 504)
        self.assertEqual(d.metric("workers_killed_total"), 3)
        self.assertEqual(d.metric("workers_died_total"), 0)
        d.unhook("hold")
        self.check(d, d.view(WIDTH))

    def held_and_left(self):
        """A daemon whose two workers hold the bands of a view that its client no longer waits for."""
        d = self.both_idle(self.start())
        d.hook("hold", str(WIDTH))
        with d.connect() as s:
            s.sendall(("GET %s HTTP/1.1\r\nHost: x\r\n\r\n" % view_target(WIDTH)).encode())
            d.until_held(2)
        until(lambda: d.metric("clients_gone_total") == 1, "its leaving is noticed")
        return d

    @daemon_alone
    def test_client_gone_lets_both_finish(self):
        d = self.held_and_left()
        d.unhook("hold")
        until(lambda: d.metric("views_drawn_total") == 1, "drawn for whoever asks next")
        answer = d.view(WIDTH)
        self.assertIn("hit", answer.headers["Cache-Status"])
        self.check(d, answer)

    @daemon_alone
    def test_client_gone_and_a_death_start_nothing_anew(self):
        d = self.held_and_left()
        os.kill(d.held()[0], signal.SIGKILL)
        until(lambda: d.metric("workers_died_total") == 1, "its death is known")
        d.unhook("hold")
        self.check(d, d.view(WIDTH))

    @daemon_alone
    def test_a_scene_that_dies_under_both(self):
        d = self.both_idle(self.start())
        answer = self.split(d)
        workers = d.worker_pids()
        d.hook("hold-load")
        os.kill(d.scene_pid(), signal.SIGKILL)
        until(lambda: not any(alive(p) for p in workers), "no orphan")
        d.unhook("hold")
        d.unhook("hold-load")
        self.check(d, answer.result())

    def test_a_scene_that_is_exchanged_meanwhile(self):
        changed = dict(SCENE, name="changed")
        d = self.both_idle(self.start())
        answer = self.split(d)
        d.write_scene(changed)
        self.assertEqual(d.reload().status, 200)
        d.unhook("hold")
        self.check(d, answer.result())  # of the scene that it was begun with

    @daemon_alone
    def test_a_death_while_the_scene_is_exchanged(self):
        changed = dict(SCENE, name="changed")
        d = self.both_idle(self.start())
        answer = self.split(d)
        d.write_scene(changed)
        self.assertEqual(d.reload().status, 200)
        os.kill(d.held()[0], signal.SIGKILL)
        until(lambda: d.metric("workers_died_total") == 1, "its death is known")
        d.unhook("hold")
        expected = self.start(workers=1, scene=changed).view(WIDTH)
        self.check(d, answer.result(), expected)  # begun again with the new one

    def test_a_patch_in_between(self):
        d = self.both_idle(self.start())
        answer = self.split(d)
        body = json.dumps({"sun": {"azimuth_deg": 200}})
        headers = {"Authorization": "Bearer " + TOKEN, "Content-Type": "application/json"}
        self.assertEqual(d.request("PATCH", "/v1/scene", body, headers).status, 200)
        d.unhook("hold")
        self.check(d, answer.result())

    @daemon_alone
    def test_a_picture_for_which_there_is_no_room_twice_is_not_split(self):
        d = self.both_idle(self.start(slab_budget_mb=16))
        answer = d.get("/v1/view?x=100&y=100&agl=10&width=1024&height=1024&format=png")
        self.assertEqual(answer.status, 200, answer.body)

    @daemon_alone
    def test_sigterm_drains_both(self):
        d = self.both_idle(self.start())
        answer = self.split(d)
        family = d.family()
        d.process.send_signal(signal.SIGTERM)
        until(lambda: "drain" in d.log_text(), "it drains")
        d.unhook("hold")
        self.assertEqual(answer.result().status, 200)
        self.assertEqual(d.process.wait(60), 0)
        until(lambda: not any(alive(p) for p in family), "no orphan")


@unittest.skipIf(FAKE, "draws nothing")
class Pictures(Case):
    """Byte for byte those of one worker, in every way of drawing."""

    settings = {"scene": WOOD, "cache_dir": bakes(), "picture_cache_mb": 0}
    TARGETS = [
        wood(relief="off"),
        wood(relief="on"),
        wood(relief="off", height=161, agl=1.7, pitch=4),
        wood(relief="on", height=161, agl=1.7, pitch=4),
        wood(relief="off", samples=4),
        wood(relief="off", sky="off"),
        wood(relief="on", sky="off", pitch=10),
        wood(relief="off", trees="coarse"),
        wood(trees="raycast"),
        wood(format="exr", layer="color,depth,normal,id", relief="off"),
        wood(format="exr", layer="depth,id", trees="raycast"),
        wood(projection="orthographic", ortho_height=60, pitch=-60, relief="off"),
    ]

    def test_two_workers_draw_the_pictures_of_one(self):
        one, two = self.start(workers=1), self.start()
        until(lambda: two.metric("workers") == 2, "two workers")
        for target in self.TARGETS:
            two.hook("hold", "200")
            answer = two.background(two.get, target)
            two.until_held(2)  # both draw it
            two.unhook("hold")
            until(lambda: not two.held(), "they go on")
            answer = answer.result()
            self.assertEqual(answer.status, 200, answer.body)
            self.assertEqual(answer.body, one.get(target).body, target)

    def test_ways_that_stay_whole(self):
        d = self.start()
        until(lambda: d.metric("workers") == 2, "two workers")
        for more in [dict(relief="paper"), dict(trees="polygon", relief="off")]:
            d.hook("hold", "200 201")
            first = d.background(d.get, wood(**more))
            d.until_held(1)
            second = d.background(d.get, wood(width=201, **more))
            d.until_held(2)  # a worker is left for another view
            d.unhook("hold")
            self.assertEqual([first.result().status, second.result().status], [200, 200])
            until(lambda: not d.held(), "they go on")

    def test_bands_agree_on_the_rings(self):
        """relief=auto: both halves are of one way of drawing, whichever that is."""
        d, one = self.start(), self.start(workers=1)
        until(lambda: d.metric("workers") == 2, "two workers")
        ways = {one.get(wood(relief=relief)).body for relief in ["off", "on"]}
        for _ in range(12):
            answer = d.get(wood(relief="auto"))
            self.assertEqual(answer.status, 200)
            kind = answer.headers["Silvista-Cell"].split(";")[0]
            if kind not in ("hit", "built"):
                self.assertIn(answer.body, ways)


if __name__ == "__main__":
    unittest.main(verbosity=2)
