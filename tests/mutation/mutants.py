"""Single changes of a module's source that a test should notice: what a mutant is, and where it may be.

Left out is what cannot change behaviour: docstrings and other text, messages (f-strings, arguments of what is raised),
annotations, decorators, `__all__`, assertions for the type checker, blocks of `TYPE_CHECKING`, `strict=` of `zip`.
"""

from __future__ import annotations

import ast
import copy
import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
_NAMES = {"min": "max", "any": "all", "sin": "cos", "minimum": "maximum", "real": "imag", "fmax": "fmin"}
_NAMES |= {other: name for name, other in _NAMES.items()}
_SMALL = 16  # integers above are sizes and limits: doubled and halved, as numbers with a point


@dataclass(frozen=True)
class Mutant:
    """Bytes `begin` to `end` of a file replaced by `text`; `identity` outlives edits elsewhere in the file."""

    path: str
    line: int
    begin: int
    end: int
    text: str
    identity: str

    def applied(self, source: bytes) -> bytes:
        """The source with the change."""
        return source[: self.begin] + self.text.encode() + source[self.end :]

    def shown(self, source: bytes) -> str:
        """The lines that it changes, before and after, as one."""
        first = source.rfind(b"\n", 0, self.begin) + 1
        last = source.find(b"\n", self.end)
        old = source[first:last].decode()
        new = (source[first : self.begin] + self.text.encode() + source[self.end : last]).decode()
        return f"{self.path}:{self.line}: - {' '.join(old.split())} + {' '.join(new.split())}"


def mutants(path: str, source: bytes) -> list[Mutant]:
    """Every mutant of a module, in the order of its source."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    made: list[Mutant] = []
    counts: dict[str, int] = {}
    for node, text in _changes(ast.parse(source)):
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + node.end_col_offset
        words = f"{path}: {source[begin:end].decode()} -> {text}"
        counts[words] = counts.get(words, 0) + 1
        made.append(Mutant(path, node.lineno, begin, end, text, f"{words} ({counts[words]})"))
    return made


def sample(root: Path, paths: Iterable[str], seed: int, number: int) -> list[Mutant]:
    """So many mutants of some files, one a place at most, drawn by the seed; the same after edits elsewhere."""
    every = [one for path in paths for one in mutants(path, (root / path).read_bytes())]
    every.sort(key=lambda one: hashlib.sha256(f"{seed} {one.identity}".encode()).digest())
    drawn = {(one.path, one.begin, one.end): one for one in reversed(every)}
    return [one for one in every if drawn[one.path, one.begin, one.end] is one][:number]


def _changes(node: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    if isinstance(node, ast.expr):
        form = "{}" if isinstance(node, ast.Slice) else "({})"
        yield from ((node, form.format(ast.unparse(other))) for other in _expressions(node))
    elif isinstance(node, ast.stmt):
        yield from ((node, text) for text in _statements(node))
    for child in _children(node):
        yield from _changes(child)
        test = getattr(child, "test", None)
        if isinstance(test, ast.expr) and not _texts(child) and not isinstance(test, ast.Compare | ast.UnaryOp):
            yield test, f"(not ({ast.unparse(test)}))"


def _children(node: ast.AST) -> Iterator[ast.AST]:
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params", "ctx"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not _left_out(node, child):
                yield child


def _left_out(node: ast.AST, child: ast.AST) -> bool:
    if isinstance(node, ast.Raise) or isinstance(child, ast.JoinedStr | ast.Assert | ast.Import | ast.ImportFrom):
        return True
    if isinstance(node, ast.Module) and isinstance(child, ast.Assign | ast.AnnAssign):
        target = child.targets[0] if isinstance(child, ast.Assign) else child.target
        union = isinstance(child.value, ast.BinOp) and isinstance(child.value.op, ast.BitOr)
        return ast.unparse(target) == "__all__" or union or isinstance(child.value, ast.Subscript)  # names of types
    if isinstance(child, ast.keyword):
        return child.arg == "strict"
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance":
        return child is not node.args[0]
    return isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)


def _texts(node: ast.AST) -> bool:
    """Whether a node is text, or chooses between texts."""
    if isinstance(node, ast.IfExp):
        return _texts(node.body) and _texts(node.orelse)
    if isinstance(node, ast.BinOp):
        return _texts(node.left) or _texts(node.right)
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _expressions(node: ast.expr) -> Iterator[ast.expr]:
    if isinstance(node, ast.Compare):
        for place, operator in enumerate(node.ops):
            for other in _COMPARISONS[type(operator)]:
                yield _with(node, ops=[*node.ops[:place], other(), *node.ops[place + 1 :]])
    elif isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC and not _texts(node):
        yield _with(node, op=_ARITHMETIC[type(node.op)]())
    elif isinstance(node, ast.BoolOp):
        yield _with(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield from (ast.Constant(value) for value in _numbers(node.value))
    elif isinstance(node, ast.Slice):
        yield from (_with(node, **{name: None}) for name in ("lower", "upper", "step") if getattr(node, name))
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in _NAMES:
        yield ast.Name(_NAMES[node.id])
    elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load) and node.attr in _NAMES:
        yield _with(node, attr=_NAMES[node.attr])


def _numbers(value: float) -> tuple[float, ...]:
    if isinstance(value, bool):
        return (not value,)
    if isinstance(value, int):
        return (value + 1, value - 1) if value <= _SMALL else (2 * value, value // 2)
    return (2.0 * value, 0.5 * value) if value else (1.0,)


def _statements(node: ast.stmt) -> Iterator[str]:
    if isinstance(node, ast.Return) and node.value is not None and ast.unparse(node.value) != "None":
        yield "return None"
    elif isinstance(node, ast.AugAssign):
        if type(node.op) in _ARITHMETIC and not _texts(node.value):
            yield ast.unparse(_with(node, op=_ARITHMETIC[type(node.op)]()))
        yield "pass"
    elif isinstance(node, ast.Expr):
        if isinstance(node.value, ast.Call):
            yield "pass"
    elif isinstance(node, ast.Assign):
        if not isinstance(node.targets[0], ast.Name | ast.Tuple):  # without a name the module would only crash
            yield "pass"
    elif isinstance(node, ast.Raise | ast.Continue | ast.Break):
        yield "pass"


def _with(node: ast.AST, **fields: object) -> ast.AST:
    other = copy.copy(node)
    for name, value in fields.items():
        setattr(other, name, value)
    return other
