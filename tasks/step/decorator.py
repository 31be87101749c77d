"""Make a step of a function: its key, its references, its three engines."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from storage.digest import digest_file
from tasks.step.budget import ONE_CORE, Need
from tasks.step.code import Code, code_of
from tasks.step.execute import Call, check_postponed, execute, plan
from tasks.step.inputs import Arguments, bind, futures_in, label_of, resolve, split
from tasks.step.key import KeyParts, without
from tasks.step.ref import (
    Ref,
)
from tasks.step.run import RunContext, current_run
from tasks.step.submit import launch_when_ready

T = TypeVar("T")
Backend = str | Callable[..., str]
Weights = Callable[..., Mapping[str, str | Path]]


@dataclass(frozen=True)
class StepSpec:
    """What the decorator was told; see ``step``."""

    name: str
    version: int
    packages: tuple[str, ...] = ()
    modules: tuple[str, ...] = ()
    backend: Backend = "embedded"
    weights: Weights | None = None
    skip: tuple[str, ...] = ()
    seed: int = 0
    retries: int = 2
    isolated: bool = False
    time_limit_s: float | None = None
    memory_limit_gb: float | None = None
    need: Need = ONE_CORE
    here: bool = False


class Step:
    """A step of the pipeline: call it with references inside a run."""

    def __init__(self, fn: Callable[..., Any], spec: StepSpec) -> None:
        self.fn = fn
        self.spec = spec
        self.name = spec.name
        self.__doc__ = fn.__doc__
        self.__name__ = fn.__name__
        self.__module__ = fn.__module__
        self.__wrapped__ = fn
        self.signature = inspect.signature(fn)
        self.takes_progress = "progress" in self.signature.parameters
        self._hints: dict[str, Any] | None = None

    def __repr__(self) -> str:
        return f"<step {self.name} version {self.spec.version}>"

    def __call__(self, *args: Any, label: str | None = None, **kwargs: Any) -> Ref:
        """Run the step, or find its result, and wait for it.

        ``label`` is the target's name in reports; found in the arguments if not given.

        Raises:
            StepFailed: there is no result, and why.
        """
        context = current_run()
        call = self._call(context, bind(self.signature, args, kwargs), label)
        if context.engine == "plan":
            return plan(call)
        if context.engine == "prefect":
            from tasks.step.prefect import run_task

            return run_task(call)
        return execute(call)

    def submit(self, *args: Any, label: str | None = None, **kwargs: Any) -> Future[Ref]:
        """Start the step as soon as its inputs are there; give the future of its Ref."""
        context = current_run()
        bound = bind(self.signature, args, kwargs)

        def prepare() -> Call:
            return self._call(context, bound, label)

        return launch_when_ready(context, futures_in(bound), prepare)

    def hints(self) -> dict[str, Any]:
        """Return the resolved type hints of the parameters (imports nothing new)."""
        if self._hints is None:
            self._hints = typing.get_type_hints(self.fn)
        return self._hints

    def code(self) -> Code:
        """Return the first-party code that the step reaches."""
        return code_of(self.fn.__module__, self.spec.packages, self.spec.modules)

    @property
    def returns(self) -> str:
        """The kind of the result, as annotated."""
        annotation = self.signature.return_annotation
        return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", "")

    def key_parts(self, arguments: Arguments) -> KeyParts:
        """Return all that a call's result depends on."""
        spec = self.spec
        plain = arguments.plain
        backend = spec.backend(**plain) if callable(spec.backend) else spec.backend
        weights = spec.weights(**plain) if spec.weights is not None else {}
        return KeyParts(
            step=self.name,
            version=spec.version,
            code=self.code(),
            inputs=without(arguments.contents(), spec.skip),
            config=without(plain, spec.skip),
            backend=backend,
            weights={
                name: digest_file(w) if isinstance(w, Path) else w for name, w in weights.items()
            },
            seed=spec.seed,
        )

    def _call(self, context: RunContext, bound: dict[str, Any], label: str | None) -> Call:
        values = {name: resolve(value) for name, value in bound.items()}
        given = label if label is not None else label_of(values)
        call = Call(context, self, split(values, lambda noun: _given(context, noun)), given)
        check_postponed(call)
        return call


def _given(context: RunContext, noun: object) -> Ref:
    """Return a reference to a noun that the caller holds as a value."""
    if context.engine == "plan":
        from storage.codec.content import content_digest

        return Ref(type(noun).__name__, content_digest(noun), "", "", "given", outcome="cached")
    published = context.store.publish(noun)
    return Ref(published.kind, published.content, published.object, "", "given")


def step(
    *,
    version: int,
    name: str | None = None,
    packages: Iterable[str] = (),
    modules: Iterable[str] = (),
    backend: Backend = "embedded",
    weights: Weights | None = None,
    skip: Iterable[str] = (),
    seed: int = 0,
    retries: int = 2,
    isolated: bool = False,
    time_limit_s: float | None = None,
    memory_limit_gb: float | None = None,
    cores: int | Literal["all"] = 1,
    memory_gb: float = 1.0,
    gpus: int = 0,
    here: bool = False,
) -> Callable[[Callable[..., Any]], Step]:
    """Make a step of a function.

    Args:
        version: raise it when results change in a way that no digest sees.
        name: the step's name; the function's if not given.
        packages: distributions whose version is part of the key.
        modules: first-party modules, or packages, that the import statements do not show.
        backend: which implementation this is, or a function of the plain arguments.
        weights: function of the plain arguments that gives the files (or digests) of
            trained weights by name.
        skip: arguments, or fields (``config.workers``), that do not change the result.
        seed: seeds Python's, numpy's and torch's generators before each run.
        retries: how often a fault that may pass (I/O, memory) is tried again.
        isolated: compute in a child process, which can be stopped.
        time_limit_s: seconds after which an isolated step is killed.
        memory_limit_gb: resident memory beyond which an isolated step is killed.
        cores: how many cores it keeps busy; ``all`` for a step that takes what there is.
        memory_gb: resident memory that it needs at its peak, by measurement.
        gpus: how many GPUs it needs for itself.
        here: compute where the run was started, never on another machine: the step reads
            the user's files, or asks a server with the user's key.

    A run with a budget starts the step when its cores, memory and GPUs are free.
    """
    if not isolated and (time_limit_s is not None or memory_limit_gb is not None):
        raise ValueError("only a step with isolated=True can be held to a time or memory limit")

    def decorate(fn: Callable[..., Any]) -> Step:
        spec = StepSpec(
            name=name or fn.__name__,
            version=version,
            packages=tuple(packages),
            modules=tuple(modules),
            backend=backend,
            weights=weights,
            skip=tuple(skip),
            seed=seed,
            retries=retries,
            isolated=isolated,
            time_limit_s=time_limit_s,
            memory_limit_gb=memory_limit_gb,
            need=Need(cores, memory_gb, gpus),
            here=here,
        )
        return Step(fn, spec)

    return decorate
