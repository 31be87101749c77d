"""Digest the code that a step reaches, without importing any of it.

The closure follows the import statements (those inside functions too) of first-party
modules from the step's own; a string constant that names a first-party module, as in a
registry of lazy imports, counts as an import. Comments, docstrings and layout do not count.
The step shell and the store are left out: they decide how results are kept, not what
they are (``storage.formats`` does count: it reads what comes from outside). So is what runs
models, and their registry, which names them all: a step counts the model that it uses by
``tasks.model.weights_of``.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import importlib.metadata
import importlib.util
import re
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

from storage.digest import digest_bytes, digest_value

FIRST_PARTY = ("garden_models", "tasks", "storage")
_REGISTRY = "garden_models.foundation"
_SPECIAL = (ast.Import, ast.ImportFrom, ast.Constant)
_MODULE_NAME = re.compile(r"[A-Za-z_]\w*(\.\w+)+(:\w+)?")


@dataclass(frozen=True)
class Code:
    """A step's code: ``modules`` maps names to short digests, ``packages`` to versions."""

    digest: str
    modules: dict[str, str]
    packages: dict[str, str]


@dataclass(frozen=True)
class _Source:
    digest: str
    imports: frozenset[str]  # dotted names that may be modules or things in modules


@functools.cache
def code_of(module: str, packages: tuple[str, ...] = (), extra: tuple[str, ...] = ()) -> Code:
    """Return the code that ``module`` reaches, as it is when first asked in this process.

    ``forget_code`` makes it look again.

    Args:
        module: dotted name of the step's module.
        packages: distributions whose version counts.
        extra: further first-party modules; of a package, all its modules count.
    """
    ours = frozenset({*FIRST_PARTY, module.partition(".")[0]})
    roots = [module]
    for name in extra:
        roots += _whole_package(name, ours)
    modules = _closure(roots, ours)
    if module not in modules:  # a script, or a module outside of any package
        modules[module] = _read(_loaded_file(module), module).digest
    versions = {name: package_version(name) for name in sorted(packages)}
    digest = digest_value((modules, versions), domain="garden.code/1")
    return Code(digest, modules, versions)


def _closure(roots: list[str], ours: frozenset[str]) -> dict[str, str]:
    digests: dict[str, str] = {}
    seen: set[str] = set()
    waiting = list(roots)
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        path = None if _left_out(name) else module_path(name, ours)
        if path is None:
            continue
        source = _read(path, name)
        digests[name] = source.digest
        waiting += _parents(name)
        for imported in source.imports:
            waiting += _parents(imported)
            waiting.append(imported)
    return dict(sorted(digests.items()))


def _parents(name: str) -> list[str]:
    """Return the packages around a module: importing it runs their ``__init__`` too."""
    words = name.split(".")
    return [".".join(words[:length]) for length in range(1, len(words))]


def _left_out(name: str) -> bool:
    package, _, rest = name.partition(".")
    inside = rest.partition(".")[0]
    if name == _REGISTRY:
        return True
    if package == "tasks":
        return inside in ("step", "model", "model_worker")
    return package == "storage" and inside != "formats"


def _loaded_file(module: str) -> Path:
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None:
        raise ValueError(f"the source of {module} cannot be found: define steps in files")
    return Path(file)


def module_path(name: str, ours: frozenset[str] = frozenset(FIRST_PARTY)) -> Path | None:
    """Return the source file of a module of the packages ``ours``, None if it is none."""
    words = name.split(".")
    root = _root(words[0]) if words[0] in ours else None
    if root is None:
        return None
    place = root.joinpath(*words[1:])
    if (place / "__init__.py").is_file():
        return place / "__init__.py"
    file = place.with_suffix(".py")
    return file if len(words) > 1 and file.is_file() else None


@functools.cache
def _root(package: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(package)
    except ValueError:  # __main__
        return None
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))


def _whole_package(name: str, ours: frozenset[str]) -> list[str]:
    path = module_path(name, ours)
    if path is None:
        raise ValueError(f"{name} is no first-party module: correct `modules=` of the step")
    if path.name != "__init__.py":
        return [name]
    folder = path.parent
    inside = [file.relative_to(folder).with_suffix("").parts for file in folder.rglob("*.py")]
    return [".".join((name, *(part for part in parts if part != "__init__"))) for parts in inside]


def forget_code() -> None:
    """Look at the sources again at the next call (files that did not change stay parsed)."""
    code_of.cache_clear()
    package_version.cache_clear()
    _root.cache_clear()


_cache: dict[Path, tuple[tuple[int, int], _Source]] = {}
_guard = threading.Lock()
_parsing = threading.Lock()
_PARSES = 20


def _read(path: Path, module: str) -> _Source:
    """Parse a file, or return what it gave when it was last parsed unchanged."""
    status = path.stat()
    stamp = (status.st_mtime_ns, status.st_size)
    with _guard:
        known = _cache.get(path)
    if known is not None and known[0] == stamp:
        return known[1]
    source = _parse(path.read_bytes(), module, is_package=path.name == "__init__.py")
    with _guard:
        _cache[path] = (stamp, source)
    return source


def _parse(data: bytes, module: str, *, is_package: bool) -> _Source:
    words: list[str] = []
    special: list[ast.AST] = []
    _spell(_tree(data), words, special)
    imports: set[str] = set()
    for node in special:
        imports |= _imports(node, module, is_package=is_package)
    return _Source(digest_bytes("\0".join(words).encode())[:19], frozenset(imports))


def _tree(data: bytes) -> ast.AST:
    """Parse a file; again if it met another thread's parsing.

    Some CPythons, 3.11.7 among them, then raise SystemError ("AST constructor recursion depth
    mismatch"). Threads here take turns; libraries parse too, and do not.
    """
    with _parsing:
        for _attempt in range(_PARSES - 1):
            with contextlib.suppress(SystemError):
                return ast.parse(data)
        return ast.parse(data)


def _spell(node: ast.AST, words: list[str], special: list[ast.AST]) -> None:
    """Write a syntax tree down without places and docstrings; collect imports and constants.

    Empty fields are left out, so that a newer Python that knows more of them agrees.
    """
    words.append(type(node).__name__)
    if isinstance(node, _SPECIAL):
        special.append(node)
    for name in node._fields:
        value = getattr(node, name, None)
        if value is None or value == []:
            continue
        words.append(name)
        if isinstance(value, ast.AST):
            _spell(value, words, special)
        elif isinstance(value, list):
            for item in value:
                if not isinstance(item, ast.AST):
                    words.append(repr(item))
                elif not _is_text(item):
                    _spell(item, words, special)
        else:
            words.append(repr(value))
    words.append(")")


def _imports(node: ast.AST, module: str, *, is_package: bool) -> set[str]:
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    if isinstance(node, ast.ImportFrom):
        base = node.module or ""
        if node.level:
            around = module.split(".")
            around = around[: len(around) - node.level + (1 if is_package else 0)]
            base = ".".join([*around, *([node.module] if node.module else [])])
        return {base} | {f"{base}.{alias.name}" for alias in node.names}
    text = node.value if isinstance(node, ast.Constant) else None
    if isinstance(text, str) and _MODULE_NAME.fullmatch(text):
        return {text.partition(":")[0]}
    return set()


def _is_text(statement: ast.AST) -> bool:
    """Tell whether a statement is only a string: a docstring, also of a field."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


@functools.cache
def package_version(distribution: str) -> str:
    """Return the installed version of a distribution, ``absent`` if there is none."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "absent"
