"""Pages in one file: they contain their scripts and styles, load nothing, and run no other script."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from gcs.web import asset

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"


def embedded(values: Any) -> str:
    """JSON that is safe as the text of a script element: no `<`, no character beyond ASCII."""
    text = json.dumps(values, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def render(
    package: str, template: str, scripts: Sequence[str], styles: Sequence[str], data: Any, **values: Any
) -> str:
    """The page from a template of `package`, in which `policy`, `styles`, `data` and `scripts` are inserted.
    `scripts` and `styles` are names of files of `gcs.web`. Every other value is escaped."""
    from jinja2 import Environment
    from markupsafe import Markup

    texts = [asset(name) for name in scripts]
    hashes = " ".join(f"'sha256-{_digest(text)}'" for text in texts)
    source = files(package).joinpath(template).read_text(encoding="utf-8")
    # the template is ours, but not every value is: escape them all
    return (
        Environment(autoescape=True)
        .from_string(source)
        .render(
            policy=f"{_POLICY}; script-src {hashes}",
            styles=Markup("\n".join(asset(name) for name in styles)),
            data=Markup(embedded(data)),
            scripts=Markup("\n".join(f"<script>{text}</script>" for text in texts)),
            **values,
        )
    )


def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
