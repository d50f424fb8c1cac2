"""Blocks that slide both ways, in 30 digits: ``python -m benchmarks.both_ways``.

Solves the cells of tests/support/both_ways.py and all their neighbours one ulp away in multiple
precision into tests/data/both_ways.csv, and writes both_ways.md.  Nothing is timed.
"""

from statistics import median

from benchmarks.machine import arguments, number, table
from tests.support.both_ways import CATEGORIES, Row, cells, row_of, solve_by_package, write_rows


def errors_table(rows: list[Row]) -> str:
    """Return a line a category: its cells, and the errors in units of the conditioning."""
    lines = []
    for category in CATEGORIES:
        of_category = [row for row in rows if row.category == category.__name__]
        if of_category:
            errors = [row.times_bounds(solve_by_package(row.cell)) for row in of_category]
            about = (category.__doc__ or "").rstrip(".")
            lines.append(
                [about, len(of_category), number(median(errors), 2), number(max(errors), 2)]
            )
    return table(["cells", "number", "error, median", "largest"], lines)


def main() -> None:
    """Write the table of cells, and the page."""
    options = arguments(__doc__)
    chosen = list(cells())[: 1 if options.tiny else None]
    rows = [row_of(category, cell) for category, cell in chosen]
    if not options.tiny:
        write_rows(rows)
    about = (
        "Errors of displacements and peak velocity, in units of what one ulp of an input moves, "
        "plus half an ulp. Written by `python -m benchmarks.both_ways`."
    )
    (options.folder / "both_ways.md").write_text(
        f"{errors_table(rows)}\n{about}\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
