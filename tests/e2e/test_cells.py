"""Relief cells through the service: built, shared by workers, listed, dropped, built ahead, what a death leaves, and
what a patch of the scene drops."""
import json
import math
import os
import re
import signal
import struct
import unittest
import zlib

from harness import TOKEN, Case, bakes, until

ADMIN = {"Authorization": "Bearer " + TOKEN, "Content-Type": "application/json"}
SCENE = {
    "name": "cells",
    "terrain": {"procedural": {"size_m": 400, "samples": 129, "relief_m": 10, "seed": 4}},
    "species": [{"name": "spruce", "procedural": {"habit": "conifer", "leaves": 400, "seed": 1}}],
    "forest": [
        {"scatter": {"count": 300, "seed": 1, "mix": {"spruce": 1}, "height_m": [6, 12], "min_spacing_m": 3}}
    ],
    "sun": {"azimuth_deg": 135, "elevation_deg": 40},
    "relief": {"distance_m": 50, "resolution": 256},
}


def target(x=200, relief="on", size=128, **more):
    keys = dict(x=x, y=150, agl=16, pitch=-12, width=size, height=size, format="png", relief=relief)
    keys.update(more)
    return "/v1/view?" + "&".join("%s=%s" % (k, v) for k, v in keys.items() if v is not None)


def cell(answer):
    """Silvista-Cell as (kind, id, panels); the latter two None where there are none."""
    match = re.fullmatch(r"(\w+)(?:; id=([0-9a-f]{16}); panels=(\w+))?", answer.headers["Silvista-Cell"])
    assert match, answer.headers["Silvista-Cell"]
    return match.groups()


def pixels(png):
    """Rows of bytes of an 8-bit PNG, by its definition."""
    at, data = 8, b""
    while at < len(png):
        size, kind = struct.unpack(">I4s", png[at : at + 8])
        body = png[at + 8 : at + 8 + size]
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack(">IIBB", body[:10])
            assert depth == 8
            step = {2: 3, 6: 4}[color]
        elif kind == b"IDAT":
            data += body
        at += 12 + size
    raw, rows, last = zlib.decompress(data), [], bytearray(width * step)
    for y in range(height):
        line = bytearray(raw[y * (width * step + 1) + 1 : (y + 1) * (width * step + 1)])
        kind = raw[y * (width * step + 1)]
        for i in range(len(line)):
            a = line[i - step] if i >= step else 0
            b, c = last[i], last[i - step] if i >= step else 0
            p = a + b - c
            paeth = min((a, b, c), key=lambda v: (abs(p - v), (a, b, c).index(v)))
            line[i] = (line[i] + (0, a, b, (a + b) // 2, paeth)[kind]) & 255
        rows.append(bytes(line))
        last = line
    return rows


def mean_difference(a, b):
    flat = [(p, q) for r, s in zip(pixels(a), pixels(b)) for p, q in zip(r, s)]
    return sum(abs(p - q) for p, q in flat) / len(flat)


class Warm(Case):
    # No pictures are remembered: what panels do is what is looked at.
    settings = {"scene": SCENE, "picture_cache_mb": 0, "cache_dir": bakes()}


class Cells(Warm):
    def listed(self, d):
        answer = d.get("/v1/cells")
        self.assertEqual(answer.status, 200)
        return json.loads(answer.body)

    def test_built_hit_dropped_built(self):
        d = self.start()
        first = d.get(target())
        self.assertEqual(first.status, 200)
        kind, name, panels = cell(first)
        self.assertEqual((kind, panels), ("built", "drawn"))
        self.assertIn("relief=on", first.headers["Silvista-Plan"])
        self.assertIn("cell;dur=", first.headers["Server-Timing"])
        second = d.get(target())
        self.assertEqual(cell(second), ("hit", name, "drawn"))
        self.assertEqual(second.body, first.body)
        self.assertEqual(second.headers["ETag"], first.headers["ETag"])
        self.assertTrue(first.headers["ETag"].startswith("W/"))
        self.assertNotIn("cell;dur=", second.headers["Server-Timing"])
        self.assertIn("warp;dur=", second.headers["Server-Timing"])
        listed = self.listed(d)
        self.assertIn(name, [c["id"] for c in listed["cells"]])
        self.assertEqual(sum(len(c["panels"]) for c in listed["cells"]), listed["panels"])
        self.assertEqual(d.metric("cells_builds_total"), listed["panels"])
        self.assertEqual(d.metric("cells_bytes"), listed["used_bytes"])
        self.assertGreaterEqual(d.metric("cells_hits_total"), listed["panels"])
        for c in listed["cells"]:
            self.assertEqual(c["resolution"], 256)
            self.assertGreater(c["region"]["half_axis_m"], 0)
        self.assertEqual(d.request("DELETE", "/v1/cells").status, 401)
        self.assertEqual(self.listed(d)["panels"], listed["panels"])
        self.assertEqual(d.request("DELETE", "/v1/cells", headers=ADMIN).status, 204)
        self.assertEqual(self.listed(d)["cells"], [])
        third = d.get(target())
        self.assertEqual(cell(third), ("built", name, "drawn"))
        self.assertEqual(third.body, first.body)

    def test_panels_show_what_direct_drawing_shows(self):
        d = self.start()
        direct, cells = d.get(target(relief="off")), d.get(target())
        self.assertEqual(cell(direct), ("none", None, None))
        self.assertIn("relief=off", direct.headers["Silvista-Plan"])
        bare = d.get(target(relief="off", trees="none"))
        # Panels of 256 texels are 1.7 times as coarse as the picture; what trees are in it changes far more.
        off = mean_difference(direct.body, cells.body)
        self.assertLess(off, 6)
        self.assertLess(2 * off, mean_difference(direct.body, bare.body))
        self.assertNotEqual(cell(d.get(target(relief_resolution=300)))[1], cell(cells)[1])
        self.assertNotEqual(cell(d.get(target(relief_distance=70)))[1], cell(cells)[1])

    def test_auto_takes_what_is_there(self):
        d = self.start()
        self.assertEqual(cell(d.get(target(relief="auto")))[0], "bypass")
        name = cell(d.get(target()))[1]
        self.assertEqual(cell(d.get(target(relief=None))), ("hit", name, "drawn"))
        self.assertEqual(cell(d.get(target(relief="off")))[0], "none")
        self.assertEqual(cell(d.get(target(relief="auto", samples=4)))[0], "none")
        refused = d.get(target(samples=4))
        self.assertEqual(refused.status, 400)
        self.assertEqual([e["field"] for e in refused.problem()["errors"]], ["relief"])

    def test_pictures_from_memory_tell_their_cell(self):
        d = self.start(picture_cache_mb=16)
        name = cell(d.get(target()))[1]
        again = d.get(target())
        self.assertIn("hit", again.headers["Cache-Status"])
        self.assertEqual(cell(again), ("hit", name, "drawn"))
        self.assertEqual(d.metric("views_drawn_total"), 1)

    def test_one_route_for_one_cell(self):
        d = self.start()
        answers = [d.get(target(x, f="json", format=None)) for x in (200, 200.01, 260)]
        routes = [a.headers["Silvista-Route"] for a in answers]
        self.assertEqual(routes[0], routes[1])
        self.assertNotEqual(routes[0], routes[2])
        self.assertEqual(json.loads(answers[0].body)["plan"]["relief"], "on")

    def test_no_memory_for_cells(self):
        d = self.start(cells_bytes=0)
        self.assertEqual(cell(d.get(target()))[0], "bypass")
        self.assertEqual(self.listed(d)["cells"], [])
        self.assertEqual(d.request("DELETE", "/v1/cells", headers=ADMIN).status, 204)

    def test_built_ahead(self):
        d = self.start()
        body = json.dumps({"views": [dict(x=x, y=150, agl=16, width=64, height=64) for x in (120, 200)]})
        self.assertEqual(d.request("POST", "/v1/cells", body, {"Content-Type": "application/json"}).status, 401)
        answer = d.request("POST", "/v1/cells", body, ADMIN)
        self.assertEqual(answer.status, 202)
        ids = [j["id"] for j in json.loads(answer.body)["jobs"]]
        self.assertEqual(len(set(ids)), 2)
        until(lambda: d.metric("cells_jobs_ahead") == 0, "all is built")
        builds = d.metric("cells_builds_total")
        self.assertGreater(builds, 0)
        for x in (120, 200):
            view = "/v1/view?x=%d&y=150&agl=16&width=64&height=64" % x
            self.assertEqual(cell(d.get(view))[0], "hit")
        self.assertEqual(d.metric("cells_builds_total"), builds)
        wrong = json.dumps({"views": [{"x": 1, "y": 1}, {"x": 1, "y": 1, "layer": "depth"}, {"q": 0}]})
        refused = d.request("POST", "/v1/cells", wrong, ADMIN)
        self.assertEqual(refused.status, 400)
        fields = {e["field"] for e in refused.problem()["errors"]}
        self.assertTrue({"views[1].layer", "views[2].q", "views[2].x"} <= fields, fields)
        self.assertEqual(d.metric("cells_jobs_ahead"), 0)

    def test_built_ahead_of_who_moves(self):
        d = self.start()
        until(lambda: d.metric("workers") == 2, "two workers")
        # Evenly on, each step into another cell: how many steps ahead is asked for depends on how long they take.
        kinds = []
        while kinds[-3:] != ["hit"] * 3 and len(kinds) < 60:
            kinds.append(cell(d.get(target(120 + 2 * len(kinds), size=64)))[0])
            until(lambda: d.metric("cells_jobs_ahead") == 0, "what comes next is built")
        self.assertEqual(kinds[0], "built")
        self.assertEqual(kinds[-3:], ["hit"] * 3, kinds)

    def test_a_worker_killed_while_it_draws(self):
        d = self.start()
        name = cell(d.get(target()))[1]
        self.assertEqual(d.request("DELETE", "/v1/cells", headers=ADMIN).status, 204)
        d.hook("hold", "129")
        answer = d.background(d.get, target(size=129))
        victim = d.until_held()[0]
        os.kill(victim, signal.SIGKILL)
        d.until_others_held([victim], "a fresh worker has the view")
        d.unhook("hold")
        self.assertEqual(answer.result().status, 200)
        self.assertEqual(cell(answer.result())[:2], ("built", name))
        self.assertEqual(cell(d.get(target()))[:2], ("hit", name))

    def test_workers_killed_while_they_build(self):
        """At moments that nobody chose: whatever they were in the middle of, the next one draws the same picture."""
        d = self.start()
        # A view that is lost twice is not drawn again: each time another one, of the same panels.
        views = [target(relief_resolution=512, heading=h) for h in range(4)]
        want = [d.get(v).body for v in views]
        for k in range(3):
            self.assertEqual(d.request("DELETE", "/v1/cells", headers=ADMIN).status, 204)
            before = d.metric("cells_misses_total")
            answer = d.background(d.get, views[k])
            until(lambda b=before: d.metric("cells_misses_total") > b, "it builds")
            for pid in d.worker_pids():
                os.kill(pid, signal.SIGKILL)
            self.assertIn(answer.result().status, (200, 500))
            until(lambda: d.metric("workers") == 2, "workers are replaced")
            listed = self.listed(d)
            self.assertEqual(listed["building"], 0, "what the dead were building is given back")
            self.assertEqual(d.get(views[k + 1]).body, want[k + 1])
        self.assertEqual(d.metric("scene_deaths_total"), 0)

    def test_workers_share_what_they_build(self):
        d = self.start()
        views = [target(heading=h) for h in (0, 5, 10, 15)]
        answers = [d.background(d.get, v) for v in views]
        self.assertEqual([a.result().status for a in answers], [200] * 4)
        self.assertEqual(len({cell(a.result())[1] for a in answers}), 1)
        again = [d.get(v) for v in views]
        self.assertEqual([cell(a)[0] for a in again], ["hit"] * 4)
        self.assertEqual([a.body for a in again], [a.result().body for a in answers])


HUT = "o hut\nv -0.5 0 -0.4\nv 0.5 0 -0.4\nv 0.5 0 0.4\nv -0.5 0 0.4\nv 0 1 0\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 4 3 2 1\n"
AXES = {  # right, up, forward (core/cell/lattice.h)
    "east": ((0, -1, 0), (0, 0, 1), (1, 0, 0)),
    "north": ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "west": ((0, 1, 0), (0, 0, 1), (-1, 0, 0)),
    "south": ((-1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "down": ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    "up": ((1, 0, 0), (0, -1, 0), (0, 0, 1)),
}


class Patched(Warm):
    """PATCH /v1/scene under warm panels. What stands 140 m north of the eyes, in the middle of a ring, is seen on panels
    that look there, whatever their margins are: which ones is worked out here from what /v1/cells tells of them."""

    AT = (200, 200, 12)  # x, y, height of what comes
    MARGIN_M = 12  # no panel is in doubt by so much
    EYES = {"north": 0, "east": 90, "south": 180}  # headings

    settings = dict(Warm.settings, workers=1)  # nothing is built ahead

    def view(self, name):
        return self.d.get(target(y=60, size=96, heading=self.EYES[name]))

    def shade(self):
        """Mean of the nine pixels about a spot on the ground in the middle of what the shadow of AT falls on, from cells."""
        x, y, height = self.AT
        away = 0.5 * height / math.tan(math.radians(SCENE["sun"]["elevation_deg"]))
        turn = math.radians(SCENE["sun"]["azimuth_deg"])
        spot = dict(target_x=x - away * math.sin(turn), target_y=y - away * math.cos(turn), target_agl=0)
        answer = self.d.get(target(y=60, agl=40, pitch=None, size=64, vfov=20, **spot))
        self.assertIn(cell(answer)[0], ("built", "hit"))
        rows = [r[31 * 3 : 34 * 3] for r in pixels(answer.body)[31:34]]
        return sum(sum(r) for r in rows) / 27

    def panels(self):
        """Panels by id: (cell, panel)."""
        listed = json.loads(self.d.get("/v1/cells").body)
        return {p["id"]: (c, p) for c in listed["cells"] for p in c["panels"]}

    def ground_m(self):
        eye = self.d.get(target(self.AT[0], y=self.AT[1], f="json", format=None))
        return json.loads(eye.headers["Silvista-Camera"])["eye"][2] - 16

    def points(self):
        """Of what stands there, and of its shadow down to the lowest ground."""
        x, y, height = self.AT
        ground, sun = self.ground_m(), SCENE["sun"]
        turn, slope = math.radians(sun["azimuth_deg"]), 1 / math.tan(math.radians(sun["elevation_deg"]))
        body = [(x + u, y + v, ground + w) for u in (-2, 2) for v in (-2, 2) for w in (0, height / 2, height)]
        fallen = [(p, f * (p[2] - ground + 10)) for p in body for f in (0, 0.25, 0.5, 0.75, 1)]
        shadow = [(p[0] - h * slope * math.sin(turn), p[1] - h * slope * math.cos(turn), p[2] - h) for p, h in fallen]
        return body, shadow

    def shows(self, c, p, point, margin):
        d = [a - b for a, b in zip(point, c["reference"])]
        right, up, ahead = [sum(a * b for a, b in zip(d, axis)) for axis in AXES[p["face"]]]
        far = max(abs(v) for v in d)
        ground = p["layer"] == "ground"
        beyond = not ground and c["outer_m"] is not None and far > c["outer_m"] + margin
        return ahead >= max(abs(right), abs(up)) - margin and far >= c["distance_m"] - margin and not beyond

    def seeing(self, panels, objects=False):
        """Ids of panels that a tree there, or an object, shows on; asserts that none is in doubt."""
        body, shadow = self.points()

        def of(margin):
            ids = set()
            for name, (c, p) in panels.items():
                crowns = p["layer"] == "crowns"
                # Objects throw no shadow on crowns; the ground's panels show no trees, but their shadows.
                seen = [] if crowns and objects else body + shadow if crowns or objects else shadow
                if any(self.shows(c, p, q, margin) for q in seen):
                    ids.add(name)
            return ids

        self.assertEqual(of(-self.MARGIN_M / 3), of(self.MARGIN_M))
        return of(0)

    def patch(self, body):
        answer = self.d.request("PATCH", "/v1/scene", json.dumps(body), ADMIN)
        self.assertEqual(answer.status, 200, answer.body)
        return json.loads(answer.body)

    def drops(self, body, objects=False):
        """Patches; what goes are exactly the panels that can see it. Returns the answer."""
        before = self.panels()
        told, after = self.patch(body), self.panels()
        gone = self.seeing(before, objects)
        self.assertEqual(set(before) - set(after), gone)
        self.assertEqual(set(after) - set(before), set())
        self.assertTrue({p["layer"] for n, (c, p) in before.items() if n in gone} == {"ground"} | set(
            [] if objects else ["crowns"]))
        self.assertGreater(len(after), len(gone))
        return told

    def as_from_nothing(self):
        """What is drawn now is what is drawn when no panel is left."""
        shown = {name: self.view(name).body for name in self.EYES}
        self.assertEqual(self.d.request("DELETE", "/v1/cells", headers=ADMIN).status, 204)
        for name in self.EYES:
            again = self.view(name)
            self.assertEqual(cell(again)[0], "built")
            self.assertTrue(again.body == shown[name], name)
        return shown

    def test_what_comes_and_goes(self):
        self.d = self.start()
        with open(os.path.join(self.d.folder, "hut.obj"), "w") as f:
            f.write(HUT)
        before = {name: self.view(name).body for name in self.EYES}
        bright = self.shade()

        with self.subTest("a tree comes"):
            x, y, height = self.AT
            told = self.drops({"trees": {"add": [{"x": x, "y": y, "species": "spruce", "height_m": height}]}})
            for name in ("east", "south"):
                self.assertEqual(cell(self.view(name))[0], "hit")
            self.assertEqual(cell(self.view("north"))[0], "built")
            self.assertLess(self.shade(), 0.9 * bright)
            grown = self.as_from_nothing()
            self.assertFalse(grown["north"] == before["north"])
            self.assertTrue(grown["south"] == before["south"])

        with self.subTest("it goes"):
            self.shade()
            self.drops({"trees": {"remove": {"ids": [told["trees"]["first_id"]]}}})
            self.assertEqual({name: self.view(name).body == before[name] for name in before}, dict.fromkeys(before, True))
            self.assertEqual(self.shade(), bright)

        with self.subTest("the sun moves, and back"):
            were = set(self.panels())
            self.patch({"sun": {"azimuth_deg": 200}})
            self.assertEqual(set(self.panels()), were)
            self.assertEqual({cell(self.view(name))[0] for name in before}, {"built"})
            lit = {name: self.view(name).body for name in before}
            self.assertFalse(any(lit[name] == before[name] for name in before))
            self.assertLess(were, set(self.panels()))
            self.patch({"sun": SCENE["sun"]})
            answers = {name: self.view(name) for name in before}
            self.assertEqual({cell(a)[0] for a in answers.values()}, {"hit"})
            self.assertTrue(all(answers[name].body == before[name] for name in before))
            self.patch({"sun": {"azimuth_deg": 200}})
            self.assertTrue(all(self.view(name).body == lit[name] for name in before))
            self.as_from_nothing()
            self.patch({"sun": SCENE["sun"]})

        with self.subTest("an object comes and goes"):
            for name in before:
                self.view(name)
            x, y, height = self.AT
            told = self.drops({"objects": {"add": [{"model": "hut.obj", "x": x, "y": y, "height_m": height}]}}, True)
            built = self.as_from_nothing()
            self.assertFalse(built["north"] == before["north"])
            self.assertTrue(built["south"] == before["south"])
            self.drops({"objects": {"remove": {"ids": [told["objects"]["first_id"]]}}}, True)
            self.assertTrue(all(self.view(name).body == before[name] for name in before))


    def test_a_successor_that_dies_leaves_panels_to_the_old_scene(self):
        self.d = self.start()
        before = self.view("north")
        self.d.hook("crash-patch")
        body = json.dumps({"trees": {"add": [{"x": 200, "y": 200, "species": "spruce", "height_m": 12}]}})
        self.assertEqual(self.d.request("PATCH", "/v1/scene", body, ADMIN).status, 500)
        self.d.unhook("crash-patch")
        again = self.view("north")
        self.assertEqual((cell(again)[0], again.body == before.body), ("built", True), "the patch had dropped some")
        self.assertEqual(cell(self.view("north"))[0], "hit", "and they are kept")
        self.patch(json.loads(body))
        self.assertEqual(cell(self.view("north"))[0], "built")
        self.assertFalse(self.view("north").body == before.body)


class Refined(Warm):
    """Panels that views keep coming back to, refined by workers that are idle. Where refining must be caught in the middle it
    is held between two rows."""

    settings = dict(Warm.settings, refine_samples=1)

    def ask(self, d, times, size=64, **keys):
        return [d.get(target(size=size, **keys)) for _ in range(times)][-1]

    def until_refined(self, d):
        until(lambda: d.metric("cells_jobs_refine") == 0, "panels are refined")

    def states(self, d):
        listed = json.loads(d.get("/v1/cells").body)
        return [p["state"] for c in listed["cells"] for p in c["panels"]]

    def test_places_that_are_looked_at_come_nearer_to_the_truth(self):
        # Pictures from memory count, too, and do not stay when there are better ones.
        d = self.start(picture_cache_mb=16, refine_samples=16)
        truth = d.get(target(relief="off", quality="reference"))
        first = self.ask(d, 2, 128)
        self.assertEqual(cell(first)[2], "drawn")
        self.assertEqual(d.metric("cells_jobs_refine"), 0, "not in demand yet")
        self.ask(d, 1, 128)
        self.until_refined(d)
        better = self.ask(d, 1, 128)
        self.assertEqual(cell(better), ("hit", cell(first)[1], "refined"))
        self.assertLess(mean_difference(better.body, truth.body), mean_difference(first.body, truth.body))
        self.assertEqual(self.states(d).count("refined"), d.metric("cells_refined_total"))
        self.assertEqual(self.ask(d, 4, 128).body, better.body)
        self.assertEqual(d.metric("cells_jobs_refine"), 0, "nothing is left to do")

    def test_shadows_on_near_ground(self):
        """A walker's ground is no panel's; its shadows are kept among panels, read by views from cells alone, and go with them."""
        d = self.start(workers=1, refine_samples=4)
        walk = dict(agl=1.7, pitch=-20)
        truth = d.get(target(relief="off", quality="reference", **walk))
        direct = d.get(target(relief="off", **walk))
        first = self.ask(d, 3, 128, **walk)
        self.assertEqual(cell(first)[2], "drawn")
        self.until_refined(d)
        better = self.ask(d, 1, 128, **walk)
        self.assertEqual(cell(better), ("hit", cell(first)[1], "refined"))
        self.assertLess(mean_difference(better.body, truth.body), mean_difference(first.body, truth.body))
        listed = json.loads(d.get("/v1/cells").body)
        panels = [p for c in listed["cells"] for p in c["panels"]]
        self.assertGreater(listed["shadow_pages"], 0)
        self.assertEqual(len(panels), listed["panels"])
        self.assertLessEqual({p["layer"] for p in panels}, {"crowns", "ground"})
        refined = [p["state"] for p in panels].count("refined")
        self.assertEqual(refined + listed["shadow_pages"], d.metric("cells_refined_total"))
        self.assertEqual(d.get(target(relief="off", **walk)).body, direct.body)
        self.assertEqual(self.ask(d, 4, 128, **walk).body, better.body)
        self.assertEqual(d.metric("cells_jobs_refine"), 0, "nothing is left to do")
        self.assertEqual(d.request("DELETE", "/v1/cells", headers=ADMIN).status, 204)
        again = self.ask(d, 1, 128, **walk)
        self.assertEqual((cell(again)[0], again.body == first.body), ("built", True))
        self.assertEqual(json.loads(d.get("/v1/cells").body)["shadow_pages"], 0)

    def test_never_without_samples(self):
        d = self.start(refine_samples=0)
        self.assertEqual(cell(self.ask(d, 5))[2], "drawn")
        self.assertEqual(d.metric("cells_jobs_refine"), 0)

    def test_views_go_first(self):
        d = self.start(workers=1)
        d.hook("hold-refine")
        first = self.ask(d, 3)
        held = d.until_held()
        self.assertEqual(self.states(d).count("building"), 1)
        # The only worker is in the middle of a panel: views are answered all the same, and from what is built.
        for _ in range(2):
            again = self.ask(d, 1)
            self.assertEqual((again.body, cell(again)[2]), (first.body, "drawn"))
            self.assertEqual(d.until_held(), held)
        self.assertEqual(self.ask(d, 1, x=120).status, 200)
        self.assertEqual(self.states(d).count("building"), 1, "what is begun is kept")
        self.assertEqual(d.metric("cells_refined_total"), 0)
        d.unhook("hold-refine")
        self.until_refined(d)
        self.assertEqual(cell(self.ask(d, 1))[2], "refined")
        self.assertEqual(d.metric("workers_died_total") + d.metric("workers_killed_total"), 0)

    def test_a_worker_is_left_for_views(self):
        d = self.start()
        until(lambda: d.metric("workers") == 2, "two workers")
        d.hook("hold-refine")
        self.ask(d, 3)
        held = d.until_held()
        for x in (120, 160):
            self.ask(d, 4, x=x)
        self.assertEqual(d.held(), held, "one refines, one draws")
        os.kill(held[0], signal.SIGKILL)
        until(lambda: d.metric("workers") == 2, "it is replaced")
        d.until_others_held(held, "another cell's turn")
        self.assertEqual(self.states(d).count("building"), 1, "what the dead had begun is given back")
        d.unhook("hold-refine")
        self.until_refined(d)
        self.assertEqual(self.states(d).count("building"), 0)

    def test_patches(self):
        """What can see a change is drawn anew, from the truth as it is then; the rest stays refined."""
        d = self.start(workers=1)
        for heading in (0, 180):
            self.ask(d, 3, y=60, heading=heading)
            self.until_refined(d)
        south = self.ask(d, 1, y=60, heading=180)
        self.assertEqual(cell(south)[2], "refined")
        d.hook("hold-refine")
        self.ask(d, 3, x=120)
        old = d.until_held()
        tree = {"trees": {"add": [{"x": 200, "y": 200, "species": "spruce", "height_m": 12}]}}
        self.assertEqual(d.request("PATCH", "/v1/scene", json.dumps(tree), ADMIN).status, 200)
        until(lambda: not os.path.exists("/proc/%d" % old[0]), "who refined the old scene is gone")
        d.unhook("hold-refine")
        again = self.ask(d, 1, y=60, heading=180)
        self.assertEqual((cell(again)[0], cell(again)[2], again.body == south.body), ("hit", "refined", True))
        self.assertEqual(cell(self.ask(d, 1, y=60))[::2], ("built", "drawn"))
        self.ask(d, 3, y=60)
        self.until_refined(d)
        patched = self.ask(d, 1, y=60)
        self.assertEqual(cell(patched)[2], "refined")
        self.assertEqual(d.request("DELETE", "/v1/cells", headers=ADMIN).status, 204)
        self.ask(d, 3, y=60)
        self.until_refined(d)
        self.assertTrue(self.ask(d, 1, y=60).body == patched.body)
        self.assertNotIn("building", self.states(d))


if __name__ == "__main__":
    unittest.main()
