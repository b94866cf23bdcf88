"""Names of a package, imported from its modules at first use."""

TYPE_CHECKING = False  # as typing's: `import omnisim` imports nothing slow
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def lazy_names(package: str, modules: "Mapping[str, str]") -> "Callable[[str], object]":
    """Module function `__getattr__` (PEP 562) of a package, by relative modules of its names.

    It imports a name's module, and raises AttributeError for an unknown name.
    """

    def attribute(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        import sys
        from importlib import import_module

        value = getattr(import_module(f"{package}.{modules[name]}"), name)
        setattr(sys.modules[package], name, value)
        return value

    return attribute
