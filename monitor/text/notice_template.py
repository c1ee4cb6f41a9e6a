"""Templates of notices rendered in a process of their own, with bounded time, memory and output.

A template is a program: two nested loops run for hours, and `'%999999999d' % 5` requires a gigabyte inside one
operation, which nothing in the same process can stop. jinja2's sandbox limits neither.
"""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from jinja2 import StrictUndefined, TemplateError
from jinja2.sandbox import SandboxedEnvironment

_CPU_SECONDS = 2  # of the rendering process, its start included
_CHECK_SECONDS, _SECONDS = 30.0, 5.0  # of wall time, when settings are read and when a notice is sent
_MEGABYTES = 400  # of address space: the interpreter has 60
_MAX_OUTPUT = 100_000  # characters
_MAX_TEMPLATE = 20_000  # characters
_ENVIRONMENT = SandboxedEnvironment(undefined=StrictUndefined, autoescape=False, keep_trailing_newline=True)
_FAILURES = (TemplateError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError, RecursionError)


class TemplateFailure(ValueError):  # noqa: N818 - a template that fails is no fault of the program
    """A template that cannot be rendered, or not within its bounds."""


def render_trusted(template: str, values: Mapping[str, Any]) -> str:
    """Return a template of the program's own, rendered in this process."""
    return _ENVIRONMENT.from_string(template).render(values)


@lru_cache(maxsize=16)
def _rendered(request: str, seconds: float) -> tuple[str, ...]:
    command = [sys.executable, "-P", "-m", __name__]  # not -I: packages may be in PYTHONPATH or the user's site
    try:
        done = subprocess.run(
            command, input=request.encode(), capture_output=True, timeout=seconds, check=False, cwd="/"
        )
    except subprocess.TimeoutExpired as error:
        raise TemplateFailure(f"it was not rendered within {seconds:g} s") from error
    except OSError as error:
        raise TemplateFailure(f"it cannot be rendered: {error.strerror}") from error
    try:
        answer: dict[str, Any] = json.loads(done.stdout)
    except ValueError as error:
        bounds = f"{_CPU_SECONDS} s of processor time and {_MEGABYTES} MB"
        raise TemplateFailure(f"it was not rendered within {bounds}") from error
    if "error" in answer:
        raise TemplateFailure(answer["error"])
    return tuple(answer["texts"])


def render_bounded(template: str, contexts: Sequence[Mapping[str, Any]], *, checked: bool = False) -> tuple[str, ...]:
    """Return a template rendered with each of some contexts.

    Parameters
    ----------
    template : jinja2 text
    contexts : JSON values by name
    checked : whether settings are being read: a busy machine may then take longer than a notice can wait

    Raises
    ------
    TemplateFailure
        If it fails, or needs more time, memory or output than a notice may.
    """
    if len(template) > _MAX_TEMPLATE:
        raise TemplateFailure(f"expected up to {_MAX_TEMPLATE} characters, found {len(template)}")
    return _rendered(
        json.dumps({"template": template, "contexts": list(contexts)}), _CHECK_SECONDS if checked else _SECONDS
    )


def _bound_process() -> None:
    """Limit time and memory of this process."""
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (_CPU_SECONDS, _CPU_SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (_MEGABYTES << 20, _MEGABYTES << 20))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _answer(request: Mapping[str, Any]) -> dict[str, Any]:
    texts: list[str] = []
    try:
        template = _ENVIRONMENT.from_string(request["template"])
        for context in request["contexts"]:
            text = ""
            for piece in template.generate(context):
                text += piece
                if len(text) > _MAX_OUTPUT:
                    return {"error": f"it gives more than {_MAX_OUTPUT} characters"}
            texts.append(text)
    except MemoryError:
        return {"error": f"it needs more than {_MEGABYTES} MB"}
    except _FAILURES as error:
        return {"error": f"{error}"[:500]}
    return {"texts": texts}


def main() -> None:
    """Render the template on the standard input."""
    if sys.platform != "win32":
        _bound_process()
    sys.stdout.write(json.dumps(_answer(json.load(sys.stdin))))


if __name__ == "__main__":
    main()
