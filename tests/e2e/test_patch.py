"""PATCH /v1/scene against the real daemon: what is asked for shows at once, what is wrong changes nothing."""
import json
import os
import signal
import unittest

from harness import FAKE, TOKEN, Case, bakes, until

WOOD = {
    "name": "wood",
    "terrain": {"procedural": {"size_m": 300, "samples": 33, "relief_m": 8, "seed": 1}},
    "species": [{"name": "oak", "procedural": {"habit": "broadleaf", "leaves": 200}}],
    "forest": [{"scatter": {"count": 60, "seed": 1}}],
}
VIEW = "/v1/view?x=150&y=120&agl=6&heading=0&pitch=-10&width=96&height=96&format=png"
TREE = {"x": 150, "y": 140, "species": "oak", "height_m": 7}
JSON = {"Content-Type": "application/json"}


def patch(daemon, body, token="Bearer " + TOKEN, **fields):
    text = json.dumps(body) if isinstance(body, dict) else body
    return daemon.request("PATCH", "/v1/scene", text, dict(JSON, Authorization=token, **fields))


class Rules(Case):
    """Whatever draws."""

    def test_needs_the_token(self):
        d = self.share()
        for token in ["", "Bearer wrong", "Basic x"]:
            self.assertEqual(patch(d, {"sun": {"azimuth_deg": 1}}, token).status, 401, token)
        none = self.start(admin_token="")
        self.assertEqual(patch(none, {"sun": {"azimuth_deg": 1}}).status, 403)

    def test_needs_a_json_body(self):
        d = self.share()
        self.assertEqual(patch(d, "x", **{"Content-Type": "text/plain"}).status, 415)
        self.assertEqual(patch(d, " " * 100000).status, 413)
        self.assertEqual(patch(d, "{").status, 400)

    def test_a_refused_patch_changes_nothing(self):
        d = self.share()
        before = d.get("/v1/scene").body
        pid = d.scene_pid()
        self.assertEqual(patch(d, "[]").status, 400)
        self.assertEqual(d.get("/v1/scene").body, before)
        self.assertEqual(d.scene_pid(), pid)
        self.assertEqual(d.get("/readyz").status, 200)
        self.assertEqual(d.view(64).status, 200)

    def test_the_successor_takes_the_place(self):
        d = self.start()
        first = d.scene_pid()
        answer = patch(d, {"sun": {"azimuth_deg": 200}})
        self.assertEqual(answer.status, 200, answer.body)
        until(lambda: d.scene_pids() and first not in d.scene_pids(), "the old scene process is gone")
        self.assertEqual(d.view(64).status, 200)
        # and can be followed itself, and dies with the daemon
        answer = patch(d, {"sun": {"azimuth_deg": 201}})
        self.assertEqual(answer.status, 200, answer.body)
        self.assertEqual(d.view(64).status, 200)
        family = d.family()
        os.kill(d.process.pid, signal.SIGKILL)
        d.process.wait()
        until(lambda: not any(os.path.exists("/proc/%d" % p) for p in family), "all processes are gone")

    def test_death_of_the_successor_loads_again(self):
        d = self.start()
        version = d.get("/v1/scene").body
        self.assertEqual(patch(d, {"sun": {"azimuth_deg": 200}}).status, 200)
        self.assertNotEqual(d.get("/v1/scene").body, version)
        successor = until(lambda: len(d.scene_pids()) == 1 and d.scene_pids()[0], "one scene process")
        os.kill(successor, signal.SIGKILL)
        until(lambda: not os.path.exists("/proc/%d" % successor), "the dead one is reaped")
        until(lambda: d.get("/readyz").status == 200, "a scene again")
        told = [json.loads(b)["version"] for b in (version, d.get("/v1/scene").body)]
        self.assertEqual(told[0], told[1])
        self.assertEqual(d.view(64).status, 200)


@unittest.skipUnless(FAKE, "the fake backend dies when it is told to")
class Deaths(Case):
    def test_a_patch_that_crashes_leaves_the_old_scene(self):
        d = self.start()
        before = d.get("/v1/scene").body
        self.assertEqual(patch(d, {"die": 1}).status, 500)
        self.assertEqual(d.get("/v1/scene").body, before)
        self.assertEqual(d.view(64).status, 200)
        self.assertEqual(patch(d, {"outside": 1}).status, 422)
        self.assertEqual(patch(d, {"good": 1}).status, 200)


@unittest.skipIf(FAKE, "the fake backend draws nothing")
class Pictures(Case):
    settings = {"scene": WOOD, "cache_dir": bakes()}

    def test_a_tree_comes_and_goes(self):
        d = self.start()
        bare = d.get(VIEW)
        answer = patch(d, {"trees": {"add": [TREE]}})
        self.assertEqual(answer.status, 200, answer.body)
        told = json.loads(answer.body)
        self.assertEqual((told["trees"]["added"], told["trees"]["removed"], told["sun"]), (1, 0, False))
        self.assertEqual(json.loads(d.get("/v1/scene").body)["version"], told["version"])
        self.assertEqual(json.loads(d.get("/v1/scene").body)["trees"]["count"], 61)
        grown = d.get(VIEW)
        self.assertTrue(grown.body != bare.body)
        self.assertNotEqual(grown.headers["ETag"], bare.headers["ETag"])
        # its shadow, straight down, on ground that its crown does not cover: the sun stands in the south-east
        shade = ("/v1/view?target_x=145.5&target_y=144.5&target_agl=0&range=40&pitch=-90&projection=orthographic"
                 "&ortho_height=2&width=64&height=64&format=png")
        shaded = d.get(shade)
        answer = patch(d, {"trees": {"remove": {"ids": [told["trees"]["first_id"]]}}})
        self.assertEqual(answer.status, 200, answer.body)
        again = d.get(VIEW)
        self.assertTrue(again.body == bare.body)
        self.assertEqual(again.headers["ETag"], bare.headers["ETag"])
        self.assertTrue(d.get(shade).body != shaded.body)

    def test_every_bad_field_is_named(self):
        d = self.start()
        answer = patch(d, {
            "sun": {"azimuth_deg": 999},
            "trees": {"add": [{"x": 1, "species": "elm", "height_m": -1}], "remove": {"ids": [1]}},
            "bogus": 1,
        })
        self.assertEqual(answer.status, 400)
        fields = sorted(e["field"] for e in answer.problem()["errors"])
        self.assertEqual(fields, ["bogus", "sun.azimuth_deg", "trees.add[0]", "trees.add[0].height_m",
                                  "trees.add[0].species", "trees.remove.ids[0]"])
        answer = patch(d, {"trees": {"add": [dict(TREE, x=-1), TREE, dict(TREE, y=301)],
                                     "remove": {"ids": [4294967295]}}})
        self.assertEqual(answer.status, 422)
        fields = sorted(e["field"] for e in answer.problem()["errors"])
        self.assertEqual(fields, ["trees.add[0]", "trees.add[2]", "trees.remove.ids[0]"])

    def test_the_sun_is_as_loaded(self):
        d = self.start()
        self.assertEqual(patch(d, {"sun": {"azimuth_deg": 250, "elevation_deg": 20}}).status, 200)
        patched = d.get(VIEW).body
        d.write_scene(dict(WOOD, sun={"azimuth_deg": 250, "elevation_deg": 20}))
        self.assertEqual(d.reload().status, 200)
        self.assertTrue(d.get(VIEW).body == patched)


if __name__ == "__main__":
    unittest.main()
