#!/usr/bin/env python3
"""The house's include rules as a test: arrows run one way, third parties stay behind their fences.

core/ includes nothing of ours outside core/; api/ may include core/; server/ may include api/ and core/; clients/ include
nothing of ours; deploy/ holds no C. Each third-party header has one place. A source includes its own header first, so that
the build compiles it alone; headers of no source are compiled alone here. Usage: test_fences.py ROOT [CC]; prints each
breach, exits 1 on any.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(sys.argv[1])
CC = sys.argv[2] if len(sys.argv) > 2 else "cc"

MAY_INCLUDE = {"core": {"core"}, "api": {"core", "api"}, "server": {"core", "api", "server"}, "clients": {"clients"}}
FENCES = [  # header pattern, where it may stand
    (r"microhttpd\.h", r"server/"),
    (r"GL/|OSMesa|KHR/", r"core/gl/|core/terrain/draw\w*\.c|core/tree/(draw|impostor)\w*\.c|core/relief/(draw|bake)\w*\.c"),
    (r"GL/osmesa\.h", r"core/gl/context_osmesa\.c|core/gl/functions\.c"),
    (r"cjson/|cJSON\.h", r"core/scene/scene_(file|values)\w*\.[ch]|api/|server/"),
    (r"gdal|ogr_|cpl_|proj\.h|geos_c", r"core/geo/"),
    (r"assimp/", r"core/tree/import\.c"),
    (r"OpenImageIO/|tiffio|webp/|geotiff|xtiffio", r"core/image/"),
    (r"stb", r"core/image/dxt\.c"),
    (r"embree3/", r"core/truth/"),
]
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^">]+)[">]', re.M)


def sources():
    for folder in ("core", "api", "server", "clients"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".c", ".h", ".cpp") and path.is_file():
                yield path.relative_to(ROOT).as_posix(), path.read_text()


def breaches():
    seen = 0
    for name, text in sources():
        seen += 1
        top = name.split("/")[0]
        own = re.sub(r"\.(c|cpp)$", ".h", name)
        first = True
        for kind, header in INCLUDE.findall(text):
            if kind == '"':
                target = header.split("/")[0]
                if target in MAY_INCLUDE or target == "tests":
                    if target not in MAY_INCLUDE[top]:
                        yield f"{name}: {top}/ must not include {header}"
                elif "/" in header:
                    yield f"{name}: {header} is named from no top folder"
            for pattern, place in FENCES:
                if re.match(pattern, header) and not re.match(place, name):
                    yield f"{name}: <{header}> belongs in {place}"
            if first and name.endswith(".c") and (ROOT / own).exists() and header != own:
                yield f"{name}: its own header {own} comes first, not {header}"
            first = False
    for path in (ROOT / "deploy").rglob("*.[ch]"):
        yield f"{path.relative_to(ROOT)}: deploy/ holds no C"
    if seen < 20:
        yield f"only {seen} sources found below {ROOT}: the test looks in the wrong place"


def flags():
    """Where third parties' headers are, for those that are in no default folder."""
    run = subprocess.run(["pkg-config", "--cflags-only-I", "gdal", "libcjson"], capture_output=True, text=True)
    return run.stdout.split()


def lonely_headers():
    for folder in ("core", "api", "server"):
        for path in sorted((ROOT / folder).rglob("*.h")):
            if path.with_suffix(".c").exists():
                continue
            run = subprocess.run([CC, "-std=c11", "-D_GNU_SOURCE", "-fsyntax-only", "-Wall", "-I", str(ROOT),
                                  *flags(), "-x", "c", str(path)], capture_output=True, text=True)
            if run.returncode:
                yield f"{path.relative_to(ROOT)} does not compile alone: {run.stderr.strip().splitlines()[0]}"


found = list(breaches()) + list(lonely_headers())
print("\n".join(found) or "fences: all stand")
sys.exit(1 if found else 0)
