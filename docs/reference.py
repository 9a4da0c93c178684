"""Turns a file into what doxygen understands, for ./run docs: reference.py FILE.

In documents, links to other documents and to public headers become references, and those to other
files of the tree lead there from build/docs/html. In the C interface plain comments become
documentation.
"""
import os
import re
import sys

# a block of code, a link, or code in a line
PARTS = re.compile(r"^```.*?^```$|\[((?:`[^`]*`|[^]`])*)\]\(([^()\s]+)\)|`[^`\n]*`", re.M | re.S)
LIBRARIES = ("analysis", "controller", "lcmtypes", "sim", "text")
TO_TREE = "../../../"


def page(path):
    return "index" if path == "README.md" else "md_" + path[:-3].replace("/", "_").replace("-", "_")


def link(path, text, target):
    if "://" in target:
        return f"[{text}]({target})"
    file = target.partition("#")[0]
    if not file:  # doxygen has no names for headings
        return text
    file = os.path.normpath(os.path.join(os.path.dirname(path), file))
    if not os.path.exists(file):
        return f"[{text}](@ref {file})"  # which doxygen reports
    if file.endswith(".md"):
        return f"[{text}](@ref {page(file)})"
    if os.path.dirname(file) in LIBRARIES and file.endswith((".h", ".hpp")):
        return f"[{text}](@ref {file})"
    return f"[{text}]({TO_TREE}{file})"


def document(path, text):
    def part(match):
        return match[0] if match[2] is None else link(path, match[1], match[2])

    return PARTS.sub(part, text)


def interface(text):
    lines = [line for line in text.splitlines() if "NOLINT" not in line]
    lines = [re.sub(r"^( *)/\*", r"\1/**", re.sub(r"([;,{]) */\*", r"\1 /**<", line))
             for line in lines]
    return "\n".join(lines).replace("/**", "/** @file\n", 1)


def main(path):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    path = os.path.relpath(path)
    print(document(path, text) if path.endswith(".md") else interface(text))


main(*sys.argv[1:])
