"""The wire: headers on every answer, conditional requests, methods, framing, limits, and who is cut off."""
import contextlib
import http.client
import json
import shutil
import socket
import ssl
import subprocess
import tempfile
import time
import unittest

from harness import PATIENCE_S, Case, daemon_alone, read_all, until, view_target

EVERYWHERE = ["Server-Timing", "X-Request-Id", "traceparent", "Access-Control-Allow-Origin", "Timing-Allow-Origin"]


def head(data):
    """Status and fields of the first answer in the bytes."""
    lines = data.split(b"\r\n\r\n")[0].decode("latin-1").split("\r\n")
    fields = {}
    for line in lines[1:]:
        name, _, value = line.partition(":")
        fields[name.lower()] = value.strip()
    return int(lines[0].split()[1]), fields


class Answers(Case):
    def test_every_answer_carries_the_common_headers(self):
        d = self.share()
        etag = d.view(64).headers["ETag"]
        for method, target, headers, body, status in [
            ("GET", "/livez", {}, None, 200),
            ("GET", "/readyz", {}, None, 200),
            ("GET", "/metrics", {}, None, 200),
            ("GET", "/openapi.json", {}, None, 200),
            ("GET", "/v1/scene", {}, None, 200),
            ("GET", "/", {}, None, 200),
            ("GET", view_target(), {}, None, 200),
            ("HEAD", view_target(), {}, None, 200),
            ("GET", view_target(), {"If-None-Match": etag}, None, 304),
            ("GET", "/v1/view?bogus=1", {}, None, 400),
            ("GET", "/v1/view?x=100&y=100&z=-500", {}, None, 422),
            ("GET", view_target() + "&budget_ms=20", {}, None, 501),
            ("GET", view_target().replace("&format=png", ""), {"Accept": "text/html"}, None, 406),
            ("POST", "/v1/view", {"Content-Type": "application/json"}, b"{", 400),
            ("POST", "/v1/view", {"Content-Type": "text/plain"}, b"{}", 415),
            ("POST", "/v1/view", {"Content-Type": "application/json"}, b" " * 100000, 413),
            ("GET", "/nowhere", {}, None, 404),
            ("GET", "/tiles/1/2/3.png", {}, None, 501),
            ("POST", "/v1/batch", {"Content-Type": "application/x-ndjson"}, b"{}", 501),
            ("PUT", "/v1/view", {}, None, 405),
            ("BREW", "/v1/view", {}, None, 405),
            ("OPTIONS", "/v1/view", {}, None, 204),
            ("POST", "/v1/scene/reload", {}, None, 401),
        ]:
            with self.subTest(method=method, target=target):
                answer = d.request(method, target, body, headers)
                self.assertEqual(answer.status, status)
                for name in EVERYWHERE:
                    self.assertIn(name, answer.headers)
                self.assertRegex(answer.headers["Server-Timing"], r"total;dur=\d")
                if status >= 400:
                    answer.problem()

    def test_view_over_post_is_the_same_view(self):
        d = self.share()
        got = d.view(64)
        body = {"x": 100, "y": 100, "agl": 10, "width": 64, "height": 64, "format": "png"}
        posted = d.request("POST", "/v1/view", json.dumps(body), {"Content-Type": "application/json; charset=utf-8"})
        self.assertEqual((posted.status, posted.body, posted.headers["ETag"]), (200, got.body, got.headers["ETag"]))
        self.assertIn("hit", posted.headers["Cache-Status"])

    def test_conditional_request_costs_no_job(self):
        d = self.start()
        first = d.view(64)
        drawn, resolved = d.metric("views_drawn_total"), d.metric("views_resolved_total")
        for tag in [first.headers["ETag"], '"other", ' + first.headers["ETag"], "*"]:
            answer = d.view(64, If_None_Match=tag)
            self.assertEqual((answer.status, answer.body), (304, b""))
            self.assertEqual(answer.headers["ETag"], first.headers["ETag"])
        self.assertEqual(d.view(64, If_None_Match='"other"').status, 200)
        self.assertEqual((d.metric("views_drawn_total"), d.metric("views_resolved_total")), (drawn, resolved))
        # A view never drawn, asked for with the tag that another daemon on this scene would give: resolved, not drawn.
        other = self.start()
        self.assertEqual(other.view(64, If_None_Match=first.headers["ETag"]).status, 304)
        self.assertEqual(other.metric("views_drawn_total"), 0)

    def test_head_is_get_without_a_body(self):
        d = self.share()
        asked = d.request("HEAD", view_target())
        got = d.view(64)
        self.assertEqual((asked.status, asked.body), (200, b""))
        self.assertEqual(asked.headers["Content-Length"], str(len(got.body)))
        self.assertEqual(asked.headers["ETag"], got.headers["ETag"])

    def test_description_draws_nothing(self):
        d = self.start()
        answer = d.get(view_target() + "&f=json")
        self.assertEqual((answer.status, answer.headers["Content-Type"]), (200, "application/json"))
        self.assertEqual(json.loads(answer.body)["etag"], d.view(64).headers["ETag"])
        self.assertEqual(d.metric("views_drawn_total"), 1)

    def test_eye_under_ground_tells_the_height(self):
        d = self.share()
        document = d.get("/v1/view?x=100&y=100&z=-500").problem()
        self.assertEqual(document["type"], "urn:silvista:problem:eye-under-ground")
        self.assertIsInstance(document["ground_z_m"], (int, float))

    def test_all_bad_fields_at_once(self):
        d = self.share()
        errors = d.get("/v1/view?x=1&y=nan&vfov=0&width=5&nonsense=1").problem()["errors"]
        self.assertTrue({"y", "vfov", "width", "nonsense"} <= {e["field"] for e in errors}, errors)

    def test_preflight(self):
        d = self.share()
        answer = d.request("OPTIONS", "/v1/view", headers={"Origin": "http://x", "Access-Control-Request-Method": "POST"})
        self.assertEqual(answer.headers["Allow"], "GET, HEAD, POST, OPTIONS")
        self.assertIn("POST", answer.headers["Access-Control-Allow-Methods"])
        self.assertEqual(d.request("OPTIONS", "*").status, 204)
        self.assertEqual(d.request("OPTIONS", "/nowhere").status, 404)
        self.assertEqual(d.request("DELETE", "/livez").headers["Allow"], "GET, HEAD, OPTIONS")

    def test_ids_are_honoured(self):
        d = self.share()
        trace = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"
        answer = d.get("/livez", X_Request_Id="mine-1", traceparent=trace)
        self.assertEqual(answer.headers["X-Request-Id"], "mine-1")
        self.assertEqual(answer.headers["traceparent"][:36], trace[:36])
        self.assertNotEqual(answer.headers["traceparent"], trace)
        self.assertNotIn("evil", d.get("/livez", X_Request_Id="evil id").headers["X-Request-Id"])

    def test_metrics_are_prometheus_text(self):
        d = self.start()
        d.view(64)
        text = d.get("/metrics").body.decode()
        for line in text.splitlines():
            self.assertRegex(line, r'^(# (HELP|TYPE) silvista_\w+ .+|silvista_\w+(\{[^}]*\})? [-+0-9.e]+(Inf)?)$')
        self.assertIn('silvista_stage_seconds_count{stage="near"} 1', text)
        self.assertIn('silvista_http_requests_total{route="getView",code="200"} 1', text)


class Framing(Case):
    settings = {"accept_deadline_ms": 2000, "request_read_deadline_ms": 2000}

    def test_refused_framing(self):
        d = self.share()
        start = b"POST /v1/view HTTP/1.1\r\n"
        for name, data, status in [
            ("both lengths", start + b"Host: x\r\nContent-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400),
            ("odd coding", start + b"Host: x\r\nTransfer-Encoding: gzip, chunked\r\n\r\n0\r\n\r\n", 400),
            ("coding in 1.0", b"POST /v1/view HTTP/1.0\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400),
            ("no host", b"GET /livez HTTP/1.1\r\n\r\n", 400),
            ("two hosts", b"GET /livez HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", 400),
            ("lengths differ", start + b"Host: x\r\nContent-Length: 2\r\nContent-Length: 3\r\n\r\n{}x", 400),
            ("blank before colon", start + b"Host: x\r\nTransfer-Encoding : chunked\r\n\r\n0\r\n\r\n", 400),
            ("negative length", start + b"Host: x\r\nContent-Length: -1\r\n\r\n", 400),
            ("blank in target", b"GET /live z HTTP/1.1\r\nHost: x\r\n\r\n", 400),
            ("control in target", b"GET /livez\x01 HTTP/1.1\r\nHost: x\r\n\r\n", 400),
            ("no path", b"GET livez HTTP/1.1\r\nHost: x\r\n\r\n", 400),
            ("too long", start + b"Host: x\r\nContent-Length: 99999999\r\n\r\n", 413),
            ("far too long", start + b"Host: x\r\nContent-Length: 99999999999999999999999\r\n\r\n", 413),
            ("long target", b"GET /livez?" + b"a" * 9000 + b" HTTP/1.1\r\nHost: x\r\n\r\n", 414),
            ("long fields", b"GET /livez HTTP/1.1\r\nHost: x\r\nA: " + b"a" * 17000 + b"\r\n\r\n", 431),
        ]:
            with self.subTest(name):
                answer = d.raw(data)  # ends when the daemon closes: refused framing never keeps a connection
                self.assertEqual(head(answer)[0], status, answer[:200])
        self.assertEqual(d.get("/livez").status, 200)

    def test_what_the_library_answers_by_itself(self):
        """libmicrohttpd's own plain answers, or a close without one: nothing of ours runs."""
        d = self.share()
        for name, data, statuses in [
            ("huge target", b"GET /" + b"a" * 100000 + b" HTTP/1.1\r\nHost: x\r\n\r\n", {414, 431, None}),
            ("huge field", b"GET /livez HTTP/1.1\r\nHost: x\r\nA: " + b"a" * 100000 + b"\r\n\r\n", {431, None}),
            ("garbage", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", {400, 505, None}),
            ("no colon", b"GET /livez HTTP/1.1\r\nHost x\r\n\r\n", {400, None}),
            ("version", b"GET /livez HTTP/3.0\r\nHost: x\r\n\r\n", {400, 505, None}),
            ("nothing", b"", {None}),
            ("half a line", b"GET /livez", {None}),
            ("bad chunk", b"POST /v1/view HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n", {400, None}),
        ]:
            with self.subTest(name), d.connect() as s:
                with contextlib.suppress(OSError):  # it may close before it has taken all
                    s.sendall(data)
                    s.shutdown(socket.SHUT_WR)
                answer = read_all(s)
                self.assertIn(head(answer)[0] if answer else None, statuses, answer[:200])
        self.assertEqual(d.get("/livez").status, 200)

    def test_accepted_framing(self):
        d = self.share()
        body = b'{"x":100,"y":100,"agl":10,"width":32,"height":32,"format":"png"}'
        chunks = b"".join(b"%x\r\n%c\r\n" % (1, c) for c in body) + b"0\r\n\r\n"
        for name, data, status in [
            ("chunked", b"POST /v1/view HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\nConnection: close\r\n\r\n" + chunks, 200),
            ("1.0", b"GET /livez HTTP/1.0\r\n\r\n", 200),
            ("absolute form", b"GET http://host/livez?x HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", 200),
            ("no length", b"POST /v1/view HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", 411),
            ("chunked too long", b"POST /v1/view HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"
             + b"".join(b"1000\r\n" + b" " * 4096 + b"\r\n" for _ in range(20)) + b"0\r\n\r\n", 413),
        ]:
            with self.subTest(name):
                self.assertEqual(head(d.raw(data))[0], status)

    def test_pipelined_requests_are_answered_in_order(self):
        d = self.share()
        one = ("GET %s HTTP/1.1\r\nHost: x\r\nX-Request-Id: %%d\r\n\r\n" % view_target(40)).encode()
        with d.connect() as s:
            s.sendall(b"".join(one % i for i in range(5)))
            data = b""
            while data.count(b"HTTP/1.1 200") < 5:
                data += s.recv(65536)
        self.assertEqual([data.find(b"X-Request-Id: %d\r" % i) for i in range(5)],
                         sorted(data.find(b"X-Request-Id: %d\r" % i) for i in range(5)))

    def test_continue_is_said(self):
        d = self.share()
        body = b'{"x":100,"y":100,"agl":10,"width":32,"height":32,"format":"png"}'
        with d.connect() as s:
            s.sendall(b"POST /v1/view HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\nConnection: close\r\n"
                      b"Content-Length: %d\r\n\r\n" % len(body))
            self.assertEqual(head(s.recv(4096))[0], 100)
            s.sendall(body)
            self.assertEqual(head(read_all(s))[0], 200)


@daemon_alone
class Slow(Case):
    settings = {"accept_deadline_ms": 300, "request_read_deadline_ms": 300, "send_deadline_ms": 300}

    def cut_after(self, d, pieces):
        with d.connect() as s:
            try:
                for piece in pieces:
                    s.sendall(piece)
                    time.sleep(0.02)  # the slowness under test, not a wait for something
                    s.setblocking(False)
                    try:
                        if s.recv(4096) == b"":
                            return True
                    except BlockingIOError:
                        pass
                    s.settimeout(PATIENCE_S)
            except OSError:
                return True
        return False

    def test_one_byte_at_a_time_is_cut(self):
        d = self.start()
        request = b"GET /livez HTTP/1.1\r\nHost: x\r\nA: " + b"a" * 1000
        self.assertTrue(self.cut_after(d, [request[i : i + 1] for i in range(len(request))]))
        body = b"POST /v1/view HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 1000\r\n\r\n"
        self.assertTrue(self.cut_after(d, [body] + [b" "] * 500))
        self.assertGreaterEqual(d.metric("connections_cut_total"), 2)

    def test_a_kept_connection_is_cut_in_its_second_request(self):
        d = self.start()
        first = b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n"
        second = b"GET /livez HTTP/1.1\r\nA: " + b"a" * 1000
        self.assertTrue(self.cut_after(d, [first, second[:24]] + [b"a"] * 500))

    def test_a_client_that_takes_nothing_is_cut(self):
        d = self.start()
        with d.connect() as s:
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            target = "/v1/view?x=100&y=100&agl=10&width=256&height=256&format=tiff"
            s.sendall(("GET %s HTTP/1.1\r\nHost: x\r\n\r\n" % target).encode() * 400)
            until(lambda: d.metric("connections_cut_total") >= 1, "it is cut")
            until(lambda: d.metric("connections") == 1, "its connection is gone")
        until(lambda: d.metric("slab_lent_bytes") == 0, "its slab is back")


class Limits(Case):
    @daemon_alone
    def test_connections_of_one_address(self):
        d = self.start(connections_per_address=4)
        kept = []
        for _ in range(4):
            s = d.connect()
            s.sendall(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n")
            self.assertIn(b"200 OK", s.recv(4096))
            kept.append(s)
        with d.connect() as s:
            self.assertEqual(read_all(s), b"")
        for s in kept:
            s.close()
        until(lambda: b"200 OK" in d.raw(b"GET /livez HTTP/1.0\r\n\r\n"), "room again")

    @daemon_alone
    def test_connections_in_all_wait_to_be_accepted(self):
        d = self.start(connections=3)
        with d.connect() as a, d.connect() as b, d.connect() as c:
            for s in (a, b, c):
                s.sendall(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n")
                self.assertIn(b"200 OK", s.recv(4096))
            waiting = d.background(d.get, "/livez")
            c.close()
            self.assertEqual(waiting.result().status, 200)

    def test_pixels(self):
        d = self.start(max_pixels=10000, max_samples_pixels=20000)
        self.assertEqual(d.view(64).status, 200)
        self.assertEqual(d.view(160).status, 400)
        self.assertEqual(d.get(view_target(64) + "&samples=16").status, 400)

    def test_a_picture_over_the_budget_of_shared_memory(self):
        d = self.start(slab_budget_mb=1)
        self.assertEqual(d.view(64).status, 200)
        answer = d.get("/v1/view?x=100&y=100&agl=10&width=2048&height=2048&format=exr")
        self.assertEqual(answer.status, 400)
        self.assertIn("budget", answer.problem()["detail"])

    def test_small_cache_still_serves(self):
        d = self.start(picture_cache_mb=0, resolve_cache_entries=0)
        self.assertEqual([d.view(64).status for _ in range(3)], [200] * 3)
        self.assertEqual(d.metric("views_drawn_total"), 3)


@daemon_alone
class Tls(Case):
    @unittest.skipUnless(shutil.which("openssl"), "skipped: no openssl to make a certificate with")
    def test_views_over_tls(self):
        with tempfile.TemporaryDirectory() as folder:
            key, cert = folder + "/key.pem", folder + "/cert.pem"
            subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", key, "-out", cert,
                            "-days", "1", "-subj", "/CN=localhost"], check=True, capture_output=True)
            d = self.start(wait_ready=False, tls_cert=cert, tls_key=key)
            context = ssl.create_default_context(cafile=cert)
            context.check_hostname = False

            def get(target):
                connection = http.client.HTTPSConnection("127.0.0.1", d.port, timeout=PATIENCE_S, context=context)
                connection.request("GET", target)
                response = connection.getresponse()
                body = response.read()
                connection.close()
                return response.status, body

            until(lambda: get("/readyz")[0] == 200, "ready")
            status, body = get(view_target())
            self.assertEqual((status, get(view_target())[1]), (200, body))
            self.assertEqual(head(d.raw(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n") or b"HTTP/1.1 0")[0], 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
