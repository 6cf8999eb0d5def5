"""Writes plumbline.py from plumbline.xml: `python -m autopilot.wire.dialect.generate`.

The included common.xml, standard.xml and minimal.xml are those of the installed pymavlink; the first line of
the result states its version. No network is needed.
"""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import sys
import tempfile
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

from pymavlink.generator import mavgen

DIALECT = Path(__file__).with_name("plumbline.xml")
MISSING = Path(__file__).with_name("missing.xml")  # what pymavlink's common.xml lacks
MODULE = Path(__file__).with_name("plumbline.py")
_INCLUDED = ("common.xml", "standard.xml", "minimal.xml")
# Extension fields of MAVLink's common.xml that pymavlink's copy lacks, added after its own
_EXTENSIONS = {
    "MISSION_COUNT": {"opaque_id": "Number of this version of the plan; 0: none, or not told."},
    "MISSION_ACK": {"opaque_id": "Number of this version of the plan; 0: none, or not told."},
    "MISSION_CURRENT": {
        "mission_id": "Number of this version of the mission; 0: none.",
        "fence_id": "Number of this version of the fence; 0: none.",
        "rally_points_id": "Number of this version of the rally points; 0: none.",
    },
}
_STAMP = "# Generated with pymavlink "


def add_extensions(text: str) -> str:
    """common.xml with the extension fields that it lacks."""
    for message, fields in _EXTENSIONS.items():
        found = re.search(rf'<message id="\d+" name="{message}">.*?</message>', text, re.DOTALL)
        if found is None:
            raise RuntimeError(f"common.xml has no {message}")
        lacking = [name for name in fields if f'name="{name}"' not in found[0]]
        lines = [f'<field type="uint32_t" name="{name}">{fields[name]}</field>' for name in lacking]
        if lines and "<extensions/>" not in found[0]:
            lines.insert(0, "<extensions/>")
        text = text.replace(found[0], found[0].replace("</message>", "\n".join(lines) + "\n</message>"))
    return text


def generate_module() -> bytes:
    """The module that the installed pymavlink makes of plumbline.xml."""
    definitions = Path(str(files("pymavlink") / "dialects" / "v20"))
    with tempfile.TemporaryDirectory() as folder:
        for source in (MISSING, *(definitions / name for name in _INCLUDED)):
            shutil.copy(source, folder)
        common = Path(folder) / "common.xml"
        common.write_text(add_extensions(common.read_text(encoding="utf-8")), encoding="utf-8")
        include = "<include>{}</include>".format
        both = include("common.xml") + include(MISSING.name)
        text = DIALECT.read_text(encoding="utf-8").replace(include("common.xml"), both)
        (Path(folder) / DIALECT.name).write_text(text, encoding="utf-8")
        output = Path(folder) / "out" / "plumbline.py"
        output.parent.mkdir()
        options = mavgen.Opts(str(output), wire_protocol="2.0", language="Python3", validate=False)
        chatter = io.StringIO()
        with contextlib.redirect_stdout(chatter), contextlib.redirect_stderr(chatter):
            done = mavgen.mavgen(options, [str(Path(folder) / DIALECT.name)])
        if not done or not output.is_file():
            raise RuntimeError(f"mavgen refused {DIALECT.name}:\n{chatter.getvalue()}")
        return f"{_STAMP}{version('pymavlink')}\n".encode() + output.read_bytes()


def generator_version() -> str:
    """The version of pymavlink that made the module on disk; empty if the module does not state it."""
    with MODULE.open(encoding="utf-8") as module:
        first = module.readline().strip()
    return first.removeprefix(_STAMP) if first.startswith(_STAMP) else ""


def main() -> None:
    """Replace plumbline.py."""
    text = generate_module()
    MODULE.write_bytes(text)
    sys.stdout.write(f"{MODULE}: {len(text)} bytes, pymavlink {version('pymavlink')}\n")


if __name__ == "__main__":
    main()
