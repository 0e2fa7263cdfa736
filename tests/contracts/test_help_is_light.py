"""Commands answer quickly when they are only asked what they do."""

import subprocess
import sys

HEAVY = ("numpy", "scipy", "numba", "h5py", "cv2", "pydantic")

ALL_HELP = f"""
import sys
from click.testing import CliRunner
from fedora_generator import cli as generator
from fedora_qa.cli import main as qa
for group, table in ((qa.fedora_qa, qa.COMMANDS), (generator.commands, generator.COMMANDS)):
    for arguments in ([], *([name] for name in table)):
        shown = CliRunner().invoke(group, [*arguments, "--help"])
        assert shown.exit_code == 0 and "Usage" in shown.output, shown
        print(" ".join([group.name, *arguments]), [name for name in {HEAVY} if name in sys.modules], sep=": ")
import fedora_qa.cli.check
print(*(name for name in {HEAVY[1:-1]} if name in sys.modules))
import fedora_qa.cli.gate
print(*(name for name in {HEAVY} if name in sys.modules))
"""


def test_no_help_loads_a_numerical_library() -> None:
    """Help of every command of both programs comes without arrays, HDF5 and compilers; the work of one loads them."""
    done = subprocess.run([sys.executable, "-c", ALL_HELP], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    *helped, deals, worked = done.stdout.splitlines()
    assert len(helped) > 20
    assert [line for line in helped if not line.endswith(": []")] == []
    assert deals == ""
    assert "h5py" in worked.split()
