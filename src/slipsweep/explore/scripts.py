"""The two scripts of a page: Bokeh's library, and the modules in the folder `script`."""

import base64
import hashlib
import re
from importlib.resources import files

#: The modules, each after those that it imports.
MODULES = (
    "elements",
    "data",
    "selection",
    "axes",
    "words",
    "marks",
    "figures",
    "histories",
    "map",
    "readout",
    "controls",
    "pointer",
    "start",
)

#: What a script in the page cannot have: it has no files to import from.
_IMPORT_OR_EXPORT = re.compile(r"^import [^;]*;\n|^export ", re.MULTILINE)


def page_script() -> str:
    """Join the modules to one script.

    All their names share one scope: each stands once, and browsers refuse a name that does not.
    """
    folder = files("slipsweep.explore") / "script"
    modules = [(folder / f"{name}.js").read_text(encoding="utf-8") for name in MODULES]
    return "\n".join(_IMPORT_OR_EXPORT.sub("", module) for module in modules)


def bokeh_script() -> str:
    """Return Bokeh's library."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)


def digest(script: str) -> str:
    """Digest by which a content security policy allows an inline script."""
    sha256 = hashlib.sha256(script.encode()).digest()
    return f"'sha256-{base64.b64encode(sha256).decode()}'"
