"""Lines of product code by room, without blank lines, comments and docstrings.

A room is a folder of the core with the folder below it (`nodes/light`), a ring is `rings/NAME`.
"""

import ast
import re
import subprocess
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections import Counter
from pathlib import Path

HOUSES = ("graph", "nodes", "kernels", "pipelines", "firmware", "tactograph", "rings")
KINDS = {".py": "Python", ".cl": "kernels", ".clh": "kernels", ".yaml": "YAML"}
COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)


def python_lines(text: str) -> int:
    strings = {
        line
        for each in ast.walk(ast.parse(text))
        if isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)
        for line in range(each.lineno, (each.end_lineno or each.lineno) + 1)
        if isinstance(each.value.value, str)
    }
    lines = enumerate(map(str.strip, text.splitlines()), start=1)
    return sum(number not in strings and line[:1] not in ("", "#") for number, line in lines)


def code_lines(file: Path) -> int:
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".py":
        return python_lines(text)
    text = re.sub(r"(?m)^\s*#.*$", "", text) if file.suffix == ".yaml" else COMMENT.sub("", text)
    return sum(map(bool, map(str.strip, text.splitlines())))


def main(folder: Path) -> None:
    names = subprocess.check_output(["git", "ls-files", *HOUSES], cwd=folder, text=True)
    counts = Counter[tuple[str, str]]()
    for name in map(Path, names.split("\n")):
        if name.suffix in KINDS and (folder / name).is_file() and "tests" not in name.parts:
            counts["/".join(name.parts[:-1][:2]), KINDS[name.suffix]] += code_lines(folder / name)
    kinds = sorted({*KINDS.values()})
    print(f"{'':24}", *(f"{kind:>8}" for kind in kinds))
    rooms = sorted({room for room, _ in counts})
    core = [room for room in rooms if not room.startswith("rings/")]
    rows = {room: [room] for room in rooms} | {"core": core, "all": rooms}
    for title, summed in rows.items():
        print(f"{title:24}", *(f"{sum(counts[each, kind] for each in summed):8}" for kind in kinds))


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=Path(), help="a checkout")
    main(parser.parse_args().folder)
