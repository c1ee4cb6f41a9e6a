"""Functions that take the path of a file, and those of them that the sound files of the fuzzers reach.

python tests/fuzz/reached.py prints both as JSON, with the exit code of each sound file.
"""

import ast
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from cProfile import Profile
from pathlib import Path
from random import Random

from tests.fuzz.readers import READERS, write_case

ROOT = Path(__file__).parents[2]
#: where files of other programs are read
PLACES = ("daq/files", "updater/fe/external", "monitor/analysis")
_OTHERS = ("log", "state", "lines", "site", "scenario", "structure")  # files of this program, and lines of devices
_FEWEST, _ATTEMPTS = 2, 20  # options of a command are drawn
_COSTLY = "matrices"  # one option is enough


def functions_with_a_path() -> Iterator[str]:
    """Yield the functions whose first argument is the path of a file, but those that write, as FILE:NAME."""
    for place in PLACES:
        for file in sorted((ROOT / place).rglob("*.py")):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.FunctionDef) or not node.args.args:
                    continue
                kind = node.args.args[0].annotation
                if kind is not None and "Path" in ast.unparse(kind):
                    yield f"{file.relative_to(ROOT)}:{node.name}"


def read_sound_files() -> tuple[dict[str, int], set[str]]:
    """Return the exit code of each sound file, 0 if any options accept it, and the functions that were called."""
    codes: dict[str, int] = {}
    profile = Profile(subcalls=False, builtins=False)  # of which only the names are used
    for name in READERS.keys() - set(_OTHERS):
        kind = READERS[name]
        different = {(seed.suffix, seed.content): seed for seed in kind.seeds() if seed.content}
        for number, seed in enumerate(different.values()):
            for attempt in range(_ATTEMPTS):
                folder = Path(tempfile.mkdtemp(prefix="sound-"))
                path = write_case(name, seed, seed.content, folder)
                os.chdir(folder)
                code = profile.runcall(kind.read, path, Random(f"{number} {attempt}"))
                os.chdir(ROOT)
                shutil.rmtree(folder)
                key = f"{name} {number} {path.suffix}"
                codes[key] = min(code, codes.get(key, code))
                if code <= 1 and (attempt >= _FEWEST or name == _COSTLY):  # 1: read, and the answer needs a person
                    break
    profile.create_stats()
    places = ((Path(file), function) for file, _, function in profile.stats)
    return codes, {f"{file.relative_to(ROOT)}:{name}" for file, name in places if file.is_relative_to(ROOT)}


if __name__ == "__main__":
    out = os.dup(1)
    os.dup2(2, 1)  # commands print
    found, reached = read_sound_files()
    sys.stdout.flush()
    os.write(out, json.dumps({"codes": found, "reached": sorted(reached)}).encode())
