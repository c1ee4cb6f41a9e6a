"""Names of a package that are imported at their first use: a command that reads a log needs no driver of a device.

A package states its names as imports under ``if TYPE_CHECKING:``, where type checkers, editors and the check of the
layers read them. Its source is the only list of them.

References
----------
Cannon, B. (2017). PEP 562: module __getattr__ and __dir__.
"""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def lazy_names(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package.

    Parameters
    ----------
    package : its name
    file : its source, whose imports under ``if TYPE_CHECKING:`` name the modules
    """
    places = {
        name.asname or name.name: (statement.module, name.name)
        for block in ast.parse(Path(file).read_bytes()).body
        if isinstance(block, ast.If) and isinstance(block.test, ast.Name) and block.test.id == "TYPE_CHECKING"
        for statement in block.body
        if isinstance(statement, ast.ImportFrom) and statement.module
        for name in statement.names
    }

    def get(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, original = places[name]
        value: object = getattr(import_module(module), original)
        setattr(sys.modules[package], name, value)
        return value

    return get, lambda: sorted(
        {*places, *getattr(sys.modules[package], "__all__", ())}
    )  # those it imports at once, too
