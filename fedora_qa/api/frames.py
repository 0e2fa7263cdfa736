"""Tables of a record as data frames. pandas is an extra, imported only where a data frame is requested."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from fedora_qa.errors import MisuseError
from fedora_qa.record.tables import Kind, Table

if TYPE_CHECKING:
    import pandas as pd

# Types that allow missing values: NumPy's int64 has none, pandas' Int64 does.
_TYPES: Final[Mapping[Kind, str]] = {
    "text": "string",
    "texts": "object",
    "integer": "Int64",
    "integers": "object",
    "number": "float64",
    "scalar": "object",
}


def frame_of(table: Table) -> "pd.DataFrame":
    """Return a table as a data frame; the types of its columns do not depend on what they hold.

    Raises
    ------
    MisuseError
        pandas is not installed.
    """
    try:
        import pandas as pd  # noqa: PLC0415 - an extra
    except ImportError as missing:
        raise MisuseError(
            f"Expected what makes data frames, got: {missing}; install it with pip install 'fedora-qa[notebook]'"
        ) from None
    columns = {
        # An explicit type: inferred ones would differ between records, and for columns without values.
        column.name: pd.Series([row[place] for row in table.rows], dtype=_TYPES[column.kind])
        for place, column in enumerate(table.columns)
    }
    return pd.DataFrame(columns)
