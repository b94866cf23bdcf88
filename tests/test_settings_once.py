"""Settings are stated once: a table that fills a dataclass takes its fields from it."""

import ast
import re
from collections import defaultdict
from functools import cache

from tests.syntax import syntax_nodes

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


@cache
def _bases(node):
    return [ast.unparse(base).partition("[")[0] for base in node.bases]


class _Classes:
    """Classes of the package by name: fields with their annotations, bases, and kind."""

    def __init__(self):
        self.nodes = defaultdict(list)
        for nodes in syntax_nodes().values():
            for node in nodes:
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
                if any(found & set(_bases(node)) for node in nodes)
            }
            grows, found = not more <= found, found | more
        return found

    def fields(self, name):
        """Annotations by name, those of the bases first."""
        fields = {}
        for node in self.nodes.get(name, ()):
            for base in _bases(node):
                fields |= self.fields(base) if base != name else {}
            for line in node.body:
                if isinstance(line, ast.AnnAssign):
                    annotation = ast.unparse(line.annotation)
                    if "ClassVar" not in annotation:
                        fields[line.target.id] = annotation
        return fields

    def is_data(self, name):
        return any(
            "NamedTuple" in _bases(node)
            or any("dataclass" in ast.unparse(one) for one in node.decorator_list)
            for node in self.nodes.get(name, ())
        )


def _words(node):
    return (
        {
            part.id if isinstance(part, ast.Name) else part.attr
            for part in ast.walk(node)
            if isinstance(part, ast.Name | ast.Attribute)
        }
        if node
        else set()
    )


def _functions(nodes):
    """Functions, each with the words of its signature and the name of its class."""
    for node in nodes:
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
    classes = _Classes()
    for nodes in syntax_nodes().values():
        for function, seen in _functions(nodes):
            tables = seen & classes.tables
            calls = (node for node in ast.walk(function) if isinstance(node, ast.Call))
            for call in calls if tables else ():
                made = ast.unparse(call.func).rpartition(".")[2]
                if not classes.is_data(made):
                    continue
                fields = classes.fields(made)
                for table in tables - {made}:
                    own = classes.fields(table)
                    for name in _passed_on(call, fields):
                        key = next((k for k in (name, name.replace("rad", "deg")) if k in own), "")
                        if key and not classes.whole & set(re.findall(r"\w+", own[key])):
                            yield f"{table}.{key} -> {made}"


def test_a_table_states_no_field_of_the_dataclass_that_it_fills():
    """A table takes such fields by `overriding`, and is turned into the object by `build`."""
    assert set(_stated_twice()) == REASONS
