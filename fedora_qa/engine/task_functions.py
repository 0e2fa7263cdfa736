"""The functions of tasks by their names: the process that deals out tasks does not load what does them."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final


@dataclass(frozen=True, slots=True)
class NamedFunction:
    """A function of a module, which is imported where the function is called.

    Attributes
    ----------
    module, name
        Where it is, and what it is called there.
    """

    module: str
    name: str

    def __call__(self, *arguments: Any) -> Any:
        """Import the function and call it."""
        return getattr(import_module(self.module), self.name)(*arguments)


_TASKS: Final = "fedora_qa.engine.tasks"
_KERNELS: Final = "fedora_qa.engine.kernels"

OPEN_AND_CLOSE: Final = NamedFunction(_TASKS, "open_and_close")
CHECK_WHOLE: Final = NamedFunction(_TASKS, "check_whole")
SURVEY_FILE: Final = NamedFunction(_TASKS, "survey_file")
MEASURE_WINDOWS: Final = NamedFunction(_TASKS, "measure_windows")
FINISH_FILE: Final = NamedFunction(_TASKS, "finish_file")
TRAFFIC_OF: Final = NamedFunction(_TASKS, "traffic_of")
UNCOMPILED: Final = NamedFunction(_KERNELS, "uncompiled")
COMPILE_GROUP: Final = NamedFunction(_KERNELS, "compile_group")
