"""Writes sources in which changes can be switched on at run time."""

import re
from pathlib import Path

INCLUDE = '#include <dashpot/tests/mutate/mutant.hpp>\n#line 1 "{path}"\n'


def rewritten(text, numbered):
    """`text` (bytes) with its changes, [(number, change)]; they may lie within each other."""
    edits = [(change.begin, change.end, number, change) for number, change in numbered]
    for change in dict.fromkeys(change.keyword for _, change in numbered if change.keyword):
        edits.append((change[0], change[1], 0, change[2]))
    edits.sort(key=lambda edit: (edit[0], -edit[1]))

    def render(begin, end, first, last):
        parts, at = [], begin
        while first < last:
            edit_begin, edit_end, number, change = edits[first]
            inner = first + 1
            while inner < last and edits[inner][0] < edit_end:
                inner += 1
            parts.append(text[at:edit_begin].decode())
            if number:
                old = render(edit_begin, edit_end, first + 1, inner)
                parts.append(change.form.format(k=number, new=change.new, old=old))
            else:
                parts.append(change)
            at, first = edit_end, inner
        parts.append(text[at:end].decode())
        return "".join(parts)

    return render(0, len(text), 0, len(edits)).encode()


def copy_tree(root, target, numbered):
    """Makes `target` a copy of the project below `root` with the changes. What is as before is not
    touched; returns the names of the other files."""
    by_file, written = {}, []
    for number, change in numbered:
        by_file.setdefault(change.file, []).append((number, change))
    kept = set()
    tops = [top for top in Path(root).iterdir() if not re.match(r"build|\.", top.name)]
    for source in [path for top in tops for path in (top, *top.rglob("*")) if path.is_file()]:
        name = source.relative_to(root)
        content = source.read_bytes()
        changes = by_file.get(str(name))
        if changes:
            content = INCLUDE.format(path=source).encode() + rewritten(content, changes)
        copy = Path(target, name)
        if not copy.exists() or copy.read_bytes() != content:
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(content)
            written.append(str(name))
        kept.add(name)
    for old in Path(target).rglob("*"):
        name = old.relative_to(target)
        if name.parts[0] != "build" and name not in kept and old.is_file():
            old.unlink()
    return written
