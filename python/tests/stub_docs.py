"""Documentation in the stubs of the extension module, which editors show: that of the module itself, from its Rust sources.

``python python/tests/stub_docs.py`` writes it into the stubs of this repository. It needs the package built from the same
sources. A test compares.
"""

from __future__ import annotations

import ast
import sys
import textwrap
from pathlib import Path
from types import ModuleType
from typing import Any

# Files of the stub: the module, and those of the classes that it imports.
STUBS = ("_sim.pyi", "_sim_entities.pyi", "_sim_kinematics.pyi", "_sim_views.pyi")
# Length of lines.
WIDTH = 120


def docstring(text: str, indent: int) -> list[str]:
    """Lines of a documentation string. Paragraphs are filled again, because their indentation in Rust is another one."""
    space, lines = " " * indent, []
    for paragraph in text.split("\n\n"):
        # The marks take three characters of the first line, and three at the end of a text of one line.
        marks = {"initial_indent": "" if lines else '"""', "width": WIDTH - indent - 3}
        lines += [*([""] if lines else []), *textwrap.wrap(" ".join(paragraph.split()), **marks)]
    lines = [f"{space}{line}".rstrip() for line in lines]
    if len(lines) > 1:
        return [*lines, f'{space}"""']
    return [lines[0] + (' """' if lines[0].endswith('"') else '"""')]


def is_documented(name: str) -> bool:
    """True for public names. Python itself documents its special methods."""
    return not name.startswith("_")


def documented(stub: str, module: ModuleType) -> str:
    """The stub with the documentation of the module at each public class, property, method and function.

    Raises ``ValueError`` for an item without documentation.
    """
    lines = stub.split("\n")

    def document(owner: Any, body: list[ast.stmt], prefix: str) -> None:
        # From the end, so that line numbers stay.
        for node in reversed(body):
            if not isinstance(node, ast.ClassDef | ast.FunctionDef) or not is_documented(node.name):
                continue
            item = getattr(owner, node.name)
            if isinstance(node, ast.ClassDef):
                document(item, node.body, f"{node.name}.")
            text = getattr(item, "__doc__", None)
            if not text:
                raise ValueError(f"{prefix}{node.name} has no documentation")
            first = node.body[0]
            is_old = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)
            new = docstring(text, node.col_offset + 4)
            if is_old:
                lines[first.lineno - 1 : first.end_lineno] = new
            elif isinstance(node, ast.ClassDef):
                start = min([first.lineno, *(decorator.lineno for decorator in getattr(first, "decorator_list", []))])
                lines[start - 1 : start - 1] = [*new, ""]
            else:
                # The body `...` is on the last line of the signature.
                at = first.lineno - 1
                lines[at] = lines[at].removesuffix("...").rstrip()
                lines[at + 1 : at + 1] = new

    document(module, ast.parse(stub).body, "")
    return "\n".join(lines)


if __name__ == "__main__":
    from kinetoscope import _sim

    folder = Path(__file__).parents[1] / "sim" / "kinetoscope"
    for file in STUBS:
        text = (folder / file).read_text()
        (folder / file).write_text(documented(text, _sim))
    sys.stdout.write(f"{folder}: {', '.join(STUBS)}\n")
