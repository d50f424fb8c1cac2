"""The script of the page, which is joined from modules."""

import re
from pathlib import Path

from slipsweep.explore import scripts

FOLDER = Path(scripts.__file__).parent / "script"

IMPORT = re.compile(r'^import \{([^}]*)\} from "\./(\w+)\.js";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?:async )?(?:function|const|let) (\w+)", re.MULTILINE)
TOP_LEVEL = re.compile(r"^(?:async )?(?:function|const|let) (\w+)", re.MULTILINE)

SOURCES = {name: (FOLDER / f"{name}.js").read_text(encoding="utf-8") for name in scripts.MODULES}


def test_every_module_is_in_the_page() -> None:
    there = {path.name for path in FOLDER.iterdir()}
    assert there == {f"{name}.js" for name in scripts.MODULES}


def test_modules_come_after_those_they_import() -> None:
    exports: dict[str, set[str]] = {}
    for name, source in SOURCES.items():
        for imported, module in IMPORT.findall(source):
            assert {*re.findall(r"\w+", imported)} <= exports.get(module, set()), name
        exports[name] = {*EXPORT.findall(source)}


def test_the_joined_script_has_no_imports_and_each_name_once() -> None:
    script = scripts.page_script()
    assert not re.search(r"^(import|export)\b", script, re.MULTILINE)
    names = TOP_LEVEL.findall(script)
    assert names
    assert sorted(names) == sorted({*names})
