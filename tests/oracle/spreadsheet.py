"""Writes crates/import/tests/data/log.ods with odfpy (python3 -m pip install odfpy; python3 tests/oracle/spreadsheet.py):
a sheet of one line, then one with date and time of day in columns of their own, as LibreOffice Calc keeps them."""

import pathlib

from odf.opendocument import OpenDocumentSpreadsheet
from odf.table import Table, TableCell, TableRow
from odf.text import P

OUT = pathlib.Path(__file__).parents[2] / "crates/import/tests/data/log.ods"


def cell(value):
    if isinstance(value, float):
        made = TableCell(valuetype="float", value=value)
    elif value.startswith("PT"):
        made = TableCell(valuetype="time", timevalue=value)
    elif value[:2] == "20":
        made = TableCell(valuetype="date", datevalue=value)
    else:
        made = TableCell(valuetype="string")
        made.addElement(P(text=value))
    return made


book = OpenDocumentSpreadsheet()
sheets = {
    "notes": [["methane at the well"]],
    "log": [
        ["date", "time", "lat", "lon", "alt (m AMSL)", "CH4 (ppm)"],
        *(["2024-05-01", f"PT10H00M{s:02}S", 43.5, -7.5, 340.0, round(1.95 + s / 100, 2)] for s in range(3)),
    ],
}
for name, rows in sheets.items():
    table = Table(name=name)
    for row in rows:
        line = TableRow()
        for value in row:
            line.addElement(cell(value))
        table.addElement(line)
    book.spreadsheet.addElement(table)
book.save(OUT)
