"""Functions that run a scene step by step: their arguments, and the printed form of their results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import Concatenate, Generic, ParamSpec, TypeVar

from ..scenes.scene import Scene, scene_of

Options = ParamSpec("Options")
Step = TypeVar("Step")


class RunIterator(Generic[Step]):
    """The steps of a run; its printed form says in an interactive session how to use the run."""

    def __init__(self, name: str, steps: Iterator[Step]) -> None:
        self._name, self._steps = name, steps

    def __iter__(self) -> Iterator[Step]:
        return self

    def __next__(self) -> Step:
        return next(self._steps)

    def __repr__(self) -> str:
        return (
            f"<{self._name}: an iterator, which computes what is asked for: `for each in {self._name}(scene): ...`, or "
            f"`*_, last = {self._name}(scene)`>"
        )


def run_of_scene(
    function: Callable[Concatenate[Scene, Options], Iterator[Step]],
) -> Callable[Concatenate[Scene | str | Path, Options], Iterator[Step]]:
    """The function, which also takes the path of a scene, and whose iterator prints."""

    @wraps(function)
    def run(scene: Scene | str | Path, *args: Options.args, **options: Options.kwargs) -> Iterator[Step]:
        name = function.__name__
        return RunIterator(name, function(scene_of(scene, name), *args, **options))

    return run
