"""How loops are compiled that count no references to arrays."""

from typing import Any, Final

UNCOUNTED: Final[dict[str, Any]] = {"_nrt": False}
"""Options of ``numba.njit`` for a loop that makes no arrays, and whose callees make none.

Numba counts the references to each array, atomically, wherever compiled code passes it on. In the loops over pixels
that costs more than their arithmetic (``adaptive/README.md``). Numba does not compile such a loop if it makes an array.
"""
