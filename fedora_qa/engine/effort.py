"""How much of a file is measured, by name; ``plan.py`` defines each. No large library is imported here."""

from typing import Literal

Effort = Literal["quick", "standard", "full", "exhaustive"]
