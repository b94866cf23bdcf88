"""Settings are stated once: a table that fills a dataclass takes its fields from it."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import omnisim

# Fields that stand in both, although a function passes them on by hand, and why.
REASONS = {
    # what a file names, or says of itself, and what was found or made of it
    "SceneFile.labels -> Scene",  # with the IDs and colors that the tables leave out
    "ObjectTable.name -> DynamicObject",  # of any object of a scene
    "SweepPlan.drive -> SweepPoint",  # options; a drive, which is another thing
    "Plan.min_area_px -> BoxLimits",  # with a check against channels; stored in this order
    "Plan.min_visible -> BoxLimits",
    # arrays, in files lists of numbers
    "_Grid.origin_m -> Probes",
    "_Grid.spacing_m -> Probes",
    # what every sensor on a vehicle has, whatever its parameters
    "CalibratedCamerasTable.hides -> Mount",
    "CalibratedCamerasTable.type -> Mount",
    "OmniCameraTable.hides -> Mount",
    "OmniCameraTable.name -> Mount",
    "OmniCameraTable.type -> Mount",
    "SensorTable.hides -> Mount",
    "SensorTable.name -> Mount",
    "SensorTable.type -> Mount",
    # a sensor on a trigger has those of the sensor that sets it
    "SensorTable.jitter_s -> SensorRate",
    "SensorTable.phase_s -> SensorRate",
    "SensorTable.rate_hz -> SensorRate",
}


class _Classes:
    """Classes of the package by name: fields with their annotations, bases, and kind."""

    def __init__(self, trees):
        self.nodes = defaultdict(list)
        for tree in trees:
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef):
                    self.nodes[node.name].append(node)
        self.tables = self._below("Table") - self._below("ForeignTable")  # of other programs
        self.whole = self.tables | self._below("Parameters")  # which are handed on whole

    def _below(self, root):
        found, grows = {root}, True
        while grows:
            more = {
                name
                for name, nodes in self.nodes.items()
                if any(found & set(self.bases(node)) for node in nodes)
            }
            grows, found = not more <= found, found | more
        return found

    def bases(self, node):
        return [ast.unparse(base).partition("[")[0] for base in node.bases]

    def fields(self, name):
        """Annotations by name, those of the bases first."""
        fields = {}
        for node in self.nodes.get(name, ()):
            for base in self.bases(node):
                fields |= self.fields(base) if base != name else {}
            fields |= {
                line.target.id: ast.unparse(line.annotation)
                for line in node.body
                if isinstance(line, ast.AnnAssign)
                and "ClassVar" not in ast.unparse(line.annotation)
            }
        return fields

    def is_data(self, name):
        return any(
            "NamedTuple" in self.bases(node)
            or any("dataclass" in ast.unparse(one) for one in node.decorator_list)
            for node in self.nodes.get(name, ())
        )


def _words(node):
    return set() if node is None else set(re.findall(r"\w+", ast.unparse(node)))


def _functions(tree):
    """Functions, each with the words of its signature and the name of its class."""
    for node in ast.walk(tree):
        body = node.body if isinstance(node, ast.ClassDef | ast.Module) else ()
        owner = {node.name} if isinstance(node, ast.ClassDef) else set()
        for function in body:
            if isinstance(function, ast.FunctionDef):
                arguments = [*function.args.args, *function.args.kwonlyargs]
                yield (
                    function,
                    owner.union(*(_words(argument.annotation) for argument in arguments)),
                )


def _passed_on(call, fields):
    """Fields that a call fills with attributes of the same name."""
    given = dict(zip(fields, call.args, strict=False))
    given |= {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg}
    for name, value in given.items():
        read = {one.attr for one in ast.walk(value) if isinstance(one, ast.Attribute)}
        if {name, name.replace("rad", "deg")} & read:
            yield name


def _stated_twice():
    paths = Path(omnisim.__file__).parent.rglob("*.py")
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in paths]
    classes = _Classes(trees)
    for tree in trees:
        for function, seen in _functions(tree):
            for call in (one for one in ast.walk(function) if isinstance(one, ast.Call)):
                made = ast.unparse(call.func).rpartition(".")[2]
                if not classes.is_data(made):
                    continue
                fields = classes.fields(made)
                for table in seen & classes.tables:
                    own = classes.fields(table)
                    for name in _passed_on(call, fields):
                        key = next((k for k in (name, name.replace("rad", "deg")) if k in own), "")
                        if key and not classes.whole & set(re.findall(r"\w+", own[key])):
                            yield f"{table}.{key} -> {made}"


def test_a_table_states_no_field_of_the_dataclass_that_it_fills():
    """A table takes such fields by `overriding`, and is turned into the object by `build`."""
    assert set(_stated_twice()) == REASONS
