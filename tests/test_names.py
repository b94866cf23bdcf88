"""Names: units in those of quantities, and arguments that docstrings describe."""

import ast
import re

from tests.syntax import PACKAGE, syntax_nodes

ROOT = PACKAGE.parent
# Quantities with a dimension: the name of a number ends in its unit.
QUANTITY = re.compile(
    r"(?:^|_)(yaw|pitch|roll|azimuth|elevation|distance|diameter|thickness|speed|velocity|duration|"
    r"period|time|mass)$"
)
NUMBER = re.compile(r"\b(float|Number|Positive|NotNegative)\b")
WITHOUT_UNIT = {
    ("omnisim/runs/physics", "distance"),  # of slip: meters per meter
    ("omnisim/apps/cli/images", "yaw"),  # of a private function
}


def _modules():
    """(path below the root, nodes of its syntax tree) of each file."""
    files = syntax_nodes() | syntax_nodes(ROOT / "benchmarks")
    return [(path.relative_to(ROOT), nodes) for path, nodes in files.items()]


def _numbers():
    """(path, line, name) of the quantities that are numbers or arrays of them."""
    for path, nodes in _modules():
        for node in nodes:
            if isinstance(node, ast.arg):
                name, kind = node.arg, node.annotation
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                name, kind = node.target.id, node.annotation
            else:
                continue
            if kind is not None and QUANTITY.search(name) and NUMBER.search(ast.unparse(kind)):
                yield path, node.lineno, name


def test_names_of_quantities_end_in_their_units():
    offenders = [
        f"{path}:{line}: {name}"
        for path, line, name in _numbers()
        if (path.parent.as_posix(), name) not in WITHOUT_UNIT
    ]
    assert not offenders, "\n".join(("expected a unit at the end:", *offenders))


def _parameters(node):
    """Names of a function's parameters, or of those of a class's constructor."""
    if isinstance(node, ast.ClassDef):
        fields = {
            part.target.id
            for part in node.body
            if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
        }
        makers = [part for part in node.body if getattr(part, "name", "") == "__init__"]
        return fields.union(*(_parameters(maker) for maker in makers))
    return {one.arg for one in ast.walk(node.args) if isinstance(one, ast.arg)}


def _unknown_arguments():
    for path, nodes in _modules():
        for node in nodes:
            if not isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            section = re.search(
                r"^Args:\n((?:    .*\n?|\n)*)", ast.get_docstring(node) or "", re.MULTILINE
            )
            names = re.findall(r"^    ([a-z_][\w, ]*):", section[1], re.M) if section else []
            described = {name.strip() for group in names for name in group.split(",")}
            parameters = _parameters(node)
            if isinstance(node, ast.ClassDef) and not parameters:
                continue  # the constructor is inherited
            for name in sorted(described - parameters):
                yield f"{path}:{node.lineno}: {node.name}: {name}"


def test_docstrings_describe_arguments_by_their_names():
    offenders = list(_unknown_arguments())
    assert not offenders, "\n".join(("expected the name of an argument:", *offenders))
