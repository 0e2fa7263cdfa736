"""Loops are compiled before they are needed, once, and nothing that goes wrong with it ends a run."""

import importlib
import inspect
import json
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher

from fedora_qa.cli.check import COMPILING, compile_for
from fedora_qa.cli.kernel_list import called_by, groups_of
from fedora_qa.engine.compilation import kernels
from fedora_qa.engine.compilation.kernel_groups import KernelGroup, listed_groups
from fedora_qa.engine.compilation.kernels import compile_group, kernel_of, text_of, type_of, uncompiled
from fedora_qa.engine.executors.executor import InProcess, OpenFile, Task, Worker, opening_test
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.progress import quiet
from tests.support.all_checks import CHECKS
from tests.support.handmade import write_handmade

_HERE = Worker(OpenFile(keeps=False))
_SOURCE = "from numba import njit\n\n\n@njit(cache=True)\ndef doubled(number):\n    return number * 2.0\n"
_MODULE = "tiny_kernels"
_TINY = KernelGroup(_MODULE, ("clocks",), {"doubled": ["float64"]})
_CLOCKS = frozenset({"clocks"})


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield the source of a module with a function of one line, whose cache lies beside it."""
    path = tmp_path / f"{_MODULE}.py"
    path.write_text(_SOURCE)
    monkeypatch.syspath_prepend(str(tmp_path))  # type: ignore[no-untyped-call]
    yield path
    # Another test has another file of this name.
    sys.modules.pop(_MODULE, None)


def test_listed_kernels_exist_with_such_arguments() -> None:
    """Each listed function exists, takes as many arguments as are listed, and each type is what its text says."""
    subjects = {check.name.split(".")[0] for check in CHECKS}
    for group in listed_groups():
        assert set(group.subjects) <= subjects
        for name, texts in group.argument_types.items():
            parameters = inspect.signature(kernel_of(group.module, name).py_func).parameters
            assert len(texts) == len(parameters), f"{group.module}.{name}: run fedora_qa.cli.kernel_list"
            assert [text_of(type_of(text)) for text in texts] == list(texts)


def test_every_loop_that_a_check_calls_is_listed(park_day: Path) -> None:
    """A loop that is not listed would be compiled by the check that calls it, while other cores are idle."""
    listed = {(group.module, name) for group in listed_groups() for name in group.argument_types}
    unlisted: set[tuple[str, str]] = set()
    # Functions that others call look called where something was compiled; nothing is in a second process.
    for _ in range(2):
        with ProcessExecutor(1) as executor:
            called = executor.submit(Task(called_by, (park_day, ())), quiet).result()
        unlisted = {(module, name) for module, name, _ in called} - listed
        if not unlisted:
            break
    assert not unlisted, "run fedora_qa.cli.kernel_list"


def test_arithmetic_does_not_depend_on_the_order_of_compiling() -> None:
    """A function called from one with a relaxed arithmetic and from one without states its own.

    Numba gives a function that states none that of the caller for which it is compiled first.
    """
    for group in listed_groups():
        importlib.import_module(group.module)
    modules = [module for name, module in tuple(sys.modules.items()) if name.startswith("fedora_qa.")]
    arithmetic: dict[Dispatcher, set[str]] = defaultdict(set)
    for module in modules:
        for caller in [value for value in vars(module).values() if isinstance(value, Dispatcher)]:
            function = caller.py_func
            for name in function.__code__.co_names:
                called = function.__globals__.get(name)
                if isinstance(called, Dispatcher) and "fastmath" not in called.targetoptions:
                    arithmetic[called].add(str(caller.targetoptions.get("fastmath", False)))
    assert not [called for called, ways in arithmetic.items() if len(ways) > 1]
    assert arithmetic


def test_compiled_once(tiny: Path) -> None:
    """A group is missing until it is compiled, and again once its source is another; other subjects do not want it."""
    assert uncompiled({"clocks"}, [_TINY], _HERE) == [_TINY]
    assert uncompiled({"depth"}, [_TINY], _HERE) == []
    compile_group(_TINY, _HERE)
    assert uncompiled({"clocks"}, [_TINY], _HERE) == []
    assert len(kernel_of(_MODULE, "doubled").signatures) == 1
    assert list(tiny.parent.glob("__pycache__/*.nbc"))
    tiny.write_text(_SOURCE.replace("2.0", "3.0"))
    assert uncompiled({"clocks"}, [_TINY], _HERE) == [_TINY]


def test_nothing_that_fails_is_raised(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A function that does not compile, one that does not exist, and a folder that is full leave the run alone."""
    wrong = KernelGroup(_MODULE, ("clocks",), {"doubled": ["unicode_type"], "missing": ["float64"]})
    compile_group(wrong, _HERE)
    assert not kernel_of(_MODULE, "doubled").signatures

    def full(_: Path, __: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kernels, "write_text", full)
    compile_group(_TINY, _HERE)
    assert kernel_of(_MODULE, "doubled").signatures
    assert uncompiled({"clocks"}, [_TINY], _HERE) == [_TINY]


@pytest.mark.usefixtures("tiny")
def test_says_once_that_it_compiles(capsys: pytest.CaptureFixture[str]) -> None:
    """Processes compile what is missing behind one line; the next run says nothing."""
    with ProcessExecutor(1) as executor:
        assert compile_for(_CLOCKS, executor, [None], [_TINY]) == [_TINY]
        assert capsys.readouterr().err.count(COMPILING) == 1
        assert compile_for(_CLOCKS, executor, [None], [_TINY]) == ()
        assert capsys.readouterr().err == ""
    assert compile_for(_CLOCKS, InProcess(), [None], [_TINY]) == ()


@pytest.mark.usefixtures("tiny")
def test_nothing_is_compiled_for_a_file_that_does_not_open(tmp_path: Path) -> None:
    """A truncated file is reported at once, without a minute of compiling; beside one that opens it changes nothing."""
    whole, cut = write_handmade(tmp_path / "whole.h5"), tmp_path / "cut.h5"
    cut.write_bytes(whole.read_bytes()[:5000])
    with ProcessExecutor(1) as executor:
        assert compile_for(_CLOCKS, executor, [opening_test(cut)], [_TINY]) == ()
        assert compile_for(_CLOCKS, executor, [opening_test(cut), opening_test(whole)], [_TINY]) == [_TINY]


def test_groups_of_calls() -> None:
    """Functions of a module are one group, with each subject that calls one; two types of one function are refused."""
    module, calls = "fedora_qa.estimators.fitting.quantile_kernels", []
    for name in ("median_of", "percentile_of"):
        calls.append(frozenset({(module, name, json.dumps([f"float64[:] of {name}"]))}))
    (group,) = groups_of({"depth": [calls[0]], "clocks": calls})
    assert group.subjects == ("clocks", "depth")
    assert dict(group.argument_types) == {name: [f"float64[:] of {name}"] for name in ("median_of", "percentile_of")}
    with pytest.raises(ValueError, match="alone"):
        groups_of({"depth": calls, "clocks": [frozenset({(module, "median_of", '["int64[:]"]')})]})
