"""Mutants of a module: its source with one small fault each, made from the syntax tree.

Faults are numbers, operators, comparisons, conditions, minima for maxima, statements and returned values left out.
Annotations, decorators, texts, arguments of exceptions and `strict=` of `zip` are left as they are.
"""

import ast
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

_OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Add,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
_FUNCTIONS = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}
_LEFT = (ast.JoinedStr, ast.Import, ast.ImportFrom, ast.Raise)  #: their parts are not mutated
_LEFT_FIELDS = frozenset({"annotation", "returns", "decorator_list", "bases", "type_params"})
_REMOVED = (ast.Expr, ast.AugAssign, ast.Raise, ast.Continue, ast.Break, ast.Delete)


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """A module with one fault."""

    module: str  #: path from the root of the repository
    number: int  #: among all of the module
    line: int
    text: str  #: the line as it is, without indentation
    change: str  #: `old -> new`, numbered if the line has several alike
    lines: frozenset[int]  #: of the statement that is changed

    @property
    def key(self) -> tuple[str, str, str]:
        """Identification of the mutant while other lines are added and removed."""
        return self.module, self.text, self.change


def mutants(module: str, source: str) -> Iterator[Mutant]:
    """Yield all mutants of a source in the order of its syntax tree."""
    tree = ast.parse(source)
    line = source.splitlines()
    alike: Counter[tuple[str, str]] = Counter()
    for number, (place, new) in enumerate(_changes(tree)):
        text = line[place.node.lineno - 1].strip()
        change = f"{_short(place.node)} -> {_short(new)}"
        alike[text, change] += 1
        nth = alike[text, change]
        yield Mutant(
            module=module,
            number=number,
            line=place.node.lineno,
            text=text,
            change=change + (f" ({nth})" if nth > 1 else ""),
            lines=_own_lines(place.statement),
        )


def mutated(source: str, number: int) -> str:
    """Return the source of one of the mutants of a source."""
    tree = ast.parse(source)
    place, new = next(islice(_changes(tree), number, None))
    if place.index is None:
        setattr(place.parent, place.name, new)
    else:
        getattr(place.parent, place.name)[place.index] = new
    return ast.unparse(ast.fix_missing_locations(tree))


def _changes(tree: ast.AST) -> Iterator[tuple["_Place", ast.AST]]:
    """Yield the places of possible replacements, and these."""
    for place in _places(tree, tree):
        for new in _replacements(place.node):
            yield place, new


@dataclass(frozen=True)
class _Place:
    parent: ast.AST
    name: str  # of the parent's field
    index: int | None  # in it, if it is a list
    node: ast.expr | ast.stmt
    statement: ast.AST  # innermost one that holds the node


def _places(parent: ast.AST, statement: ast.AST) -> Iterator[_Place]:
    """Yield where an expression or statement may be replaced."""
    for name, value in ast.iter_fields(parent):
        if name in _LEFT_FIELDS or (isinstance(parent, ast.ClassDef) and name == "keywords"):
            continue
        for index, node in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if not isinstance(node, ast.AST) or (isinstance(node, ast.keyword) and node.arg == "strict"):
                continue
            inner = node if isinstance(node, ast.stmt) else statement
            if isinstance(node, ast.expr | ast.stmt):
                yield _Place(parent, name, index, node, inner)
            if not isinstance(node, _LEFT):
                yield from _places(node, inner)


def _replacements(node: ast.expr | ast.stmt) -> Iterator[ast.AST]:
    """Yield replacements of a node."""
    match node:
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(2 * value or 1.0)
        case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert()):
            yield node.operand
        case ast.BinOp(op=op) if type(op) in _OPERATORS and not _of_types(node):
            yield ast.BinOp(node.left, _other(op), node.right)
        case ast.BoolOp(op=op):
            yield ast.BoolOp(_other(op), node.values)
        case ast.Compare(ops=[op]):
            yield ast.Compare(node.left, [_other(op)], node.comparators)
        case ast.Compare(ops=ops):
            for i, op in enumerate(ops):
                yield ast.Compare(node.left, [*ops[:i], _other(op), *ops[i + 1 :]], node.comparators)
        case ast.Call(func=ast.Name(id=called)) if called in _FUNCTIONS:
            yield ast.Call(ast.Name(_FUNCTIONS[called]), node.args, node.keywords)
        case ast.Call(func=ast.Attribute(value=owner, attr=called)) if called in _FUNCTIONS:
            yield ast.Call(ast.Attribute(owner, _FUNCTIONS[called]), node.args, node.keywords)
        case ast.IfExp():
            yield ast.IfExp(_not(node.test), node.body, node.orelse)
        case ast.If() if _short(node.test) != "TYPE_CHECKING":
            yield ast.If(_not(node.test), node.body, node.orelse)
        case ast.Return(value=ast.expr() as value) if not (isinstance(value, ast.Constant) and value.value is None):
            yield ast.Return(ast.Constant(None))
        case ast.Expr(value=ast.Constant()):  # a docstring
            return
    if isinstance(node, _REMOVED) or (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Subscript)):
        yield ast.Pass()


def _of_types(node: ast.BinOp) -> bool:
    """Return whether an operation joins types, as in `int | None`."""
    return isinstance(node.op, ast.BitOr) and any(
        isinstance(side, ast.Constant | ast.Name) and _short(side) in {"None", "int", "float", "str", "bytes"}
        for side in (node.left, node.right)
    )


def _other(operator: ast.AST) -> Any:
    return _OPERATORS[type(operator)]()


def _not(test: ast.expr) -> ast.expr:
    negated = isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)
    return test.operand if isinstance(test, ast.UnaryOp) and negated else ast.UnaryOp(ast.Not(), test)


def _short(node: ast.AST) -> str:
    """Return the first line of a node's text."""
    return ast.unparse(ast.fix_missing_locations(node)).splitlines()[0][:100]


def _own_lines(statement: ast.AST) -> frozenset[int]:
    """Return the lines of a statement without those of the statements in it."""
    last = getattr(statement, "end_lineno", 1)
    first_inside = min(
        (part.lineno for part in ast.walk(statement) if isinstance(part, ast.stmt) and part is not statement),
        default=last + 1,
    )
    first = getattr(statement, "lineno", 1)
    return frozenset(range(first, max(first, min(last, first_inside - 1)) + 1))
