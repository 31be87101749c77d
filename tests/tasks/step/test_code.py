"""The code digest and the key: what counts, and what does not."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from storage import SourceFile
from tasks.step.code import code_of, forget_code
from tasks.step.inputs import Arguments
from tasks.step.key import explain
from tests.tasks.step.toy import Scaling, scale

FILES = {
    "steps.py": """
        '''Docstring.'''
        from __future__ import annotations
        from demo_code.helper import double
        from . import relative
        REGISTRY = {"lazy": "demo_code.registered:Thing"}

        def work(x):
            '''What it does.'''
            from demo_code.inside import shift  # comment
            return shift(double(x))
    """,
    "helper.py": "import demo_code.deep\ndef double(x):\n    return 2 * x\n",
    "deep.py": "LIMIT = 3\n",
    "relative.py": "R = 1\n",
    "registered.py": "class Thing:\n    '''A thing.'''\n    a: int = 1\n    '''Its a.'''\n",
    "inside.py": "def shift(x):\n    return x + 1\n",
    "unrelated.py": "U = 1\n",
    "__init__.py": "",
}
REACHED = {"", ".steps", ".helper", ".deep", ".relative", ".registered", ".inside"}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "demo_code"
    folder.mkdir()
    for name, text in FILES.items():
        lines = text.splitlines()
        (folder / name).write_text("\n".join(line.removeprefix(" " * 8) for line in lines))
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    forget_code()
    yield folder
    forget_code()


def digest() -> str:
    forget_code()
    return code_of("demo_code.steps").digest


def edit(path: Path, before: str, after: str) -> None:
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))


def test_the_closure_follows_every_kind_of_import(package: Path) -> None:
    modules = code_of("demo_code.steps").modules
    assert set(modules) == {"demo_code" + name for name in REACHED}
    assert "demo_code.steps" not in sys.modules  # parsed, not imported


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("steps.py", "'''What it does.'''", "'''Something\n    else.'''"),
        ("steps.py", "# comment", "# another comment"),
        ("steps.py", "shift(double(x))", "shift(\n        double( x )\n    )"),
        ("registered.py", "    '''Its a.'''", ""),
        ("unrelated.py", "U = 1", "U = 2"),
    ],
)
def test_cosmetics_keep_the_digest(package: Path, file: str, before: str, after: str) -> None:
    old = digest()
    edit(package / file, before, after)
    assert digest() == old


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("steps.py", "shift(double(x))", "double(shift(x))"),
        ("helper.py", "2 * x", "3 * x"),
        ("deep.py", "3", "4"),
        ("relative.py", "1", "2"),
        ("registered.py", "a: int = 1", "a: int = 2"),
        ("inside.py", "x + 1", "x + 2"),
    ],
)
def test_a_change_in_reach_changes_it(package: Path, file: str, before: str, after: str) -> None:
    old = digest()
    edit(package / file, before, after)
    assert digest() != old


def test_extra_modules_and_package_versions_count(package: Path) -> None:
    plain = code_of("demo_code.steps").digest
    extra = code_of("demo_code.steps", (), ("demo_code",))
    assert "demo_code.unrelated" in extra.modules
    assert extra.digest != plain
    versions = code_of("demo_code.steps", ("numpy", "no-such-thing")).packages
    assert versions["no-such-thing"] == "absent"
    assert versions["numpy"][0].isdigit()
    with pytest.raises(ValueError, match="no first-party module"):
        code_of("demo_code.steps", (), ("demo_code.nowhere",))


def test_the_shell_and_the_store_do_not_count() -> None:
    code_of.cache_clear()
    modules = code_of("tests.tasks.step.toy").modules
    assert "garden_models.scene" in modules
    assert not [name for name in modules if name.startswith(("tasks.step", "storage"))]
    formats = code_of("tests.tasks.step.toy", (), ("storage.formats",)).modules
    assert "storage.formats" in formats
    assert "storage.store" not in formats


def test_all_first_party_code_is_digested_quickly() -> None:
    forget_code()
    started = time.process_time()
    code = code_of("tests.tasks.step.toy", (), ("garden_models",))
    assert (time.process_time() - started) / len(code.modules) < 0.02
    forget_code()
    started = time.process_time()
    code_of("tests.tasks.step.toy", (), ("garden_models",))
    assert time.process_time() - started < 0.1  # parsed already


def parts(config: Any = None, content: str = "b3:0", **changes: Any) -> Any:
    made = scale.key_parts(Arguments({}, {"config": config or Scaling()}))
    return dataclasses.replace(made, **({"inputs": {"numbers": content}} | changes))


def test_the_key_tells_types_apart() -> None:
    keys = [parts(Scaling(value)).key for value in (1, 1.0, True, "1", (1,), [1])]  # type: ignore[arg-type]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda: parts(Scaling(3.0)), "config", "config.factor 2.0 -> 3.0"),
        (lambda: parts(content="b3:1"), "input", "input numbers changed"),
        (lambda: parts(version=2), "version", "step version 1 -> 2"),
        (lambda: parts(backend="foundation"), "backend", "backend embedded -> foundation"),
        (lambda: parts(weights={"decoder": "b3:1"}), "weights", "weights decoder changed"),
        (lambda: parts(seed=1), "seed", "seed 0 -> 1"),
    ],
)
def test_explained_every_part_of_the_key(change: Callable[[], Any], code: str, words: str) -> None:
    last = parts().to_json()
    changed = change()
    assert changed.key != parts().key
    why = explain(changed, last)
    assert (why.code, why.sentence) == (code, words)


def test_explained_code_changes_name_the_modules() -> None:
    last = parts().to_json()
    last["code"] = last["code"] | {"garden_models.scene": "b3:old", "garden_models.gone": "b3:1"}
    why = explain(parts(), last)
    assert why.code == "code"
    assert why.sentence == "code changed (garden_models.gone, garden_models.scene)"
    assert explain(parts(), None).code == "new"
    assert explain(parts(), parts().to_json()).code == "evicted"


def test_skipped_arguments_do_not_count() -> None:
    from tasks.step.key import without

    assert without({"a": 1, "workers": 2}, ("workers",)) == {"a": 1}
    kept = without({"config": Scaling(2.0, "x")}, ("config.note",))
    assert kept == {"config": {"factor": 2.0}}
    with pytest.raises(ValueError, match="no field 'typo'"):
        without({"config": Scaling()}, ("config.typo",))


def test_source_files_count_by_content_not_place(tmp_path: Path) -> None:
    for folder in "ab":
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "x.jpg").write_bytes(b"1")
    one, two = (parts(SourceFile.of(tmp_path / f / "x.jpg")) for f in "ab")
    assert one.key == two.key


def test_keys_do_not_depend_on_the_hash_seed() -> None:
    code = "from tests.tasks.step.test_code import parts; print(parts().key)"
    keys = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": ":".join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(keys) == 1


def test_another_threads_parsing_is_no_error_of_a_step(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parse, calls = ast.parse, []

    def disturbed(*arguments: Any) -> ast.AST:
        calls.append(arguments)
        if len(calls) % 3:
            raise SystemError("AST constructor recursion depth mismatch (before=90, after=77)")
        return parse(*arguments)

    undisturbed = digest()
    (package / "deep.py").write_text("LIMIT = 3  # another stamp\n")
    with monkeypatch.context() as patch:
        patch.setattr(ast, "parse", disturbed)
        again = digest()
    assert again == undisturbed
    assert len(calls) == 3
