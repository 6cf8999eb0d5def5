"""docs/report.md has every key of the record as `gcs/analysis/metrics.toml` defines it.

To write these tables anew: python tests/documentation/test_record.py > part, and put it in the page.
"""

from __future__ import annotations

from pathlib import Path

from gcs.analysis.definitions import GROUPS

PAGE = Path(__file__).parents[2] / "docs" / "report.md"


def tables() -> str:
    """A heading, a note and a table for each group."""
    lines = []
    for group, metrics in GROUPS:
        lines += [f"### {group.title}", *([group.note, ""] if group.note else [])]
        lines += ["| key | unit | what it is |", "|---|---|---|"]
        lines += [f"| `{metric.name}` | {metric.unit} | {metric.text} |" for metric in metrics]
        lines.append("")
    return "\n".join(lines)


def test_the_page_has_every_key_as_it_is_defined() -> None:
    assert tables() in PAGE.read_text(encoding="utf-8"), f"run: python {Path(__file__).name}"


if __name__ == "__main__":
    print(tables())
