"""Names: the field's words, in code, comments and docstrings."""

import ast
import re
from functools import cache
from itertools import chain
from pathlib import Path

import omnisim

ROOT = Path(omnisim.__file__).parent.parent
PYTHON = ("omnisim", "benchmarks", "scenes", "tests", ".ci")
# A docstring names its subject; a clause that opens with one of these describes it instead.
CLAUSE_OPENERS = frozenset(
    (
        "Does", "How", "Is", "Of", "That", "Those", "What", "When", "Where", "Whether", "Which",
        "Whose", "Why",
    )
)  # fmt: skip
# Phrases that say nothing, or that one has to read twice; regular expressions.
VAGUE = (
    r": where\.$", r": as given\.", r"that is none\b", r"\b(?:MOST|LEAST|LARGEST)_",
    r"\bthat (?:it|they) (?:is|are) (?:of|in|from)[.,:;]",
    r"^ +[a-z_, ]+: (?:\([^)]*\) )?(?:which|whether|how|what|that) [a-z]",
)  # fmt: skip
# British stems; the other spelling is everywhere the same.
BRITISH = (
    "colour", "centre", "centring", "metre", "grey", "neighbour", "labell", "rasteris", "normalis",
    "initialis", "quantis", "favour", "behaviour", "licence", "tyre", "castor", "chequer", "fibre",
    "modelled", "modelling", "mitre",
)  # fmt: skip
# Words of other formats' files, and the old name that a message tells.
SPELLED_BY_OTHERS = (
    '"Grey"', '"DarkGrey"', "line_centre_circle", "Point Grey", "centre_height_m", "dark_grey",
    "mid_grey", "colour-science",
)  # fmt: skip
NAME_IN_A_SCENE = re.compile(r"""["'`][a-z0-9_{}]+["'`]""")  # of a node or material in its file
# Regular expressions of retired names, each with the name that took its place.
RETIRED = {
    "standing_geometry": "static_geometry",
    "StandingDrawing|StandingGeometry": "StaticDrawer, StaticGeometry",
    "stands? still|standing still": "static",
    "movers?": "dynamic object",
    "next_movers|movers_at": "object_poses",
    "chunks?|Chunks?": "cluster",
    "compact_order": "spatial clustering",
    "worth_a_cut": "split_factor",
    "WORTH_A_TURN": "MIN_TRIANGLES_PER_PASS",
    "prepare_more|go_on": "next_pass",
    "_turned_away": "cone culling",
    "CoarseDepth|coarse_depth": "HiZ",
    "Sight": "FrustumCuller",
    "Outlines": "ScreenBounds",
    "_?from_near_to_far": "front_to_back",
    "_?from_far_to_near": "back_to_front",
    "set_look": "bind_material",
    "LIGHT_KNOWN": "BAKED",
    "light_from_afar": "directional light",
    "SUNS|u_suns?|u_sun_[a-z_]+": "directional lights",
    "LAMPS|u_lamps?|u_lamp_[a-z_]+": "punctual lights",
    "here_from_[a-z_]+|u_here_from_[a-z_]+|here_from": "viewpoint_from_*",
    "own_from_mesh": "object_from_mesh",
    "numbered_geometry|TriangleNumbers|triangle_numbers": "triangle IDs",
    "SurfacePass|surface_pass": "RayHitPass",
    "NextViewPass|next_view_pass": "OcclusionPass",
    "then_from_now|u_then_from_now": "next_from_current",
    "FacePlan|FaceNeed|face_need": "TilePlan, SamplingDensity",
    "LookupTable|lookup_table": "RemapTable",
    "UPSIDE_DOWN": "FLIP_Z",
    "Said|said_as": "ParsedCamera",
    "in_words": "encode",
    "making(?=\\()": "error_context",
    "Foreign": "ForeignTable",
    "whole_file": "atomic_write",
    "check_apart": "check_distinct",
    "Sightings?|sightings?": "Observation",
    "Judgements?|judgements?": "Association",
    "outdone": "superseded",
    "off_m": "innovation_m",
}
# Retired names of variables, parameters and attributes; as words of prose they are free.
RETIRED_IDENTIFIERS = {
    "look": "batch",
    "looks": "batches",
    "mover": "object",
    "thing": "object",
    "things": "objects",
    "told": "result, metadata, document",
}
GLTF = "omnisim/scene/formats/gltf/"  # whose files have chunks by the specification


def _files(folders, pattern):
    for folder in folders:
        for path in sorted((ROOT / folder).rglob(pattern)):
            if path != Path(__file__).resolve():
                yield path


@cache
def _nodes(path):
    """Nodes of a Python module's syntax tree."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def _docstrings(path):
    """(line, docstring) of a Python module."""
    for node in _nodes(path):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node)
            if text:
                yield node.body[0].lineno, text


def _first_comment(path):
    """(line, text) of a shader's first comment."""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("//"):
            return number, line.lstrip("/ ")
    return 1, ""


def _comments_without_subject():
    """Comments beside a shader's code that begin with "of", without the noun."""
    for path in _files(("shaders",), "*.*"):
        if path.suffix == ".md":
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if re.search(r"\S\s*// of\b", line):
                yield f"{path.relative_to(ROOT)}:{number}: {line.strip()}"


def _clauses():
    texts = [(path, *found) for path in _files(PYTHON, "*.py") for found in _docstrings(path)]
    texts += [
        (path, *_first_comment(path))
        for path in _files(("shaders",), "*.*")
        if path.suffix != ".md"
    ]
    for path, line, text in texts:
        if re.match(r"\w*", text).group() in CLAUSE_OPENERS:
            yield f"{path.relative_to(ROOT)}:{line}: {text.splitlines()[0]}"


def _retired_names():
    # one pattern without groups: each alternative is then passed over by its first letter
    pattern = re.compile(rf"\b(?:{'|'.join(RETIRED)})(?!\w)")
    for path in (*_files(PYTHON, "*.py"), *_files(("shaders",), "*.*")):
        name = path.relative_to(ROOT).as_posix()
        text = path.read_text(encoding="utf-8")
        for found in pattern.finditer(text):
            if not (name.startswith(GLTF) and found.group().startswith("chunk")):
                line = text.count("\n", 0, found.start()) + 1
                yield f"{name}:{line}: {found.group()} → {_better(found)}"


def _better(found):
    """The name that took the place of a retired one."""
    return next(
        better
        for retired, better in RETIRED.items()
        if re.compile(retired).match(found.string, found.start())
    )


def _identifiers(path):
    """(line, name) of the variables, parameters and attributes of a Python module."""
    for node in _nodes(path):
        if isinstance(node, ast.Name):
            yield node.lineno, node.id
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.Attribute):
            yield node.lineno, node.attr


def _retired_identifiers():
    for path in _files(PYTHON, "*.py"):
        for line, name in _identifiers(path):
            if name in RETIRED_IDENTIFIERS:
                yield f"{path.relative_to(ROOT)}:{line}: {name} → {RETIRED_IDENTIFIERS[name]}"


def test_docstrings_open_with_their_subject():
    offenders = list(_clauses())
    assert not offenders, "\n".join(("expected a noun or a verb first:", *offenders))


def test_comments_beside_shader_code_name_their_subject():
    offenders = list(_comments_without_subject())
    assert not offenders, "\n".join(("expected a noun before “of”:", *offenders))


def test_retired_names_are_gone():
    offenders = list(_retired_names())
    assert not offenders, "\n".join(("expected the name after the arrow:", *offenders))


def test_retired_identifiers_are_gone():
    offenders = list(_retired_identifiers())
    assert not offenders, "\n".join(("expected the name after the arrow:", *offenders))


def _prose():
    """Name and text of code, shaders and documentation; scenes name their own nodes."""
    files = [
        *_files(
            ("omnisim", "benchmarks", "scenes", "examples", "tests", ".ci", "docs/_ext"), "*.py"
        ),
        *_files(("shaders",), "*.*"),
        *_files(("omnisim", "scenes", "examples"), "*.toml"),
        *_files(("docs", "omnisim", "benchmarks", "scenes", "examples"), "*.md"),
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    ]
    for path in files:
        name = path.relative_to(ROOT).as_posix()
        if not name.startswith("docs/_build"):
            text = path.read_text(encoding="utf-8")
            yield name, NAME_IN_A_SCENE.sub("", text) if name.startswith("scenes/") else text


def test_phrases_are_read_once_and_words_have_one_spelling():
    vague = re.compile("|".join(VAGUE), re.MULTILINE)
    offenders = []
    for name, text in _prose():
        for word in SPELLED_BY_OTHERS:
            text = text.replace(word, "")
        lower = text.lower()
        british = (re.finditer(stem, lower) for stem in BRITISH if stem in lower)
        for match in chain(vague.finditer(text), *british):
            line = text.count("\n", 0, match.start()) + 1
            offenders.append(f"{name}:{line}: {match.group()}")
    assert not offenders, "\n".join(("expected plain American English:", *offenders))


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
    arguments = node.args
    named = (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)
    others = (arguments.vararg, arguments.kwarg)
    return {one.arg for one in (*named, *others) if one is not None}


def _unknown_arguments():
    for path in _files(("omnisim", "benchmarks"), "*.py"):
        for node in _nodes(path):
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
                yield f"{path.relative_to(ROOT)}:{node.lineno}: {node.name}: {name}"


def test_docstrings_describe_arguments_by_their_names():
    offenders = list(_unknown_arguments())
    assert not offenders, "\n".join(("expected the name of an argument:", *offenders))
