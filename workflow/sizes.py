"""Print the size of each package: files, lines of code and syntax nodes.

Usage: python workflow/sizes.py, from the top of the repository. No limit is attached to
these sizes.
"""

import ast
import tokenize
from pathlib import Path

FOLDERS = ("src/elastocal", "src/elastocal_proof", "tests", "workflow", "benchmarks")
# Tokens that a line without code consists of.
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}


def count_code_lines(path: Path) -> int:
    """Count the lines that hold code or a docstring."""
    lines: set[int] = set()
    with tokenize.open(path) as file:
        for token in tokenize.generate_tokens(file.readline):
            if token.type not in LAYOUT:
                lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines)


def count_nodes(path: Path) -> int:
    """Count the nodes of the syntax tree without the contexts of names."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return sum(not isinstance(node, ast.expr_context) for node in ast.walk(tree))


def print_size(folder: Path) -> None:
    files = sorted(folder.rglob("*.py"))
    lines = sum(map(count_code_lines, files))
    nodes = sum(map(count_nodes, files))
    print(f"{folder.as_posix():32} {len(files):5} {lines:7} {nodes:8}")


if __name__ == "__main__":
    print(f"{'folder':32} {'files':>5} {'lines':>7} {'nodes':>8}")
    for top in map(Path, FOLDERS):
        print_size(top)
        if top.parts[0] == "src":
            for package in sorted(top.iterdir()):
                if (package / "__init__.py").is_file():
                    print_size(package)
