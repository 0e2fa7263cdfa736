"""The checks that options ask for: of no other check is anything imported, nor what explains its findings."""

from importlib import import_module
from typing import Any

from fedora_qa.check_names import module_of, selected_explanations
from fedora_qa.checks.protocol import Check


def select_checks(select: tuple[str, ...], ignore: tuple[str, ...]) -> tuple[Check[Any], ...]:
    """Return the checks that are asked for, in their fixed order.

    Raises
    ------
    MisuseError
        A name is that of no subject and no check.
    """
    return tuple(check_of(explained.check) for explained in selected_explanations(select, ignore))


def check_of(name: str) -> Check[Any]:
    """Return a check: ``event_stream.gaps`` is an ``EventStreamGaps`` of ``checks/event_stream/gaps.py``."""
    class_name = "".join(word.capitalize() for word in name.replace(".", "_").split("_"))
    check: Check[Any] = getattr(import_module(module_of(name)), class_name)()
    return check
