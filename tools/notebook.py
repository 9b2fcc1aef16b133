"""Run a notebook's cells in order and write their output into it: `python -m tools.notebook docs/first_map.ipynb`.

It needs no Jupyter: what a cell prints, its figures and its last value become its output, as Jupyter would show them.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any

DPI = 75  # small pictures: they are in the repository


def run_notebook(path: Path) -> dict[str, Any]:
    """Return the notebook with the output of its cells; an error of a cell is raised."""
    import matplotlib as mpl

    mpl.use("Agg")
    notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "__main__"}
    codes = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for count, cell in enumerate(codes, 1):
        cell["execution_count"], cell["outputs"] = count, _outputs("".join(cell["source"]), names, count)
    return notebook


def write_notebook(path: Path, notebook: dict[str, Any]) -> None:
    """Write it as Jupyter does."""
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _outputs(source: str, names: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """Run one cell; return what it prints, its last value and its figures."""
    from matplotlib import pyplot as plt

    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) and not source.endswith(";") else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "<cell>", "exec"), names)  # noqa: S102  # our own notebook
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)  # noqa: S307
    outputs: list[dict[str, Any]] = []
    if printed.getvalue():
        text = printed.getvalue().splitlines(keepends=True)
        outputs.append({"name": "stdout", "output_type": "stream", "text": text})
    if value is not None:
        data = {"text/plain": repr(value).splitlines(keepends=True)}
        outputs.append({"data": data, "execution_count": count, "metadata": {}, "output_type": "execute_result"})
    outputs += [_picture(number) for number in plt.get_fignums()]
    plt.close("all")
    return outputs


def _picture(number: int) -> dict[str, Any]:
    from matplotlib import pyplot as plt

    file = io.BytesIO()
    plt.figure(number).savefig(file, format="png", dpi=DPI, bbox_inches="tight")
    data = {"image/png": base64.b64encode(file.getvalue()).decode("ascii"), "text/plain": ["<Figure>"]}
    return {"data": data, "metadata": {}, "output_type": "display_data"}


if __name__ == "__main__":
    for word in sys.argv[1:]:
        write_notebook(Path(word), run_notebook(Path(word)))
