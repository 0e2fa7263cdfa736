"""How much of a file is looked at, by name; what each means is in ``plan.py``. Nothing heavy is imported here."""

from typing import Literal

Effort = Literal["quick", "standard", "full", "exhaustive"]
