"""Tables."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas
    import pyarrow


class Table(Mapping[str, np.ndarray]):
    """Table of columns of equal length, as NumPy arrays by name.

    Numbers are float64 with NaN for missing values, counts int64, times datetime64[ns] in UTC, texts objects.
    Implements the Arrow PyCapsule interface, so that Arrow, Polars, DuckDB and others read it directly.
    """

    def __init__(self, columns: list[tuple[str, str, Any]]) -> None:
        self._columns: dict[str, np.ndarray] = {}
        for name, kind, values in columns:
            if kind == "text":
                array = np.empty(len(values), dtype=object)
                array[:] = values
            elif kind == "time":
                array = values.view("datetime64[ns]")
            else:
                array = values
            self._columns[name] = array

    def __getitem__(self, name: str) -> np.ndarray:
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        """Number of columns, as for any mapping; ``num_rows`` is the number of rows."""
        return len(self._columns)

    @property
    def num_rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self._columns.values()), ()))

    def to_pandas(self) -> pandas.DataFrame:
        """Return the table as a pandas DataFrame; needs pandas."""
        import pandas

        return pandas.DataFrame(self._columns)

    def to_arrow(self) -> pyarrow.Table:
        """Return the table as a pyarrow Table with nulls for missing values; needs pyarrow."""
        import pyarrow

        arrays = {
            name: pyarrow.array(list(array), pyarrow.string())
            if array.dtype == object
            else pyarrow.array(array, from_pandas=True)
            for name, array in self._columns.items()
        }
        return pyarrow.table(arrays)

    def to_csv(self) -> str:
        """Return the table as CSV; every number keeps its value, and missing values are empty."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self._columns)
        writer.writerows(zip(*(_texts(array) for array in self._columns.values())))
        return out.getvalue()

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        return f"Table({self.num_rows} rows: {', '.join(self._columns)})"


def _texts(array: np.ndarray) -> list[str]:
    """Return cells as text."""
    if array.dtype.kind == "M":
        return [f"{time}Z" for time in array]
    return ["" if cell != cell else str(cell) for cell in array.tolist()]
