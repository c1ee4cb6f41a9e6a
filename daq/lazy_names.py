"""Names of a package that are imported at their first use: a command that reads a log needs no driver of a device.

A package states its names as imports of the form ``from module import name as name``, by which type checkers and
editors know what it exports (PEP 484). Those under ``if TYPE_CHECKING:`` are imported at their first use, others at
once. Its source is the only list of them.

References
----------
Cannon, B. (2017). PEP 562: module __getattr__ and __dir__.
"""

import ast
import itertools
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def lazy_names(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package.

    Parameters
    ----------
    package : its name
    file : its source, whose imports name the modules
    """
    body = ast.parse(Path(file).read_bytes()).body
    blocks = [statement.body for statement in body if isinstance(statement, ast.If)]  # TYPE_CHECKING is the only one
    places = {
        name.name: statement.module
        for statement in itertools.chain(body, *blocks)
        if isinstance(statement, ast.ImportFrom) and statement.module
        for name in statement.names
        if name.asname == name.name
    }
    names = sorted(places)

    def get(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value: object = getattr(import_module(places[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return get, lambda: names, names
