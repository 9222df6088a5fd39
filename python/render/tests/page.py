"""The tables of docs/python-render.md, from `benchmarks/agreement.json`."""

from __future__ import annotations

import json
import pathlib
import statistics
from typing import Any

_PACKAGE = pathlib.Path(__file__).resolve().parent.parent
RESULT = _PACKAGE / "benchmarks" / "agreement.json"
PAGE = _PACKAGE.parent.parent / "docs" / "python-render.md"
_BEGIN, _END = "<!-- begin of agreement.json -->", "<!-- end of agreement.json -->"

# PSNR below which a view needs a cause [dB].
LEAST = 30.0
# Causes of views below that, by model and view.
CAUSES: dict[tuple[str, str], str] = {}


def rounded(result: dict[str, Any]) -> dict[str, Any]:
    """The result with few digits."""
    digits = {"psnr": 1, "plain": 1, "near": 3, "segmentation": 5}
    views = {
        name: {
            view: {key: round(x, digits[key]) if key in digits else float(f"{x:.1e}") for key, x in row.items()}
            for view, row in rows.items()
        }
        for name, rows in result["models"].items()
    }
    return {**result, "models": views}


def _column(result: dict[str, Any], key: str) -> list[float]:
    return sorted(row[key] for rows in result["models"].values() for row in rows.values())


def _below(values: list[float], fraction: float) -> float:
    return values[int(fraction * len(values))]


def low_views(result: dict[str, Any]) -> dict[tuple[str, str], float]:
    """PSNR of all views that need a cause."""
    views = ((name, view, row["psnr"]) for name, rows in result["models"].items() for view, row in rows.items())
    return {(name, view): value for name, view, value in views if value < LEAST}


def summary(result: dict[str, Any]) -> list[str]:
    """Lines of the table of agreement."""
    colors, plain, near = (_column(result, key) for key in ("psnr", "plain", "near"))
    ids, depth = _column(result, "segmentation"), _column(result, "depth")
    share = lambda values, good: 100 * sum(map(good, values)) / len(values)  # noqa: E731
    count = len(low_views(result))
    low = f"{count} view{'' if count == 1 else 's'}"
    height, width = result["size"]
    return [
        f"{len(result['models'])} models, {len(colors)} views of {width} x {height}, `mujoco` {result['mujoco']}:",
        "",
        "| image | agreement |",
        "|---|---|",
        f"| segmentation, inside | equal everywhere in {share(ids, lambda x: x == 1):.0f} % of the views; equal for at least "
        f"0.999 of the pixels in {share(ids, lambda x: x >= 0.999):.0f} % |",
        f"| depth, inside | median of relative differences: in the median view {statistics.median(depth):.0e}, below 1e-6 in "
        f"{share(depth, lambda x: x < 1e-6):.0f} % of the views |",
        f"| color | PSNR: median {statistics.median(colors):.1f} dB, a tenth of the views below "
        f"{_below(colors, 0.1):.1f} dB, {low} below {LEAST:.0f} dB; in the median view, "
        f"{100 * statistics.median(near):.0f} % of the pixels are within 4 of 255 |",
        f"| color, without shadows and reflections | PSNR: median {statistics.median(plain):.1f} dB, a tenth of the views "
        f"below {_below(plain, 0.1):.1f} dB |",
    ]


def tables() -> str:
    """The text of the page between the marks."""
    result = json.loads(RESULT.read_text())
    lines = summary(result)
    low = low_views(result)
    if low:
        lines += ["", f"The views below {LEAST:.0f} dB, and their causes:", "", "| view | PSNR | cause |", "|---|--:|---|"]
        lines += [
            f"| {name}, {view} | {value:.1f} | {CAUSES.get((name, view), 'unknown')} |"
            for (name, view), value in sorted(low.items(), key=lambda item: item[1])
        ]
    return "\n".join(lines)


def _split() -> tuple[str, str, str]:
    text = PAGE.read_text()
    before, rest = text.split(_BEGIN)
    middle, after = rest.split(_END)
    return before, middle, after


def is_current() -> bool:
    """True if the page has the tables of the result."""
    return _split()[1].strip() == tables().strip()


def write() -> None:
    """Writes the tables into the page."""
    before, _, after = _split()
    PAGE.write_text(f"{before}{_BEGIN}\n{tables()}\n{_END}{after}")
