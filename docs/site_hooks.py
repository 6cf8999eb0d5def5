"""Links from notebooks to pages of the site, which mkdocs itself converts in Markdown only, and what is left
out of the sources from which the API is read."""

from __future__ import annotations

import ast
import logging
import posixpath
import re
from typing import Any

from griffe import Extension

_LINK = re.compile(r'href="(?![a-z]+:)([^"#]+\.md)(#[^"]*)?"')
_log = logging.getLogger("mkdocs.plugins.site_hooks")  # its warnings fail a strict build


def on_page_content(html: str, *, page: Any, config: Any, files: Any) -> str:
    """Convert the links of a notebook to `page.md` into links to pages of the site; mkdocs calls this."""
    if not page.file.src_uri.endswith(".ipynb"):
        return html

    def linked(found: re.Match[str]) -> str:
        place, anchor = found.groups(default="")
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page.file.src_uri), place))
        target = files.get_file_from_path(path)
        if target is None:
            _log.warning("%s: a link to %s, which is no page", page.file.src_uri, place)
            return found.group()
        return f'href="{target.url_relative_to(page.file)}{anchor}"'

    return _LINK.sub(linked, html)


class WithoutDialect(Extension):
    """Leaves out the generated dialect when the sources are read for the API: no page shows it, and it takes
    longer than all other modules together."""

    def on_module_node(self, *, node: ast.Module, agent: Any, **_: Any) -> None:
        """Forget the contents of the module; griffe calls this before it reads them."""
        if "dialect" in agent.filepath.parts:
            node.body.clear()
