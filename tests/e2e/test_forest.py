"""Forms of trees that views ask for: built beside the workers, once, told by /v1/scene; and what a worker takes."""
import json
import os
import unittest

from harness import Case, bakes, until

CLOUD_FORMS = ["billboard", "indirect", "density", "density_paper"]
FORMS = ["polygon", "coarse", "leaf"] + CLOUD_FORMS


def scene(trees, size_m):
    """One species, cheap to bake."""
    return {
        "name": "forest",
        "terrain": {"procedural": {"size_m": size_m, "samples": 129, "relief_m": 20, "seed": 4}},
        "species": [{"name": "spruce", "procedural": {"habit": "conifer", "leaves": 400, "seed": 1}}],
        "forest": [
            {"scatter": {"count": trees, "seed": 1, "mix": {"spruce": 1}, "height_m": [6, 15], "min_spacing_m": 1}}
        ],
        "sun": {"azimuth_deg": 135, "elevation_deg": 40},
    }


def target(form, x=200, size=64, pitch=-10):
    return "/v1/view?x=%g&y=100&agl=30&pitch=%g&width=%d&height=%d&format=png&trees=%s" % (x, pitch, size, size, form)


def own_kb(pid):
    """Memory of the process: private, and shared with others."""
    fields = {}
    with open("/proc/%d/smaps_rollup" % pid) as f:
        for line in f:
            words = line.split()
            if words[-1] == "kB":
                fields[words[0]] = int(words[1])
    private = fields["Private_Dirty:"] + fields["Private_Clean:"]
    return private, fields["Rss:"] - private


class Forms(Case):
    settings = {"scene": scene(300, 400), "deadline_ms": 300000}

    def species(self, daemon):
        answer = daemon.get("/v1/scene")
        self.assertEqual(answer.status, 200)
        return json.loads(answer.body)["species"]

    def test_built_in_the_background_and_told(self):
        d = self.start()
        for s in self.species(d):
            self.assertEqual(sorted(s["bytes"]), sorted(FORMS))
            self.assertTrue(all(n > 0 for n in s["bytes"].values()), s)
            self.assertEqual(sorted(s["built"]), ["coarse", "leaf", "polygon"])
        tag = d.get("/v1/scene").headers["ETag"]
        first = d.get(target("density"))
        self.assertEqual(first.status, 200)
        until(lambda: all("density" in s["built"] for s in self.species(d)), "density is built")
        self.assertNotEqual(d.get("/v1/scene").headers["ETag"], tag)
        self.assertFalse(any("billboard" in s["built"] for s in self.species(d)), "nobody asked for billboards")
        self.assertEqual(d.log_text().count("form density of all species"), 1)
        # What was built while the view waited is what a process finds that only loads it.
        again = self.start(cache_dir=os.path.join(d.folder, "cache"))
        self.assertTrue(all("density" in s["built"] for s in self.species(again)))
        second = again.get(target("density"))
        self.assertEqual(second.body, first.body)
        self.assertNotIn("form density of all species", again.log_text())

    def test_two_views_at_once_of_a_form_that_is_not_there(self):
        d = self.start()
        answers = [d.background(d.get, target("indirect", x)) for x in (180, 220)]
        for answer in answers:
            self.assertEqual(answer.result().status, 200)
        until(lambda: all("indirect" in s["built"] for s in self.species(d)), "indirect is built")
        self.assertEqual(d.metric("workers_died_total"), 0)


class Memory(Case):
    """A worker takes less than 500 MB with 45,000 trees, shared parts included, whatever it has drawn (of one species
    here; five of 39,000 leaves: README)."""

    settings = {"scene": scene(45000, 1000), "deadline_ms": 300000, "cache_dir": bakes()}

    def test_a_worker_of_45000_trees(self):
        d = self.start(workers=1)
        for k, form in enumerate(["auto", "coarse", "auto"]):
            self.assertEqual(d.get(target(form, 150 + 60 * k, 256)).status, 200)
        self.assertEqual(d.get(target("density", pitch=-85)).status, 200)  # straight down: few trees, GL is slow
        until(lambda: all("density" in s["built"] for s in self.species(d)), "density is built")
        for worker in d.worker_pids():
            private, shared = own_kb(worker)
            print("worker: %d MB own, %d MB shared" % (private >> 10, shared >> 10))
            self.assertLess(private + shared, 500 << 10)

    species = Forms.species


if __name__ == "__main__":
    unittest.main(verbosity=2)
