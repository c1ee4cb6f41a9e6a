"""Lists the benchmarks, or runs one by its name: `python -m benchmarks [NAME [ARGUMENTS ...]]`."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
CATALOGUE = Path(__file__).with_name("catalogue.toml")


def catalogue() -> dict[str, dict[str, Any]]:
    """Return the benchmarks by name, with purpose, duration and command."""
    return tomllib.loads(CATALOGUE.read_text(encoding="utf-8"))


def listed(known: dict[str, dict[str, Any]]) -> str:
    """Return one line per benchmark."""
    width, times = max(map(len, known)), max(len(one["takes"]) for one in known.values())
    return "\n".join(
        f"bench-{name:{width}}  {one['takes']:>{times}}  {one['shows']} ({one['table']})" for name, one in known.items()
    )


def run(one: dict[str, Any], arguments: list[str]) -> int:
    """Run the programs of a benchmark, and return the first exit code that is not 0."""
    environment = dict(os.environ) | ({"OPENBLAS_NUM_THREADS": "1"} if one.get("threads", True) else {})
    *before, last = (program.split() for program in one["run"])
    for program in (*before, [*last, *arguments]):
        code = subprocess.run([sys.executable, *program], cwd=ROOT, env=environment, check=False).returncode
        if code:
            return code
    return 0


def main() -> int:
    """List the benchmarks or run one."""
    known = catalogue()
    match sys.argv[1:]:
        case []:
            print(listed(known))
            return 0
        case [name, *arguments] if name in known:
            if "needs" in known[name] and not arguments:
                print(f"bench-{name}: ARGUMENTS: expected {known[name]['needs']}", file=sys.stderr)
                return 2
            return run(known[name], arguments)
        case [name, *_]:
            print(f"bench-{name}: no such benchmark; `make bench` lists them", file=sys.stderr)
            return 2
    return 2


if __name__ == "__main__":
    sys.exit(main())
